//! What a training does, as a file says.

use std::num::NonZeroUsize;
use std::path::{Path, PathBuf};

use ppa_dataset::BodyShape;
use serde::{Deserialize, Serialize};

use crate::DeviceName;
use crate::data::{Augmentation, FRAMES_PER_POSE, Views};
use crate::network::{Fusion, Options};
use crate::weights::FirstConvolution;

use super::schedule::{Schedule, StepCounting};

/// A training, with nothing left open.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct TrainConfig {
    /// Names all random numbers.
    pub seed: u64,
    /// Which cameras' images the network gets.
    pub views: Views,
    /// Columns and rows that the network sees.
    pub side: usize,
    /// Samples of a step.
    pub batch_size: NonZeroUsize,
    /// Number of steps, as `step_counting` counts them.
    pub steps: u64,
    /// What `steps` counts.
    pub step_counting: StepCounting,
    /// Rate of the first step; it falls by four factors of ten in the last 5 % of the steps.
    pub learning_rate: f64,
    /// Frames that are used of a recorded pose.
    pub frames_per_pose: usize,
    /// Threads that load images.
    pub workers: NonZeroUsize,
    /// Where the network computes.
    #[serde(default)]
    pub device: DeviceName,
    /// Prepared images that may stay in memory, in MB (10⁶ bytes).
    pub keep_mb: usize,
    /// Steps between two rows of the log.
    pub log_every: NonZeroUsize,
    /// Steps between two checkpoints.
    pub checkpoint_every: NonZeroUsize,
    /// Weights to begin with, from the folder of the configuration: safetensors or `.pth`, by torchvision's or timm's names. Random
    /// ones if left out.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub start: Option<PathBuf>,
    /// What becomes of a first convolution of several channels in `start`.
    pub first_convolution: FirstConvolution,
    /// Layers that are trained.
    pub layers: Layers,
    /// What training leaves out at random.
    pub network: NetworkConfig,
    /// How `views = "pairs"` joins the images of both cameras.
    pub fusion: Fusion,
    /// How training images are changed.
    pub augmentation: Augmentation,
    /// Persons to train on.
    pub training: Vec<Source>,
    /// Persons to evaluate on; none of them in training.
    #[serde(default)]
    pub evaluation: Vec<Source>,
}

/// Which layers are trained.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Layers {
    /// All.
    All,
    /// The last one, on features of images that are not augmented: linear probing.
    Last,
}

/// What training leaves out at random, and where it begins.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct NetworkConfig {
    /// Probability that a feature is left out before the last layer.
    pub dropout: f32,
    /// Probability that the last block leaves out its residual branch.
    pub stochastic_depth: f32,
    /// First values of the last layer, unless `start` holds one for a single output.
    pub last_layer: LastLayer,
}

/// First values of the last layer.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum LastLayer {
    /// As torchvision draws them, which the paper's authors use: weights uniform in ±1 / sqrt(outputs) = ±1, bias 0. Answers begin
    /// with errors of about 10, and a thousand steps of 10⁻³ pass until they are of the size of labels.
    Torchvision,
    /// Weights 0 and bias 2: answers begin in the middle of the labels, 1 to 3.
    Middle,
}

/// Persons of a dataset.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Source {
    /// Folder of the dataset, from the folder of the configuration.
    pub dataset: PathBuf,
    /// Numbers of the persons; all of them if left out.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub patients: Option<Vec<u32>>,
    /// Body shapes, of poses that were rotated; all of them if left out. Recorded poses have none.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub shapes: Option<Vec<BodyShape>>,
}

/// A configuration that cannot be.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum ConfigError {
    /// The file cannot be read.
    #[error("cannot read {}", path.display())]
    Read {
        /// The file.
        path: PathBuf,
        /// What the system said.
        source: std::io::Error,
    },
    /// It is no TOML, or lacks or has too many keys.
    #[error("{}: {message}", path.display())]
    Parse {
        /// The file.
        path: PathBuf,
        /// What and where.
        message: String,
    },
    /// No such preset.
    #[error("{}: there is no preset {found:?}; expected \"paper\" or \"quick\"", path.display())]
    Preset {
        /// The file.
        path: PathBuf,
        /// What stands there.
        found: String,
    },
    /// It cannot be written as TOML, as with a path that is not UTF-8.
    #[error("the configuration cannot be written as TOML: {0}")]
    Write(String),
    /// A number out of range.
    #[error("{key} is {found}, expected {expected}")]
    Range {
        /// The key.
        key: &'static str,
        /// Its value.
        found: String,
        /// What it could be.
        expected: &'static str,
    },
}

impl TrainConfig {
    /// The paper's training, without data.
    pub fn paper() -> Self {
        let number = |n| NonZeroUsize::new(n).expect("the numbers below are not 0");
        let options = Options::default();
        Self {
            seed: 1,
            views: Views::Left,
            side: 336,
            batch_size: number(16),
            steps: 200_000,
            step_counting: StepCounting::Optimiser,
            learning_rate: 1e-3,
            frames_per_pose: FRAMES_PER_POSE,
            workers: number(2),
            device: DeviceName::Cpu,
            keep_mb: 2000,
            log_every: number(50),
            checkpoint_every: number(1000),
            start: None,
            first_convolution: FirstConvolution::default(),
            layers: Layers::All,
            network: NetworkConfig {
                dropout: options.dropout,
                stochastic_depth: options.stochastic_depth,
                last_layer: LastLayer::Torchvision,
            },
            fusion: Fusion::default(),
            augmentation: Augmentation::default(),
            training: Vec::new(),
            evaluation: Vec::new(),
        }
    }

    /// The paper's training with images of 48 x 48 pixels and 400 steps, for minutes on two cores.
    ///
    /// Besides, it leaves out what 400 steps are too few for, in PyTorch as well:
    ///
    /// * The last layer begins in the middle of the labels. From torchvision's first values a thousand steps would only get there.
    /// * Nothing is left out at random, and images are neither mirrored nor rotated.
    /// * Images are not blurred: a box of 3 to 7 of 48 pixels would be one of 21 to 49 of the paper's 336. As the paper's boxes average
    ///   its noise over 9 to 49 pixels, noise that is not blurred has a 25th of the variance.
    pub fn quick() -> Self {
        let paper = Self::paper();
        Self {
            side: 48,
            steps: 400,
            log_every: NonZeroUsize::MIN.saturating_add(9),
            checkpoint_every: NonZeroUsize::MIN.saturating_add(99),
            network: NetworkConfig {
                dropout: 0.0,
                stochastic_depth: 0.0,
                last_layer: LastLayer::Middle,
            },
            augmentation: Augmentation {
                flip_probability: 0.0,
                rotate_probability: 0.0,
                noise_max_variance: 4e-5,
                blur_probability: 0.0,
                ..paper.augmentation
            },
            ..paper
        }
    }

    /// Reads a TOML file: `preset = "paper"` or `"quick"`, and every key that shall differ from it.
    ///
    /// # Errors
    /// [`ConfigError`] naming file and key.
    pub fn read(path: &Path) -> Result<Self, ConfigError> {
        let unreadable = |source| ConfigError::Read {
            path: path.to_owned(),
            source,
        };
        let text = std::fs::read_to_string(path).map_err(unreadable)?;
        let given = toml::from_str(&text).map_err(|error| wrong(path, &error))?;
        let mut config = Self::from_table(given, path)?;
        // Whole paths, so that the echo in another folder says the same.
        let whole = std::path::absolute(path).map_err(unreadable)?;
        let folder = whole.parent().unwrap_or(Path::new(""));
        for source in config.training.iter_mut().chain(&mut config.evaluation) {
            source.dataset = folder.join(&source.dataset);
        }
        config.start = config.start.map(|start| folder.join(start));
        config.check()?;
        Ok(config)
    }

    /// The configuration that a table of the file `path` says: its preset and every key that differs.
    ///
    /// # Errors
    /// [`ConfigError`] naming file and key.
    pub(crate) fn from_table(mut given: toml::Table, path: &Path) -> Result<Self, ConfigError> {
        let preset = match given.remove("preset") {
            None => Self::paper(),
            Some(toml::Value::String(name)) if name == "paper" => Self::paper(),
            Some(toml::Value::String(name)) if name == "quick" => Self::quick(),
            Some(other) => {
                return Err(ConfigError::Preset {
                    path: path.to_owned(),
                    found: other.as_str().map_or(other.to_string(), str::to_owned),
                });
            }
        };
        let mut all = toml::Table::try_from(&preset).map_err(|e| wrong(path, &e))?;
        merge(&mut all, given);
        all.try_into().map_err(|e: toml::de::Error| wrong(path, &e))
    }

    /// The rates of all steps.
    pub fn schedule(&self) -> Schedule {
        Schedule {
            counting: self.step_counting,
            count: self.steps,
            first_rate: self.learning_rate,
        }
    }

    /// Refuses numbers that no training can have.
    ///
    /// # Errors
    /// [`ConfigError::Range`] naming the key.
    pub fn check(&self) -> Result<(), ConfigError> {
        let require = |fine: bool, key, found: String, expected| {
            let wrong = ConfigError::Range {
                key,
                found,
                expected,
            };
            if fine { Ok(()) } else { Err(wrong) }
        };
        let side = self.side;
        require(
            (32..=4096).contains(&side),
            "side",
            side.to_string(),
            "32 to 4096",
        )?;
        require(
            (1..=1_000_000_000).contains(&self.steps),
            "steps",
            self.steps.to_string(),
            "1 to 1000000000",
        )?;
        let workers = self.workers.get();
        require(workers <= 1024, "workers", workers.to_string(), "1 to 1024")?;
        let frames = self.frames_per_pose;
        require(
            frames > 0,
            "frames_per_pose",
            frames.to_string(),
            "at least 1",
        )?;
        let rate = self.learning_rate;
        let fine = rate.is_finite() && rate > 0.0;
        require(fine, "learning_rate", rate.to_string(), "more than 0")?;
        let augmentation = &self.augmentation;
        for (key, share) in [
            (
                "augmentation.flip_probability",
                augmentation.flip_probability,
            ),
            (
                "augmentation.rotate_probability",
                augmentation.rotate_probability,
            ),
            (
                "augmentation.noise_probability",
                augmentation.noise_probability,
            ),
            (
                "augmentation.blur_probability",
                augmentation.blur_probability,
            ),
            (
                "augmentation.invalid_probability",
                augmentation.invalid_probability,
            ),
            (
                "augmentation.noise_max_variance",
                augmentation.noise_max_variance,
            ),
        ] {
            require(
                (0.0..=1.0).contains(&share),
                key,
                share.to_string(),
                "0 to 1",
            )?;
        }
        for (key, share) in [
            ("network.dropout", self.network.dropout),
            ("network.stochastic_depth", self.network.stochastic_depth),
            ("fusion.branch_dropout", self.fusion.branch_dropout),
            ("fusion.late_dropout", self.fusion.late_dropout),
        ] {
            require(
                (0.0..1.0).contains(&share),
                key,
                share.to_string(),
                "0 to less than 1",
            )?;
        }
        let limit = augmentation.rotate_limit_deg;
        let fine = (0.0..=180.0).contains(&limit);
        require(
            fine,
            "augmentation.rotate_limit_deg",
            limit.to_string(),
            "0 to 180",
        )?;
        require(
            !self.training.is_empty(),
            "training",
            "empty".into(),
            "at least one dataset",
        )
    }

    /// What must be equal for a training to go on; threads, device, memory and intervals may change.
    pub(crate) fn of_results(&self) -> Self {
        let paper = Self::paper();
        Self {
            workers: paper.workers,
            device: paper.device,
            keep_mb: paper.keep_mb,
            log_every: paper.log_every,
            checkpoint_every: paper.checkpoint_every,
            ..self.clone()
        }
    }
}

fn wrong(path: &Path, error: &dyn std::fmt::Display) -> ConfigError {
    ConfigError::Parse {
        path: path.to_owned(),
        message: error.to_string().trim_end().to_owned(),
    }
}

/// Puts every value that is given over the one that stands there; tables are merged key by key.
fn merge(all: &mut toml::Table, given: toml::Table) {
    for (key, value) in given {
        match (all.get_mut(&key), value) {
            (Some(toml::Value::Table(all)), toml::Value::Table(given)) => merge(all, given),
            (_, value) => {
                all.insert(key, value);
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn read(text: &str) -> Result<TrainConfig, String> {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("train.toml");
        std::fs::write(&path, text).unwrap();
        TrainConfig::read(&path).map_err(|error| error.to_string())
    }

    const DATA: &str = "[[training]]\ndataset = \"data\"\npatients = [1, 2]\n";

    #[test]
    fn a_preset_is_changed_key_by_key_and_written_whole() {
        let text = format!(
            "preset = \"quick\"\nsteps = 70\n[augmentation]\nblur_probability = 0.0\n{DATA}"
        );
        let config = read(&text).unwrap();
        assert_eq!((config.side, config.steps), (48, 70));
        assert_eq!(config.augmentation.blur_probability, 0.0);
        assert_eq!(config.augmentation.rotate_limit_deg, 15.0);
        assert!(config.training[0].dataset.ends_with("data"));
        let echoed = toml::to_string(&config).unwrap();
        assert_eq!(read(&echoed).unwrap(), config);
    }

    #[test]
    fn mistakes_are_named() {
        for (text, expected) in [
            ("preset = \"fast\"", "there is no preset \"fast\""),
            ("stepz = 3", "unknown field `stepz`"),
            ("side = 8", "side is 8, expected 32 to 4096"),
            ("learning_rate = nan", "learning_rate is NaN"),
            ("steps = 0", "steps is 0"),
            ("steps = 46000000000000000", "expected 1 to 1000000000"),
            (
                "workers = 1000000",
                "workers is 1000000, expected 1 to 1024",
            ),
            ("batch_size = 0", "nonzero"),
            (
                "augmentation.flip_probability = 1.5",
                "flip_probability is 1.5, expected 0 to 1",
            ),
            ("", "training is empty"),
            ("seed = -1", "invalid value"),
            ("device = \"gpu\"", "there is no device \"gpu\""),
        ] {
            let data = if text.is_empty() { "" } else { DATA };
            let error = read(&format!("{text}\n{data}")).unwrap_err();
            assert!(error.contains(expected), "{text}: {error}");
        }
    }
}
