//! Limits on the settings of a training run.

use super::config::TrainConfig;
use super::config_error::ConfigError;

impl TrainConfig {
    /// Refuses numbers outside their valid ranges.
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
        let (warm_up, steps) = (self.warm_up_steps, self.schedule().steps());
        require(
            warm_up < steps,
            "warm_up_steps",
            warm_up.to_string(),
            "less than the steps of the optimiser",
        )?;
        require(
            (0.0..1.0).contains(&self.weight_average),
            "weight_average",
            self.weight_average.to_string(),
            "0 to less than 1",
        )?;
        let weight = self.correction_weight;
        require(
            (0.0..=1000.0).contains(&weight),
            "correction_weight",
            weight.to_string(),
            "0 to 1000",
        )?;
        require(
            self.recompute_statistics <= 10_000,
            "recompute_statistics",
            self.recompute_statistics.to_string(),
            "0 to 10000",
        )?;
        require(
            self.weight_average == 0.0 || self.recompute_statistics > 0,
            "recompute_statistics",
            "0".into(),
            "at least 1 with weight_average, because no batch has passed through the averaged weights",
        )?;
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
}
