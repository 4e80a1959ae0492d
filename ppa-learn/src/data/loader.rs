//! Batches prepared by worker threads, in an order that does not depend on the threads.

use std::num::NonZeroUsize;
use std::sync::Arc;
use std::sync::mpsc::{Receiver, SyncSender, sync_channel};
use std::thread;

use super::augment::Augmentation;
use super::balance::Balanced;
use super::error::DataError;
use super::images::Images;
use super::prepare::evaluation_input;
use super::sample::Sample;

/// Number of batches that each worker prepares in advance.
const AHEAD: usize = 2;

/// Batch of network inputs and labels.
#[derive(Debug, Clone, PartialEq)]
pub struct Batch {
    /// Indices of the samples in the list of samples.
    pub samples: Vec<usize>,
    /// `samples.len() * side * side` values in [−0.5, 0.5] for each camera.
    pub images: Vec<Vec<f32>>,
    /// One label for each sample.
    pub labels: Vec<f32>,
    /// Medial rotation in degrees to the best pose of the limb, if known.
    pub corrections_deg: Vec<Option<f32>>,
}

/// Order in which samples fill the batches.
#[derive(Debug, Clone)]
pub enum Order {
    /// Endless random sequence.
    Training {
        /// How samples are drawn.
        balanced: Balanced,
        /// Augmentation; `None` gives the images as in evaluation.
        augmentation: Option<Augmentation>,
        /// Seed; together with the position in the sequence, it determines all random numbers.
        seed: u64,
        /// Number of the first batch; a resumed training run begins where it stopped.
        first_batch: u64,
    },
    /// Each sample once, in order; the last batch may be short.
    Once,
    /// These samples, in this order; the last batch may be short.
    Listed(Vec<usize>),
}

/// Iterator over batches that worker threads prepare in advance; dropping it ends the threads.
#[derive(Debug)]
pub struct Loader {
    /// Worker w of W makes the batches w, w + W, w + 2 W …
    workers: Vec<Receiver<Result<Batch, DataError>>>,
    next: usize,
}

impl Loader {
    /// Starts loading batches of `batch_size` samples with `workers` threads.
    ///
    /// # Panics
    /// If a thread cannot be started.
    pub fn new(
        images: &Arc<Images>,
        order: &Order,
        batch_size: NonZeroUsize,
        workers: NonZeroUsize,
    ) -> Self {
        let start = |worker| {
            let (sender, receiver) = sync_channel(AHEAD);
            let maker = Maker {
                images: Arc::clone(images),
                order: order.clone(),
                batch_size: batch_size.get(),
            };
            let step = workers.get();
            thread::Builder::new()
                .name(format!("loader {worker}"))
                .spawn(move || maker.send(worker, step, &sender))
                .expect("a thread can be made");
            receiver
        };
        Self {
            workers: (0..workers.get()).map(start).collect(),
            next: 0,
        }
    }
}

impl Iterator for Loader {
    type Item = Result<Batch, DataError>;

    fn next(&mut self) -> Option<Self::Item> {
        let batch = self.workers[self.next].recv().ok()?;
        self.next = (self.next + 1) % self.workers.len();
        Some(batch)
    }
}

struct Maker {
    images: Arc<Images>,
    order: Order,
    batch_size: usize,
}

impl Maker {
    /// Sends every `step`th batch until there are no more, one fails, or the receiver is gone.
    fn send(&self, worker: usize, step: usize, listener: &SyncSender<Result<Batch, DataError>>) {
        for number in (worker..).step_by(step) {
            let Some(batch) = self.batch(number as u64).transpose() else {
                return;
            };
            let failed = batch.is_err();
            if listener.send(batch).is_err() || failed {
                return;
            }
        }
    }

    fn batch(&self, number: u64) -> Result<Option<Batch>, DataError> {
        let size = self.batch_size as u64;
        // Positions in the sequence of samples.
        let places = match &self.order {
            Order::Training { first_batch, .. } => {
                let start = (first_batch + number) * size;
                start..start + size
            }
            Order::Once => part(number, size, self.images.samples().len()),
            Order::Listed(samples) => part(number, size, samples.len()),
        };
        if places.is_empty() {
            return Ok(None);
        }
        let mut batch = Batch {
            samples: Vec::new(),
            images: Vec::new(),
            labels: Vec::new(),
            corrections_deg: Vec::new(),
        };
        for place in places {
            let (sample, inputs) = self.inputs(place)?;
            batch.samples.push(sample);
            let Sample {
                label,
                correction_deg,
                ..
            } = &self.images.samples()[sample];
            batch.labels.push(*label as f32);
            let correction_deg = correction_deg.map(|degrees| degrees as f32);
            batch.corrections_deg.push(correction_deg);
            batch.images.resize_with(inputs.len(), Vec::new);
            for (camera, input) in batch.images.iter_mut().zip(inputs) {
                camera.extend(input);
            }
        }
        Ok(Some(batch))
    }

    /// Returns the sample at a position of the sequence, and the network input of each camera.
    fn inputs(&self, place: u64) -> Result<(usize, Vec<Vec<f32>>), DataError> {
        let side = self.images.side();
        let sample = match &self.order {
            Order::Training { balanced, seed, .. } => balanced.pick(*seed, place),
            Order::Once => place as usize,
            Order::Listed(samples) => samples[place as usize],
        };
        let prepared = self.images.get(sample)?;
        let inputs = match &self.order {
            Order::Training {
                augmentation: Some(augmentation),
                seed,
                ..
            } => {
                let prepared: Vec<_> = prepared.iter().collect();
                augmentation.apply(&prepared, side, *seed, place)
            }
            _ => {
                let inputs = prepared.iter().map(|image| evaluation_input(image, side));
                inputs.collect()
            }
        };
        let inputs = inputs.into_iter().map(|input| input.into_values());
        Ok((sample, inputs.collect()))
    }
}

/// Returns the positions of batch `number` in a sequence of `count` samples; empty after its end.
fn part(number: u64, size: u64, count: usize) -> std::ops::Range<u64> {
    let end = count as u64;
    (number * size).min(end)..((number + 1) * size).min(end)
}
