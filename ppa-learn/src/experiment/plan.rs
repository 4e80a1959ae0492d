//! The plan of experiments, a TOML file.

use std::collections::{BTreeMap, BTreeSet};
use std::num::NonZeroUsize;
use std::path::{Path, PathBuf};

use ppa_dataset::labels::LabelName;
use ppa_dataset::published::Published;
use ppa_dataset::write_whole;
use ppa_metrics::MAX_PAIRS;
use serde::{Deserialize, Serialize};

use super::configuration::{Configuration, Experiment, Start, Variation};
use super::error::ExperimentError;
use super::folds::{cross_validation, folds_of_limbs};
use crate::train::{ConfigError, Source, TrainConfig, merge};

/// Datasets and settings of the experiments.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ExperimentPlan {
    /// Number of repetitions with different seeds, at most [`MAX_PAIRS`] because the permutation test enumerates all signs of their
    /// differences; the paper has 10.
    pub seeds: u64,
    /// Seed of the division into folds, the same for all repetitions.
    #[serde(default = "first_seed")]
    pub fold_seed: u64,
    /// Weights trained on ImageNet, with torchvision's or timm's names. Columns that start from them are left out if this is not given.
    #[serde(default)]
    pub imagenet_weights: Option<PathBuf>,
    /// Training configuration: a preset and the keys that differ from it. Seed, views and data are filled in.
    pub training: toml::Table,
    /// Keys that differ from [`training`](Self::training) in the runs of experiments 2a to 2c, including those from scratch.
    #[serde(default)]
    pub finetuning: toml::Table,
    /// The synthetic dataset, for experiment 1 and for pretraining.
    pub synthetic: Synthetic,
    /// The preparations, or a substitute, for experiments 2a and 2c.
    #[serde(default)]
    pub preparations: Option<Target>,
    /// The clinical dataset, or a substitute, for experiment 2b.
    #[serde(default)]
    pub clinical: Option<Target>,
    /// Parts of the synthetic dataset used for training in the experiments on the amount of data.
    #[serde(default)]
    pub learning_curves: LearningCurves,
    /// Path of the plan.
    #[serde(skip)]
    path: PathBuf,
}

/// The synthetic dataset.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Synthetic {
    /// Folder of the dataset, relative to that of the plan.
    pub dataset: PathBuf,
    /// NAME of the label file `labels.NAME.json`; `labels.json` if left out.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub labels: Option<LabelName>,
    /// Number of folds of experiment 1; 3 in the paper.
    pub folds: usize,
    /// Number of limbs tested in a fold; 3 in the paper.
    pub test_limbs: usize,
}

/// A dataset for finetuning and testing.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Target {
    /// Folder of the dataset, relative to that of the plan.
    pub dataset: PathBuf,
    /// NAME of the label file `labels.NAME.json`; `labels.json` if left out.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub labels: Option<LabelName>,
    /// Number of folds, divided by person; in the paper 2 for the preparations and 3 for the clinical dataset.
    pub folds: usize,
}

/// Columns of the experiments on the amount of data.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct LearningCurves {
    /// Numbers of persons to train with.
    #[serde(default)]
    pub persons: Vec<u32>,
    /// Train with every n-th angle of each limb.
    #[serde(default)]
    pub every_pose: Vec<NonZeroUsize>,
    /// Number of repetitions; that of the other experiments if left out.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub seeds: Option<u64>,
}

/// Persons of a fold.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Fold {
    /// N of `patient_N` to train with.
    pub training: Vec<u32>,
    /// N of `patient_N` to test.
    pub test: Vec<u32>,
}

impl Synthetic {
    /// Returns all persons of the dataset.
    pub(super) fn source(&self) -> Source {
        everybody(&self.dataset, &self.labels)
    }
}

/// Returns all persons of a dataset.
fn everybody(dataset: &Path, labels: &Option<LabelName>) -> Source {
    Source {
        dataset: dataset.to_owned(),
        patients: None,
        shapes: None,
        every_pose: None,
        labels: labels.clone(),
    }
}

fn first_seed() -> u64 {
    1
}

impl ExperimentPlan {
    /// Returns whether a file is a plan of experiments, valid or not, rather than another plan of ppa: only these have a table `training`.
    pub fn is_in(path: &Path) -> bool {
        let text = ppa_core::regular_file::read_to_string(path).unwrap_or_default();
        let table: toml::Table = toml::from_str(&text).unwrap_or_default();
        // In the configuration of a training run it is an array of tables.
        table.get("training").is_some_and(toml::Value::is_table)
    }

    /// Reads a TOML file; folders in it are relative to the folder of the file.
    ///
    /// # Errors
    /// [`ExperimentError`] naming the file and the key.
    pub fn read(path: &Path) -> Result<Self, ExperimentError> {
        let wrong = |message: String| ExperimentError::Plan {
            path: path.to_owned(),
            message,
        };
        let text =
            ppa_core::regular_file::read_to_string(path).map_err(|e| wrong(e.to_string()))?;
        let mut plan: Self =
            toml::from_str(&text).map_err(|e| wrong(e.to_string().trim_end().to_owned()))?;
        for (key, seeds) in [
            ("seeds", Some(plan.seeds)),
            ("learning_curves.seeds", plan.learning_curves.seeds),
        ] {
            if let Some(seeds) = seeds.filter(|seeds| !(1..=MAX_PAIRS as u64).contains(seeds)) {
                return Err(wrong(format!(
                    "{key} is {seeds}, expected 1 to {MAX_PAIRS}, the maximum for the exact permutation test"
                )));
            }
        }
        let whole = std::path::absolute(path).map_err(|e| wrong(e.to_string()))?;
        let folder = whole.parent().unwrap_or(Path::new(""));
        let targets = [&mut plan.preparations, &mut plan.clinical];
        let targets = targets.into_iter().flatten().map(|t| &mut t.dataset);
        let paths = targets.chain([&mut plan.synthetic.dataset]);
        for path in paths.chain(&mut plan.imagenet_weights) {
            *path = folder.join(&*path);
        }
        plan.path = path.to_owned();
        plan.training_config()?;
        plan.finetuning_config()?;
        Ok(plan)
    }

    /// Writes the plan as TOML, with absolute paths.
    ///
    /// # Errors
    /// [`ExperimentError`] naming the file.
    pub fn write(&self, path: &Path) -> Result<(), ExperimentError> {
        let text = toml::to_string(self).map_err(|e| ExperimentError::Plan {
            path: path.to_owned(),
            message: e.to_string(),
        })?;
        Ok(write_whole(path, text.as_bytes())?)
    }

    /// Returns the training configuration, without data.
    pub(super) fn training_config(&self) -> Result<TrainConfig, ConfigError> {
        TrainConfig::from_table(self.training.clone(), &self.path)
    }

    /// Returns the training configuration for preparations or clinical images, without data.
    pub(super) fn finetuning_config(&self) -> Result<TrainConfig, ConfigError> {
        let mut table = self.training.clone();
        merge(&mut table, self.finetuning.clone());
        TrainConfig::from_table(table, &self.path)
    }

    /// Returns the seeds of an experiment's repetitions.
    pub(super) fn seeds_of(&self, experiment: Experiment) -> Vec<u64> {
        let of_curves = self.learning_curves.seeds;
        let number = match experiment {
            Experiment::Persons | Experiment::Poses => of_curves.unwrap_or(self.seeds),
            _ => self.seeds,
        };
        (1..=number).collect()
    }

    /// Returns the columns of an experiment that can be run: those with ImageNet only if the plan names a file of its weights.
    pub fn configurations(&self, experiment: Experiment) -> Vec<Configuration> {
        let LearningCurves {
            persons,
            every_pose,
            ..
        } = &self.learning_curves;
        let mut columns = match experiment {
            Experiment::Persons => {
                let amounts = persons.iter().map(|&n| Variation::Persons(n));
                amounts.map(|n| experiment.with_variation(n)).collect()
            }
            Experiment::Poses => {
                let amounts = every_pose.iter().map(|&n| Variation::EveryPose(n));
                amounts.map(|n| experiment.with_variation(n)).collect()
            }
            _ => experiment.configurations(),
        };
        columns.retain(|c| c.start != Start::ImageNet || self.imagenet_weights.is_some());
        columns
    }

    /// Returns the experiments for which the plan has data: the paper's, then the others.
    pub fn experiments(&self) -> Vec<Experiment> {
        let all = Experiment::OF_PAPER.into_iter().chain(Experiment::OTHERS);
        all.filter(|&experiment| self.target(experiment).is_ok())
            .collect()
    }

    /// Returns all persons of the dataset that an experiment uses for testing.
    ///
    /// # Errors
    /// [`ExperimentError::NoTarget`] if the plan names none.
    pub fn target(&self, experiment: Experiment) -> Result<Source, ExperimentError> {
        let (target, key) = match experiment {
            Experiment::One | Experiment::Shapes | Experiment::Ablations => {
                return Ok(self.synthetic.source());
            }
            Experiment::Persons | Experiment::Poses => {
                return match self.configurations(experiment).is_empty() {
                    false => Ok(self.synthetic.source()),
                    true => Err(ExperimentError::NoTarget {
                        experiment,
                        key: "learning_curves",
                    }),
                };
            }
            Experiment::TwoA | Experiment::TwoC => (&self.preparations, "preparations"),
            Experiment::TwoB => (&self.clinical, "clinical"),
        };
        match target {
            Some(target) => Ok(everybody(&target.dataset, &target.labels)),
            None => Err(ExperimentError::NoTarget { experiment, key }),
        }
    }

    /// Returns the persons of each fold of an experiment.
    ///
    /// # Errors
    /// [`ExperimentError`] if the dataset cannot be read, or has too few persons.
    pub fn folds(&self, experiment: Experiment) -> Result<Vec<Fold>, ExperimentError> {
        let dataset = Published::read(&self.target(experiment)?.dataset)?;
        let limbs: BTreeSet<_> = dataset.pairs.iter().map(|pair| pair.limb).collect();
        let mut limbs_of = BTreeMap::new();
        for limb in limbs {
            *limbs_of.entry(limb.patient).or_insert(0) += 1;
        }
        let persons: BTreeSet<u32> = limbs_of.keys().copied().collect();
        let by_person = |target: &Option<Target>| {
            let folds = target.as_ref().map_or(0, |target| target.folds);
            cross_validation(&persons, folds, self.fold_seed)
        };
        let tests = match experiment {
            Experiment::One
            | Experiment::Persons
            | Experiment::Poses
            | Experiment::Shapes
            | Experiment::Ablations => {
                let Synthetic {
                    folds, test_limbs, ..
                } = self.synthetic;
                folds_of_limbs(&limbs_of, test_limbs, folds, self.fold_seed)
            }
            Experiment::TwoA | Experiment::TwoC => by_person(&self.preparations),
            Experiment::TwoB => by_person(&self.clinical),
        }?;
        let fold = |test: BTreeSet<u32>| Fold {
            training: persons.difference(&test).copied().collect(),
            test: test.into_iter().collect(),
        };
        let folds: Vec<Fold> = tests.into_iter().map(fold).collect();
        let fewest = folds.iter().map(|fold| fold.training.len()).min();
        let wanted = self.learning_curves.persons.iter().max();
        match (fewest, wanted) {
            (Some(fewest), Some(&wanted))
                if experiment == Experiment::Persons && wanted as usize > fewest =>
            {
                Err(ExperimentError::Plan {
                    path: self.path.clone(),
                    message: format!(
                        "learning_curves.persons asks for {wanted}, but one fold has only {fewest} persons to train with"
                    ),
                })
            }
            _ => Ok(folds),
        }
    }
}
