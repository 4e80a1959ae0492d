//! Configurations from TOML files.

use std::path::Path;

use super::config::TrainConfig;
use super::config_error::ConfigError;

impl TrainConfig {
    /// Reads a TOML file: `preset = "paper"`, `"standard"` or `"quick"`, and every key that differs from it.
    ///
    /// # Errors
    /// [`ConfigError`] naming file and key.
    pub fn read(path: &Path) -> Result<Self, ConfigError> {
        Self::of_keys(read_table(path)?, path)
    }

    /// Makes the configuration from the keys of a file at `path`, which need not exist.
    ///
    /// # Errors
    /// The same as [`read`](Self::read).
    pub fn of_keys(keys: toml::Table, path: &Path) -> Result<Self, ConfigError> {
        let unreadable = |source| ConfigError::Read {
            path: path.to_owned(),
            source,
        };
        let mut config = Self::from_table(keys, path)?;
        // Absolute paths, so that the copy in another folder has the same meaning.
        let whole = std::path::absolute(path).map_err(unreadable)?;
        let folder = whole.parent().unwrap_or(Path::new(""));
        for source in config.training.iter_mut().chain(&mut config.evaluation) {
            source.dataset = folder.join(&source.dataset);
        }
        config.start = config.start.map(|start| folder.join(start));
        config.check()?;
        Ok(config)
    }

    /// Reads the `config.toml` in the folder of a training run, which contains every key known to the program that wrote it.
    ///
    /// # Errors
    /// The same as [`read`](Self::read).
    pub fn read_run(folder: &Path) -> Result<Self, ConfigError> {
        let path = folder.join("config.toml");
        let mut given = read_table(&path)?;
        // Programs without this key showed limbs as they are, whatever the preset is now.
        given.entry("mirror").or_insert(toml::Value::Boolean(false));
        let config = Self::from_table(given, &path)?;
        config.check()?;
        Ok(config)
    }

    /// Makes the configuration from a table of the file `path`: its preset and every key that differs.
    ///
    /// # Errors
    /// [`ConfigError`] naming file and key.
    pub(crate) fn from_table(mut given: toml::Table, path: &Path) -> Result<Self, ConfigError> {
        let preset = match given.remove("preset") {
            None => Self::paper(),
            Some(toml::Value::String(name)) if name == "paper" => Self::paper(),
            Some(toml::Value::String(name)) if name == "quick" => Self::quick(),
            Some(toml::Value::String(name)) if name == "standard" => Self::standard(),
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
}

fn read_table(path: &Path) -> Result<toml::Table, ConfigError> {
    let text =
        ppa_core::regular_file::read_to_string(path).map_err(|source| ConfigError::Read {
            path: path.to_owned(),
            source,
        })?;
    toml::from_str(&text).map_err(|error| wrong(path, &error))
}

fn wrong(path: &Path, error: &dyn std::fmt::Display) -> ConfigError {
    ConfigError::Parse {
        path: path.to_owned(),
        message: error.to_string().trim_end().to_owned(),
    }
}

/// Overwrites the values in `all` by those in `given`; tables are merged key by key.
pub(crate) fn merge(all: &mut toml::Table, given: toml::Table) {
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
    fn a_run_without_the_key_shows_limbs_as_they_are() {
        assert!(read(DATA).unwrap().mirror);
        let folder = tempfile::tempdir().unwrap();
        let mut echoed = toml::Table::try_from(read(DATA).unwrap()).unwrap();
        for (mirror, expected) in [(Some(true), true), (Some(false), false), (None, false)] {
            match mirror {
                Some(mirror) => echoed.insert("mirror".into(), mirror.into()),
                None => echoed.remove("mirror"),
            };
            std::fs::write(folder.path().join("config.toml"), echoed.to_string()).unwrap();
            assert_eq!(
                TrainConfig::read_run(folder.path()).unwrap().mirror,
                expected
            );
        }
    }

    #[test]
    fn a_run_without_newer_keys_means_what_it_meant() {
        let folder = tempfile::tempdir().unwrap();
        let paper = read(DATA).unwrap();
        let mut echoed = toml::Table::try_from(&paper).unwrap();
        let mut of_checkpoint = serde_json::to_value(&paper).unwrap();
        for key in [
            "rate_schedule",
            "warm_up_steps",
            "weight_average",
            "recompute_statistics",
            "balanced",
        ] {
            assert!(echoed.remove(key).is_some(), "{key}");
            of_checkpoint.as_object_mut().unwrap().remove(key);
        }
        let of_checkpoint: TrainConfig = serde_json::from_value(of_checkpoint).unwrap();
        assert_eq!(of_checkpoint, paper);
        std::fs::write(folder.path().join("config.toml"), echoed.to_string()).unwrap();
        let found = TrainConfig::read_run(folder.path()).unwrap();
        assert_eq!(found, paper);
    }

    #[test]
    fn mistakes_are_named() {
        for (text, expected) in [
            ("preset = \"fast\"", "unknown preset \"fast\""),
            ("stepz = 3", "unknown field `stepz`"),
            ("side = 8", "side is 8, expected 32 to 4096"),
            ("learning_rate = nan", "learning_rate is NaN"),
            ("steps = 0", "steps is 0"),
            (
                "preset = \"standard\"\nsteps = 100",
                "warm_up_steps is 100, expected less than the steps",
            ),
            (
                "weight_average = 1.0",
                "weight_average is 1, expected 0 to less than 1",
            ),
            (
                "correction_weight = -1.0",
                "correction_weight is -1, expected 0 to 1000",
            ),
            (
                "recompute_statistics = 10001",
                "recompute_statistics is 10001, expected 0 to 10000",
            ),
            (
                "weight_average = 0.9",
                "recompute_statistics is 0, expected at least 1 with weight_average",
            ),
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
            ("device = \"gpu\"", "unknown device \"gpu\""),
        ] {
            let data = if text.is_empty() { "" } else { DATA };
            let error = read(&format!("{text}\n{data}")).unwrap_err();
            assert!(error.contains(expected), "{text}: {error}");
        }
    }
}
