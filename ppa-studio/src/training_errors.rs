//! Errors of a finished training run on its evaluation images, and the images with the largest errors.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex, PoisonError};

use ppa_learn::data::{Images, Sample, check_split};
use ppa_learn::evaluate::{Evaluation, Row};
use ppa_learn::train::{predict, samples, trained};
use serde::Serialize;

use crate::error::StudioError;
use crate::newest::{Newest, Ticket};

/// Number of images with the largest errors that are shown.
const WORST: usize = 12;

/// Number of images predicted between checks for a newer request.
const TOGETHER: usize = 64;

/// The current computation of errors, and the results of each training run.
#[derive(Default)]
pub(crate) struct TrainingErrors {
    /// Running computation.
    pub turn: Newest,
    /// Files of the images with the largest errors, by the folder of the training run.
    worst: Mutex<BTreeMap<PathBuf, Vec<Vec<PathBuf>>>>,
}

/// Evaluation of a network on its evaluation images.
#[derive(Debug, Serialize)]
pub(crate) struct Errors {
    pub evaluation: Evaluation,
    /// The largest errors in descending order.
    pub worst: Vec<Row>,
}

impl TrainingErrors {
    /// Predicts the evaluation images of a finished training run, as `ppa eval` does, until a later request replaces this one.
    pub fn compute(&self, run: &Path, ticket: &Ticket) -> Result<Errors, StudioError> {
        let (config, network) = trained(run)?;
        let tested = samples(&config, &config.evaluation)?;
        check_split(&samples(&config, &config.training)?, &tested)?;
        if tested.is_empty() {
            return Err(StudioError::Invalid(format!(
                "the configuration of {} has no [[evaluation]]",
                run.display()
            )));
        }
        let mut predictions = Vec::new();
        for part in tested.chunks(TOGETHER) {
            if !ticket.is_newest() {
                return Err(StudioError::Superseded);
            }
            let images = Arc::new(Images::new(part.to_vec(), config.side, 0)?);
            predictions.extend(predict(
                &network,
                &images,
                config.batch_size,
                config.workers,
            )?);
        }
        let rows = Row::of(&tested, &predictions);
        let evaluation = Evaluation::of(&rows)?;
        let error = |index: &usize| (rows[*index].prediction - rows[*index].label).abs();
        let mut order: Vec<usize> = (0..rows.len()).collect();
        order.sort_by(|a, b| error(b).total_cmp(&error(a)));
        order.truncate(WORST);
        let files = order.iter().map(|&index| files(&tested[index])).collect();
        let mut kept = self.worst.lock().unwrap_or_else(PoisonError::into_inner);
        kept.insert(run.to_owned(), files);
        Ok(Errors {
            evaluation,
            worst: order.into_iter().map(|index| rows[index].clone()).collect(),
        })
    }

    /// Returns the files of an image with one of the largest errors: of one camera, or of both.
    ///
    /// # Errors
    /// [`StudioError::Invalid`] unless the errors of that training run were computed.
    pub fn images(&self, run: &Path, number: usize) -> Result<Vec<PathBuf>, StudioError> {
        let kept = self.worst.lock().unwrap_or_else(PoisonError::into_inner);
        let files = kept.get(run).and_then(|images| images.get(number)).cloned();
        files.ok_or_else(|| {
            StudioError::Invalid(format!("no error {number} of {} is known", run.display()))
        })
    }
}

fn files(sample: &Sample) -> Vec<PathBuf> {
    sample
        .images
        .iter()
        .map(|image| image.path.clone())
        .collect()
}
