//! The training runs of an experiment.

use std::fmt;

use ppa_dataset::layout::View;

use super::configuration::{Configuration, Experiment, Shapes, Start, Variation, ViewChoice};

/// One training run, and the test of its network if it has one.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum Training {
    /// Training with all of the synthetic dataset; several runs start from its weights.
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

impl Training {
    /// Returns the run of experiment 1 whose network this run tests, if it trains none itself.
    pub fn tests_network_of(self) -> Option<Self> {
        let Self::Run {
            configuration,
            fold,
            view,
            seed,
        } = self
        else {
            return None;
        };
        let tests = match configuration.experiment {
            Experiment::Shapes => true,
            Experiment::Ablations => configuration.variation != Variation::Unmirrored,
            _ => false,
        };
        tests.then_some(Self::Run {
            configuration: Configuration {
                experiment: Experiment::One,
                variation: Variation::None,
                ..configuration
            },
            fold,
            view,
            seed,
        })
    }

    /// Returns the training run that must come first: that of the network that this run tests, or of its initial weights.
    pub fn needs(self) -> Option<Self> {
        self.tests_network_of().or_else(|| self.pretraining())
    }

    /// Returns the pretraining run whose weights this run starts from.
    pub fn pretraining(self) -> Option<Self> {
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

/// Writes the name of the run's folder, unique among all training runs of all experiments.
impl fmt::Display for Training {
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

/// Returns the runs of the columns, ordered by repetition, so that columns that a test pairs by seed are completed together.
pub fn runs(columns: &[Configuration], folds: usize, seeds: &[u64]) -> Vec<Training> {
    let mut runs = Vec::new();
    for &seed in seeds {
        for &configuration in columns {
            for fold in 0..folds {
                runs.extend(configuration.views().iter().map(|&view| Training::Run {
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

    use super::super::configuration::{Experiment, Variation};
    use super::*;

    #[test]
    fn all_experiments_need_the_papers_networks() {
        let seeds: Vec<_> = (0..10).collect();
        let all: Vec<_> = [3, 2, 3, 2]
            .into_iter()
            .zip(Experiment::OF_PAPER)
            .flat_map(|(folds, experiment)| runs(&experiment.configurations(), folds, &seeds))
            .collect();
        // 980, plus the 60 with ImageNet in experiment 2b that the paper does not count.
        assert_eq!(all.len(), 1040);
        let pretrainings: BTreeSet<_> = all.iter().filter_map(|run| run.needs()).collect();
        assert_eq!(pretrainings.len(), 1100 - 980);
        let names: BTreeSet<_> = all
            .iter()
            .chain(&pretrainings)
            .map(Training::to_string)
            .collect();
        assert_eq!(names.len(), all.len() + pretrainings.len());
    }

    #[test]
    fn variations_test_networks_of_experiment_1() {
        let columns = [Experiment::Shapes, Experiment::Ablations];
        let columns = columns.map(|experiment| runs(&experiment.configurations(), 1, &[1]));
        let tested: BTreeSet<_> = columns.iter().flatten().filter_map(|u| u.needs()).collect();
        let of_one = runs(&Experiment::One.configurations(), 1, &[1]);
        assert_eq!(tested, of_one.into_iter().collect());
        let trained = columns[1]
            .iter()
            .filter(|training| training.needs().is_none());
        let trained: Vec<_> = trained.map(Training::to_string).collect();
        assert_eq!(
            trained,
            ["cam_left", "cam_right"].map(|view| format!(
                "experiment_ablations/sides-not-mirrored/fold_0/{view}/seed_1"
            ))
        );
    }

    #[test]
    fn unified_weights_serve_both_views() {
        let run = |view, views| Training::Run {
            configuration: Configuration {
                experiment: Experiment::TwoA,
                start: Start::Synthetic {
                    views,
                    shapes: Shapes::All,
                },
                shapes: Shapes::Original,
                variation: Variation::None,
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
