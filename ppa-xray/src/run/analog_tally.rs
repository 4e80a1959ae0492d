//! Counts of an analog run.

use std::ops::Range;

use serde::{Deserialize, Serialize};

use crate::dose::report::Dose;
use crate::dose::setup::DoseSetup;
use crate::dose::tally::DoseTally;
use crate::engine::analog_image::ImageSetup;
use crate::image::radiograph::Radiograph;
use crate::transport::tally::Tally;

/// Integer sums over a range of the histories of one run.
///
/// Sums of the same histories have the same bytes, however they were counted and merged.
#[derive(Debug)]
pub struct AnalogTally {
    pub(crate) setup: RunSetup,
    /// Histories that this tally covers when complete.
    pub(crate) part: Range<u64>,
    /// Histories counted, from the start of the part.
    pub(crate) done: Range<u64>,
    pub(crate) image: Tally,
    pub(crate) dose: Option<DoseTally>,
}

/// Data shared by all parts of a run.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct RunSetup {
    pub key: String,
    pub seed: u64,
    /// Histories of the whole run.
    pub histories: u64,
    pub image: ImageSetup,
    pub dose: Option<DoseSetup>,
}

impl AnalogTally {
    pub(crate) fn empty(setup: RunSetup, part: Range<u64>) -> Self {
        Self {
            image: Tally::new(setup.image.detector.raster()),
            dose: setup.dose.as_ref().map(DoseSetup::tally),
            done: part.start..part.start,
            part,
            setup,
        }
    }

    /// Histories counted.
    pub fn done(&self) -> Range<u64> {
        self.done.clone()
    }

    /// Histories that this tally covers when complete.
    pub fn part(&self) -> Range<u64> {
        self.part.clone()
    }

    /// Histories of the whole run.
    pub fn histories(&self) -> u64 {
        self.setup.histories
    }

    /// Whether the tally covers all histories of its run.
    pub(crate) fn is_whole_run(&self) -> bool {
        self.part == (0..self.setup.histories)
    }

    /// Shortens a run that is not in parts to the histories counted so far.
    pub(crate) fn end_here(&mut self) {
        if self.is_whole_run() {
            self.part = self.done.clone();
            self.setup.histories = self.done.end;
        }
    }

    /// Median over the pixels of the relative standard error of the image's total, blur and electronic noise included; infinite
    /// for pixels without hits.
    pub fn relative_error(&self) -> f64 {
        let image = self.radiograph();
        let pixels = image.sigma().into_iter().zip(image.total());
        let mut errors: Vec<f32> = pixels
            .map(|(sigma, total)| {
                if total > 0.0 {
                    sigma / total
                } else {
                    f32::INFINITY
                }
            })
            .collect();
        let middle = errors.len() / 2;
        (*errors.select_nth_unstable_by(middle, f32::total_cmp).1).into()
    }

    /// The radiograph of the histories counted so far.
    pub fn radiograph(&self) -> Radiograph {
        self.setup
            .image
            .radiograph(&self.image, self.counted(), self.setup.seed)
    }

    /// The doses of the histories counted so far, if they are counted.
    pub fn dose(&self) -> Option<Dose> {
        let (setup, tally) = (self.setup.dose.as_ref()?, self.dose.as_ref()?);
        Some(setup.report(tally, self.counted(), self.setup.image.histories_per_mas))
    }

    /// Number of histories counted, or 1 if there are none, so that means are zero.
    fn counted(&self) -> u64 {
        (self.done.end - self.done.start).max(1)
    }
}

impl RunSetup {
    /// Bytes of the sums and masses of a tally, or `None` if they overflow or the sizes are invalid.
    pub fn sums_len(&self) -> Option<u64> {
        let image = Tally::byte_len_of(&self.image.detector.raster())? as u64;
        if image == 0 {
            return None;
        }
        match &self.dose {
            Some(dose) => image.checked_add(dose.byte_len()?),
            None => Some(image),
        }
    }
}
