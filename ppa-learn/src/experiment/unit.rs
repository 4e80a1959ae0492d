//! The trainings that an experiment consists of.

use std::fmt;

use ppa_dataset::layout::View;

use super::configuration::{Configuration, Shapes, Start, ViewChoice};

/// One training, and the test of its network where it has one.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum Unit {
    /// Training with all of the synthetic dataset; several runs begin with its weights.
    Pretraining {
        /// Shapes to train with.
        shapes: Shapes,
        /// The view to train with; both if `None`.
        view: Option<View>,
        /// The repetition.
        seed: u64,
    },
    /// Training and test of one network of a table's column.
    Run {
        /// The column.
        configuration: Configuration,
        /// The fold, from 0.
        fold: usize,
        /// The view that the network is for.
        view: View,
        /// The repetition.
        seed: u64,
    },
}

impl Unit {
    /// The pretraining whose weights this one begins with.
    pub fn needs(self) -> Option<Self> {
        let Self::Run {
            configuration,
            view,
            seed,
            ..
        } = self
        else {
            return None;
        };
        let Start::Synthetic { views, shapes } = configuration.start else {
            return None;
        };
        let view = (views == ViewChoice::Specific).then_some(view);
        Some(Self::Pretraining { shapes, view, seed })
    }
}

/// A folder's name: unique among all units of all experiments.
impl fmt::Display for Unit {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Pretraining { shapes, view, seed } => {
                let view = view.map_or("both", View::name);
                write!(f, "pretraining/{}/{view}/seed_{seed}", shapes.name())
            }
            Self::Run {
                configuration,
                fold,
                view,
                seed,
            } => write!(
                f,
                "experiment_{}/{}/fold_{fold}/{}/seed_{seed}",
                configuration.experiment.name(),
                configuration.name(),
                view.name()
            ),
        }
    }
}

/// The runs of some columns, repetition by repetition: columns that a test pairs by seed grow together.
pub fn runs(columns: &[Configuration], folds: usize, seeds: &[u64]) -> Vec<Unit> {
    let mut runs = Vec::new();
    for &seed in seeds {
        for &configuration in columns {
            for fold in 0..folds {
                runs.extend(View::ALL.map(|view| Unit::Run {
                    configuration,
                    fold,
                    view,
                    seed,
                }));
            }
        }
    }
    runs
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeSet;

    use super::super::configuration::{Amount, Experiment};
    use super::*;

    #[test]
    fn all_experiments_need_the_papers_networks() {
        let seeds: Vec<_> = (0..10).collect();
        let all: Vec<_> = [3, 2, 3, 2]
            .into_iter()
            .zip(Experiment::OF_PAPER)
            .flat_map(|(folds, experiment)| runs(&experiment.configurations(), folds, &seeds))
            .collect();
        // 980 and the 60 of ImageNet in experiment 2b, which the paper's count leaves out.
        assert_eq!(all.len(), 1040);
        let pretrainings: BTreeSet<_> = all.iter().filter_map(|run| run.needs()).collect();
        assert_eq!(pretrainings.len(), 1100 - 980);
        let names: BTreeSet<_> = all
            .iter()
            .chain(&pretrainings)
            .map(Unit::to_string)
            .collect();
        assert_eq!(names.len(), all.len() + pretrainings.len());
    }

    #[test]
    fn unified_weights_serve_both_views() {
        let run = |view, views| Unit::Run {
            configuration: Configuration {
                experiment: Experiment::TwoA,
                start: Start::Synthetic {
                    views,
                    shapes: Shapes::All,
                },
                shapes: Shapes::Original,
                amount: Amount::All,
            },
            fold: 1,
            view,
            seed: 3,
        };
        let needs = |views| View::ALL.map(|view| run(view, views).needs().unwrap());
        let [left, right] = needs(ViewChoice::Unified);
        assert_eq!(left, right);
        let [left, right] = needs(ViewChoice::Specific);
        assert_ne!(left, right);
    }
}
