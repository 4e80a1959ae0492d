//! Warnings before a training run starts.

use std::path::Path;

use ppa_dataset::Findings;

use super::config::TrainConfig;
use super::error::TrainError;
use crate::weights::WeightsMetadata;

/// Returns warnings about conditions that may make a training run worthless but are not errors: severe unacknowledged findings in its
/// datasets, and initial weights that were trained with left limbs shown as right ones if this run shows them as they are.
///
/// # Errors
/// [`TrainError`] if findings or weights cannot be read.
pub fn cautions(config: &TrainConfig) -> Result<Vec<String>, TrainError> {
    let sources = config.training.iter().chain(&config.evaluation);
    let datasets = sources.map(|source| -> &Path { &source.dataset });
    let mut cautions = Findings::open_lines_of(datasets)?;
    if let Some(start) = &config.start
        && !config.mirror
        && WeightsMetadata::read(start)?.mirror
    {
        cautions.push(format!(
            "{} was trained with mirror = true, but this training shows left limbs without mirroring",
            start.display()
        ));
    }
    Ok(cautions)
}
