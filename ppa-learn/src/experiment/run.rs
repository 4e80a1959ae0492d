//! Executes the training runs of an experiment, each in its own folder, and collects their results.

use std::collections::BTreeSet;
use std::fs::{File, TryLockError, create_dir_all, remove_file};
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread::sleep;
use std::time::Duration;

use ppa_dataset::layout::View;
use ppa_dataset::{BodyShape, sha256_of_file, write_whole};

use rand::seq::SliceRandom;
use serde::{Serialize, Serializer};

use super::configuration::{Experiment, Start, Variation};
use super::error::ExperimentError;
use super::plan::{ExperimentPlan, Fold};
use super::predictions::{Moment, Prediction, join_views, read_predictions};
use super::record::{Record, file, fingerprint, read_json, without_paths};
use super::results::Results;
use super::training::{Training, runs};
use crate::data::{Images, Sample, SampleImage, Views, check_split};
use crate::evaluate::{Row, write_predictions};
use crate::random::{Purpose, stream};
use crate::train::{
    Ended, Layers, Progress, Source, TrainConfig, TrainError, predict, samples, steps_made, train,
    trained,
};

/// Progress reported while an experiment runs.
#[derive(Debug)]
pub enum Event<'a> {
    /// A training run starts or resumes.
    Begins {
        /// The training run.
        training: Training,
        /// Its number among the selected runs, from 1.
        number: usize,
        /// Number of selected runs.
        of: usize,
    },
    /// A step was completed.
    Step(&'a Progress),
}

/// An unfinished training run.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
pub struct Begun {
    /// The training run, serialised as its folder's name.
    #[serde(serialize_with = "as_text")]
    pub training: Training,
    /// Number of steps in its checkpoint.
    pub step: u64,
    /// Total number of steps.
    pub steps: u64,
}

fn as_text<S: Serializer>(training: &Training, serializer: S) -> Result<S::Ok, S::Error> {
    serializer.collect_str(training)
}

/// Runs one experiment of a plan in a folder with a subfolder for each training run.
#[derive(Debug)]
pub struct Runner<'a> {
    plan: &'a ExperimentPlan,
    experiment: Experiment,
    root: &'a Path,
    folds: Vec<Fold>,
}

impl<'a> Runner<'a> {
    /// Prepares an experiment of a plan in the folder `root`.
    ///
    /// # Errors
    /// [`ExperimentError`] if its dataset is not named, cannot be read or has too few persons.
    pub fn new(
        plan: &'a ExperimentPlan,
        experiment: Experiment,
        root: &'a Path,
    ) -> Result<Self, ExperimentError> {
        let folds = plan.folds(experiment)?;
        Ok(Self {
            plan,
            experiment,
            root,
            folds,
        })
    }

    /// Returns the runs of the experiment, including those with ImageNet only if the plan has weights.
    pub fn runs(&self) -> Vec<Training> {
        let seeds = self.plan.seeds_of(self.experiment);
        runs(
            &self.plan.configurations(self.experiment),
            self.folds.len(),
            &seeds,
        )
    }

    /// Executes the runs that `mine` selects by their number from 0, each after the pretraining it needs. Finished runs
    /// are left as they are, unfinished ones resume, and a training run of another process is waited for.
    ///
    /// Returns whether all are finished; `stop` ends the work after a step.
    ///
    /// # Errors
    /// [`ExperimentError`] naming the training run.
    pub fn run(
        &self,
        mine: impl Fn(usize) -> bool,
        stop: &AtomicBool,
        mut report: impl FnMut(Event),
    ) -> Result<bool, ExperimentError> {
        let all = self.runs().into_iter().enumerate();
        let share: Vec<_> = all
            .filter(|&(n, _)| mine(n))
            .map(|(_, training)| training)
            .collect();
        for (n, &run) in share.iter().enumerate() {
            for training in run.needs().into_iter().chain([run]) {
                let begins = Event::Begins {
                    training,
                    number: n + 1,
                    of: share.len(),
                };
                if !self.make(training, stop, begins, &mut report)? {
                    return Ok(false);
                }
            }
        }
        Ok(true)
    }

    /// Executes one training run unless it is finished.
    fn make(
        &self,
        training: Training,
        stop: &AtomicBool,
        begins: Event,
        report: &mut impl FnMut(Event),
    ) -> Result<bool, ExperimentError> {
        let named = |source: TrainError| ExperimentError::Training {
            training: training.to_string(),
            source: Box::new(source),
        };
        let folder = self.folder(training);
        create_dir_all(&folder).map_err(file("create", &folder))?;
        let path = folder.join("lock");
        let lock = File::create(&path).map_err(file("create", &path))?;
        // Not with `lock`, which a signal does not interrupt.
        loop {
            match lock.try_lock() {
                Ok(()) => break,
                Err(TryLockError::Error(error)) => return Err(file("lock", &path)(error).into()),
                Err(TryLockError::WouldBlock) if stop.load(Ordering::Relaxed) => return Ok(false),
                Err(TryLockError::WouldBlock) => sleep(Duration::from_millis(500)),
            }
        }

        let config = self.config(training)?;
        let record = self.record(training, &config).map_err(named)?;
        let path = folder.join("finished.json");
        if path.exists() {
            return match read_json::<Record>(&path)? == record {
                true => Ok(true),
                false => Err(ExperimentError::OtherSettings(folder)),
            };
        }
        report(begins);
        let tested = training.tests_network_of();
        if tested.is_none() {
            let steps = |progress: &Progress| report(Event::Step(progress));
            if train(&config, &folder, stop, steps).map_err(named)? != Ended::Finished {
                return Ok(false);
            }
        }
        if let Training::Run { .. } = training {
            let network = tested.map_or(folder.clone(), |tested| self.folder(tested));
            let rows = test(&network, &config).map_err(named)?;
            write_predictions(&folder.join("predictions.csv"), &rows)?;
        }
        let text = serde_json::to_string_pretty(&record).expect("settings are JSON");
        write_whole(&path, text.as_bytes())?;
        if tested.is_none() {
            let checkpoint = folder.join("checkpoint.safetensors");
            remove_file(&checkpoint).map_err(file("remove", &checkpoint))?;
        }
        Ok(true)
    }

    /// Returns the folder of all training runs.
    pub(super) fn root(&self) -> &Path {
        self.root
    }

    /// Returns the experiment.
    pub(super) fn experiment(&self) -> Experiment {
        self.experiment
    }

    fn folder(&self, training: Training) -> PathBuf {
        self.root.join(training.to_string())
    }

    /// Returns the complete configuration of a training run.
    pub(super) fn config(&self, training: Training) -> Result<TrainConfig, ExperimentError> {
        let all = |shapes: &[BodyShape]| Source {
            shapes: Some(shapes.to_vec()),
            ..self.plan.synthetic.source()
        };
        Ok(match training {
            Training::Pretraining { shapes, view, seed } => TrainConfig {
                seed,
                views: view.map_or(Views::Unified, of_view),
                training: vec![all(shapes.variants())],
                ..self.plan.training_config()?
            },
            Training::Run {
                configuration,
                fold,
                view,
                seed,
            } => {
                let trained = self.training_persons(fold, configuration.variation);
                let fold = &self.folds[fold];
                let experiment = configuration.experiment;
                let target = self.plan.target(experiment)?;
                let base = match experiment {
                    Experiment::TwoA | Experiment::TwoB | Experiment::TwoC => {
                        self.plan.finetuning_config()?
                    }
                    _ => self.plan.training_config()?,
                };
                // Recorded images have no shapes; for synthetic ones the skin of the scan is tested, whatever shapes were used in training.
                let tested: &[BodyShape] = match experiment {
                    Experiment::Shapes => &ALTERED,
                    _ => &[BodyShape::Orig],
                };
                let of = |patients: &[u32], shapes: &[BodyShape]| Source {
                    patients: Some(patients.to_vec()),
                    shapes: Some(shapes.to_vec()),
                    ..target.clone()
                };
                TrainConfig {
                    seed,
                    views: of_view(view),
                    start: self.start(training),
                    mirror: base.mirror && configuration.variation != Variation::Unmirrored,
                    layers: match experiment {
                        Experiment::TwoC => Layers::Last,
                        _ => Layers::All,
                    },
                    training: vec![Source {
                        every_pose: match configuration.variation {
                            Variation::EveryPose(n) => Some(n),
                            _ => None,
                        },
                        ..of(&trained, configuration.shapes.variants())
                    }],
                    evaluation: vec![of(&fold.test, tested)],
                    ..base
                }
            }
        })
    }

    /// Returns the persons to train with. A subset consists of the first persons in a random order of the fold, so that a larger subset
    /// contains every smaller one.
    fn training_persons(&self, fold: usize, variation: Variation) -> Vec<u32> {
        let mut persons = self.folds[fold].training.clone();
        if let Variation::Persons(n) = variation {
            persons.shuffle(&mut stream(
                self.plan.fold_seed,
                Purpose::Folds,
                1 + fold as u64,
            ));
            persons.truncate(n as usize);
            persons.sort_unstable();
        }
        persons
    }

    /// Returns the file of initial weights of a training run.
    fn start(&self, training: Training) -> Option<PathBuf> {
        match training {
            Training::Run { configuration, .. } if configuration.start == Start::ImageNet => {
                self.plan.imagenet_weights.clone()
            }
            _ => Some(self.folder(training.needs()?).join("weights.safetensors")),
        }
    }

    /// Returns the settings and data of a training run, which are compared with those of a finished run.
    ///
    /// Refuses to test persons whose images were used in pretraining.
    fn record(&self, training: Training, config: &TrainConfig) -> Result<Record, TrainError> {
        let trained = samples(config, &config.training)?;
        let tested = samples(config, &config.evaluation)?;
        if let Some(pretraining) = training.pretraining() {
            let config = self.config(pretraining).map_err(|e| match e {
                ExperimentError::Config(e) => TrainError::Config(e),
                _ => unreachable!("a pretraining has no target"),
            })?;
            check_split(&samples(&config, &config.training)?, &tested)?;
        }
        let start_sha256 = config.start.as_deref().map(sha256_of_file).transpose()?;
        Ok(Record {
            config: without_paths(config),
            start_sha256,
            data_sha256: fingerprint(&[trained, tested]),
        })
    }

    /// Returns the predictions of a run; `None` if it is not finished.
    fn predictions(&self, training: Training) -> Result<Option<Vec<Prediction>>, ExperimentError> {
        let folder = self.folder(training);
        let finished = folder.join("finished.json");
        if !finished.exists() {
            return Ok(None);
        }
        let config = self.config(training)?;
        let data = |sources: &[Source]| {
            samples(&config, sources).map_err(|source| ExperimentError::Training {
                training: training.to_string(),
                source: Box::new(source),
            })
        };
        let data_sha256 = fingerprint(&[data(&config.training)?, data(&config.evaluation)?]);
        let record: Record = read_json(&finished)?;
        if record.config != without_paths(&config) || record.data_sha256 != data_sha256 {
            return Err(ExperimentError::OtherSettings(folder));
        }
        let path = folder.join("predictions.csv");
        Ok(Some(read_predictions(&path)?))
    }

    /// Returns the images of both views of a tested moment, left camera first.
    ///
    /// # Errors
    /// [`ExperimentError`] if the data cannot be read.
    pub fn images_of(&self, moment: &Moment) -> Result<Vec<SampleImage>, ExperimentError> {
        let tests = |fold: &Fold| fold.test.contains(&moment.patient);
        let Some(fold) = self.folds.iter().position(tests) else {
            return Ok(Vec::new());
        };
        let mut images = Vec::new();
        for view in View::ALL {
            let training = Training::Run {
                configuration: self.plan.configurations(self.experiment)[0],
                fold,
                view,
                seed: 1,
            };
            let config = self.config(training)?;
            let wrong = |source| ExperimentError::Training {
                training: training.to_string(),
                source: Box::new(source),
            };
            let samples = samples(&config, &config.evaluation).map_err(wrong)?;
            let seen = |sample: &&Sample| {
                let of_limb =
                    sample.limb.patient == moment.patient && sample.limb.side == moment.side;
                of_limb && sample.pose == moment.pose && sample.frame == moment.frame
            };
            images.extend(
                samples
                    .iter()
                    .find(seen)
                    .and_then(|s| s.images.first().cloned()),
            );
        }
        Ok(images)
    }

    /// Returns the unfinished training runs, including pretraining runs.
    ///
    /// # Errors
    /// [`ExperimentError`] naming the checkpoint that cannot be read.
    pub fn begun(&self) -> Result<Vec<Begun>, ExperimentError> {
        let runs = self.runs().into_iter();
        let all: BTreeSet<Training> = runs
            .flat_map(|run| run.needs().into_iter().chain([run]))
            .collect();
        let mut begun = Vec::new();
        for training in all {
            let folder = self.folder(training);
            if folder.join("finished.json").exists() {
                continue;
            }
            let step = steps_made(&folder).map_err(|source| ExperimentError::Training {
                training: training.to_string(),
                source: Box::new(source),
            })?;
            if step > 0 {
                begun.push(Begun {
                    training,
                    step,
                    steps: self.config(training)?.schedule().steps(),
                });
            }
        }
        Ok(begun)
    }

    /// Returns the results so far: those of all test sets for which the column's views are finished.
    ///
    /// # Errors
    /// [`ExperimentError`] naming predictions that cannot be read or joined.
    pub fn results(&self) -> Result<Results, ExperimentError> {
        let seeds = self.plan.seeds_of(self.experiment);
        let columns = self.plan.configurations(self.experiment);
        let mut results = Results::new(self.experiment, columns, self.folds.len(), &seeds);
        for place in results.missing() {
            let views = place.configuration.views().iter().map(|&view| {
                let training = Training::Run {
                    configuration: place.configuration,
                    fold: place.fold,
                    view,
                    seed: place.seed,
                };
                self.predictions(training)
            });
            let wrong = |source| ExperimentError::Predictions {
                place: place.to_string(),
                source,
            };
            let predictions = match &views.collect::<Result<Vec<_>, _>>()?[..] {
                [Some(left), Some(right)] => join_views(left, right).map_err(wrong)?,
                [Some(one)] => one.clone(),
                _ => continue,
            };
            results.insert(place, &predictions).map_err(wrong)?;
        }
        Ok(results)
    }
}

/// Returns the predictions of a finished training run's network for its test set.
fn test(folder: &Path, config: &TrainConfig) -> Result<Vec<Row>, TrainError> {
    let (_, network) = trained(folder)?;
    let network = network.to_device(&config.device.open()?)?;
    let tested = samples(config, &config.evaluation)?;
    let images = Arc::new(Images::new(tested, config.side, 0)?);
    let predictions = predict(&network, &images, config.batch_size, config.workers)?;
    Ok(Row::of(images.samples(), &predictions))
}

/// Body shapes other than the skin of the scan.
const ALTERED: [BodyShape; 4] = [
    BodyShape::Big,
    BodyShape::Small,
    BodyShape::BumpsA,
    BodyShape::BumpsB,
];

fn of_view(view: View) -> Views {
    match view {
        View::Left => Views::Left,
        View::Right => Views::Right,
    }
}
