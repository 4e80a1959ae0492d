//! Number of steps, and the learning rate of each.

use std::f64::consts::PI;
use std::fmt;

use serde::{Deserialize, Serialize};

/// Fractions of [`DROPS_OF`] at which the rate is divided by ten: 190 000, 195 000, 199 000 and 199 500 of the paper's 200 000 steps.
const DROPS: [u64; 4] = [380, 390, 398, 399];
const DROPS_OF: u64 = 400;
/// Number of batches that the authors' code trains on before it evaluates [`EVALUATING`] test batches.
const TRAINING: u64 = 440;
/// Number of test batches between two rounds of training batches.
const EVALUATING: u64 = 60;

/// Unit of `steps`.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum StepCounting {
    /// Steps of the optimiser, as the paper's text says.
    Optimiser,
    /// Batches of training and test together, 440 and 60 in turn, as counted by the authors' code: 176 000 steps of the
    /// optimiser for 200 000. Only training batches are computed here; evaluation has its own interval.
    Batches,
}

impl fmt::Display for StepCounting {
    /// Writes the name used in configurations.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Optimiser => "optimiser",
            Self::Batches => "batches",
        })
    }
}

/// Decay of the learning rate.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum RateSchedule {
    /// By a factor of ten after 95, 97.5, 99.5 and 99.75 % of the steps, as in the paper.
    #[default]
    Drops,
    /// Along half a cosine to 0 (Loshchilov and Hutter 2017, arXiv:1608.03983, equation 5, without restarts).
    Cosine,
}

/// Learning rates by step of the optimiser.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Schedule {
    /// Unit of `count`.
    pub counting: StepCounting,
    /// Number of steps in that unit.
    pub count: u64,
    /// Highest rate: that of the first step after the warm-up.
    pub first_rate: f64,
    /// Decay of the rate.
    pub shape: RateSchedule,
    /// Number of optimiser steps over which the rate rises linearly to the highest one.
    pub warm_up: u64,
}

impl Schedule {
    /// Returns the number of optimiser steps.
    pub fn steps(&self) -> u64 {
        match self.counting {
            StepCounting::Optimiser => self.count,
            StepCounting::Batches => {
                let round = TRAINING + EVALUATING;
                self.count / round * TRAINING + (self.count % round).min(TRAINING)
            }
        }
    }

    /// Returns the rate of an optimiser step; the first one is step 0.
    ///
    /// Step s of W warm-up steps has (s + 1) / (W + 1) of the scheduled rate.
    pub fn learning_rate(&self, step: u64) -> f64 {
        let warm = (step + 1) as f64 / (self.warm_up + 1) as f64;
        warm.min(1.0)
            * match self.shape {
                RateSchedule::Drops => self.dropped_rate(step),
                RateSchedule::Cosine => self.cosine_rate(step),
            }
    }

    fn cosine_rate(&self, step: u64) -> f64 {
        let falling = self.steps().saturating_sub(self.warm_up).max(1);
        let made = step.saturating_sub(self.warm_up) as f64 / falling as f64;
        self.first_rate * 0.5 * (1.0 + (PI * made.min(1.0)).cos())
    }

    fn dropped_rate(&self, step: u64) -> f64 {
        let counted = match self.counting {
            StepCounting::Optimiser => step,
            StepCounting::Batches => step / TRAINING * (TRAINING + EVALUATING) + step % TRAINING,
        };
        let passed = |drop: &&u64| **drop * self.count <= counted * DROPS_OF;
        self.first_rate / 10_f64.powi(DROPS.iter().filter(passed).count() as i32)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn drops(schedule: Schedule) -> Vec<u64> {
        let changes =
            |&step: &u64| schedule.learning_rate(step) != schedule.learning_rate(step - 1);
        (1..schedule.steps()).filter(changes).collect()
    }

    #[test]
    fn rates_drop_where_the_paper_says() {
        let paper = Schedule {
            counting: StepCounting::Optimiser,
            count: 200_000,
            first_rate: 1e-3,
            shape: RateSchedule::Drops,
            warm_up: 0,
        };
        assert_eq!(paper.steps(), 200_000);
        assert_eq!(drops(paper), [190_000, 195_000, 199_000, 199_500]);
        assert_eq!(paper.learning_rate(0), 1e-3);
        assert!((paper.learning_rate(199_999) - 1e-7).abs() < 1e-20);
        let short = Schedule {
            count: 400,
            ..paper
        };
        assert_eq!(drops(short), [380, 390, 398, 399]);
    }

    #[test]
    fn the_authors_code_counts_test_batches() {
        let code = Schedule {
            counting: StepCounting::Batches,
            count: 200_000,
            first_rate: 1e-3,
            shape: RateSchedule::Drops,
            warm_up: 0,
        };
        assert_eq!(code.steps(), 176_000);
        // 190 000 = 380 rounds of 500 batches.
        assert_eq!(drops(code), [380 * 440, 390 * 440, 398 * 440, 399 * 440]);
        let within_a_round = Schedule { count: 470, ..code };
        assert_eq!(within_a_round.steps(), 440);
    }

    #[test]
    fn a_cosine_rises_in_the_warm_up_and_falls_to_0() {
        let schedule = Schedule {
            counting: StepCounting::Optimiser,
            count: 1000,
            first_rate: 1e-3,
            shape: RateSchedule::Cosine,
            warm_up: 99,
        };
        let share = |step| schedule.learning_rate(step) / 1e-3;
        for (step, expected) in [(0, 0.01), (49, 0.5), (98, 0.99), (99, 1.0)] {
            assert!((share(step) - expected).abs() < 1e-12, "{step}");
        }
        // Halfway down at half of the 901 steps after the warm-up; a third of the way in angle is cos 60° above the middle.
        assert!((share(99 + 450) - 0.5).abs() < 2e-3);
        assert!((share(99 + 300) - 0.75).abs() < 2e-3);
        assert!(share(999) > 0.0 && share(999) < 1e-5);
        assert!((1..901).all(|n| share(99 + n) < share(98 + n)));
    }
}
