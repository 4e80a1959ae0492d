//! Checks of the data of all training runs before the first one starts.

use std::collections::{BTreeMap, BTreeSet};
use std::path::PathBuf;

use ppa_core::text::error_chain;

use super::error::ExperimentError;
use super::run::Runner;
use super::training::Training;
use crate::data::{Balanced, DataError};
use crate::train::{Source, TrainConfig, TrainError, samples};

/// Persons, by dataset and number.
type Persons = BTreeSet<(PathBuf, u32)>;

/// Persons or problems found in the images of sources, by the text of the sources.
type Seen = BTreeMap<String, Result<Persons, BTreeSet<String>>>;

impl Runner<'_> {
    /// Checks the images, labels, regions, body shapes, persons and initial weights of the training runs and tests that `mine` selects by
    /// the number of their run, from 0.
    ///
    /// # Errors
    /// [`ExperimentError::Unusable`] with every reason why a training run could not start.
    pub fn check_data(&self, mine: impl Fn(usize) -> bool) -> Result<(), ExperimentError> {
        // All seeds use the same images, so one of them is enough.
        let picked = self.runs().into_iter().enumerate();
        let picked = picked
            .filter(|&(n, _)| mine(n))
            .map(|(_, training)| training);
        let picked: Vec<_> = picked.collect();
        let Some(first) = picked.iter().map(|training| seed(*training)).min() else {
            return Ok(());
        };
        let runs = picked.into_iter().filter(|run| seed(*run) == first);
        let (mut seen, mut problems) = (Seen::new(), BTreeSet::new());
        let (mut trainings, mut unusable) = (0, 0);
        for run in runs {
            let found = self.problems(run, &mut seen)?;
            trainings += 1;
            unusable += usize::from(!found.is_empty());
            problems.extend(found);
        }
        match problems.is_empty() {
            true => Ok(()),
            false => Err(ExperimentError::Unusable {
                unusable,
                trainings,
                problems: problems.into_iter().collect::<Vec<_>>().join("; "),
            }),
        }
    }

    /// Returns the problems of a run and of the pretraining that it needs.
    fn problems(
        &self,
        run: Training,
        seen: &mut Seen,
    ) -> Result<BTreeSet<String>, ExperimentError> {
        let config = self.config(run)?;
        let mut problems = BTreeSet::new();
        let tested = persons(&config, &config.evaluation, seen, &mut problems);
        let mut trained = vec![persons(&config, &config.training, seen, &mut problems)];
        match run.needs() {
            Some(pretraining) => {
                let config = self.config(pretraining)?;
                trained.push(persons(&config, &config.training, seen, &mut problems));
            }
            None => {
                let missing = config.start.iter().filter(|start| !start.is_file());
                problems.extend(missing.map(|start| format!("{} is not a file", start.display())));
            }
        }
        for trained in &trained {
            if let Some((dataset, patient)) = trained.intersection(&tested).next() {
                let person = format!("{}, patient {patient}", dataset.display());
                problems.insert(DataError::Leak(person).to_string());
            }
        }
        Ok(problems)
    }
}

fn seed(training: Training) -> u64 {
    match training {
        Training::Pretraining { seed, .. } | Training::Run { seed, .. } => seed,
    }
}

/// Returns the persons in the images of sources, and adds the problems found.
fn persons(
    config: &TrainConfig,
    sources: &[Source],
    seen: &mut Seen,
    problems: &mut BTreeSet<String>,
) -> Persons {
    let name = format!(
        "{sources:?} {:?} {} {}",
        config.views, config.frames_per_pose, config.mirror
    );
    let found = seen.entry(name).or_insert_with(|| look(config, sources));
    match found {
        Ok(persons) => persons.clone(),
        Err(wrong) => {
            problems.extend(wrong.iter().cloned());
            Persons::new()
        }
    }
}

fn look(config: &TrainConfig, sources: &[Source]) -> Result<Persons, BTreeSet<String>> {
    let error = match persons_of(config, sources) {
        Ok(persons) => return Ok(persons),
        Err(error) => error,
    };
    // The error names only the first missing body shape; checking each shape separately names all of them.
    let one_shape = |source: &Source| -> Vec<Source> {
        let shapes = source.shapes.iter().flatten();
        let only = |&shape| Source {
            shapes: Some(vec![shape]),
            ..source.clone()
        };
        shapes.map(only).collect()
    };
    let alone = sources.iter().flat_map(one_shape);
    let mut wrong: BTreeSet<String> = alone
        .filter_map(|source| persons_of(config, &[source]).err())
        .collect();
    if wrong.is_empty() {
        wrong.insert(error);
    }
    Err(wrong)
}

fn persons_of(config: &TrainConfig, sources: &[Source]) -> Result<Persons, String> {
    let samples = samples(config, sources).map_err(|error| error_chain(&error))?;
    Balanced::new(&samples).map_err(|error| error_chain(&TrainError::from(error)))?;
    let person = |sample: &crate::data::Sample| (sample.dataset.clone(), sample.limb.patient);
    Ok(samples.iter().map(person).collect())
}
