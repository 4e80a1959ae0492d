//! Number of steps, and learning rate of each.

use std::fmt;

use serde::{Deserialize, Serialize};

/// Of [`DROPS_OF`]: where the rate is divided by ten, 190 000, 195 000, 199 000 and 199 500 of the paper's 200 000 steps.
const DROPS: [u64; 4] = [380, 390, 398, 399];
const DROPS_OF: u64 = 400;
/// Batches that the authors' code trains on before it looks at [`EVALUATING`] test batches.
const TRAINING: u64 = 440;
/// Test batches between two rounds of training batches.
const EVALUATING: u64 = 60;

/// What `steps` counts.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum StepCounting {
    /// Steps of the optimiser, as the paper's text says.
    Optimiser,
    /// Batches of training and test together, 440 and 60 in turn, as the authors' code counts: 176 000 steps of the
    /// optimiser for 200 000. Only training batches are computed here; evaluation has its own interval.
    Batches,
}

impl fmt::Display for StepCounting {
    /// As in configurations.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Optimiser => "optimiser",
            Self::Batches => "batches",
        })
    }
}

/// Learning rates by step of the optimiser.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Schedule {
    /// What is counted.
    pub counting: StepCounting,
    /// How many of it there are.
    pub count: u64,
    /// Rate of the first step.
    pub first_rate: f64,
}

impl Schedule {
    /// Steps of the optimiser.
    pub fn steps(&self) -> u64 {
        match self.counting {
            StepCounting::Optimiser => self.count,
            StepCounting::Batches => {
                let round = TRAINING + EVALUATING;
                self.count / round * TRAINING + (self.count % round).min(TRAINING)
            }
        }
    }

    /// Rate of a step of the optimiser; the first one is step 0.
    ///
    /// After 95, 97.5, 99.5 and 99.75 % of the count it is divided by ten.
    pub fn learning_rate(&self, step: u64) -> f64 {
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
        };
        assert_eq!(code.steps(), 176_000);
        // 190 000 = 380 rounds of 500 batches.
        assert_eq!(drops(code), [380 * 440, 390 * 440, 398 * 440, 399 * 440]);
        let within_a_round = Schedule { count: 470, ..code };
        assert_eq!(within_a_round.steps(), 440);
    }
}
