//! Network predictions for the frames that a recorder writes into a folder.

use std::path::PathBuf;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::{Instant, SystemTime};

use image::{Rgb, RgbImage};
use ppa_core::{Roi, Side};
use ppa_dataset::files::FileError;
use ppa_dataset::published::GrayImage16;
use ppa_learn::frames::{FramePair, PairFolder, PairPredictor};
use serde::Serialize;

use crate::error::StudioError;
use crate::false_colours::side_by_side;
use crate::network::{NetworkAnswer, Networks};
use crate::png::png;

/// Colour of the square around the joint.
const REGION: Rgb<u8> = Rgb([255, 255, 255]);

/// Frames to predict from as they arrive, as in `ppa predict --watch`.
#[derive(Debug, Clone)]
pub struct Watch {
    /// Folder of the frames of both cameras.
    pub folder: PathBuf,
    /// Regions of the joint in the left and the right camera's frames.
    pub regions: [Roi; 2],
    /// Side of the limb, required by networks trained with `mirror`.
    pub side: Option<Side>,
}

/// A watched folder and the predictor for its newest pair of frames.
pub(crate) struct Live {
    pub networks: Networks,
    pub watch: Watch,
    predictor: PairPredictor,
    watched: Mutex<Watched>,
}

struct Watched {
    folder: PairFolder,
    /// Number of pairs found so far.
    found: u64,
    shown: Option<Arc<LivePair>>,
}

/// The newest pair with its prediction.
pub(crate) struct LivePair {
    pub report: LiveReport,
    /// Modification time of the later frame's file.
    written: SystemTime,
    /// Time at which both frames were found.
    found: Instant,
    /// Both frames in false colour with the squares around the joint, PNG; empty if one cannot be read.
    pub png: Vec<u8>,
}

#[derive(Debug, Serialize)]
pub(crate) struct LiveReport {
    /// Number of the pair among those found so far, from 1.
    pub number: u64,
    /// The common part of both frames' names.
    pub name: String,
    /// Time from finding the complete pair to the answer.
    pub latency_ms: f64,
    pub answer: NetworkAnswer,
}

impl LivePair {
    /// Returns the age of the frames, seconds; at least the time since they were found, in case the clock of their files is ahead.
    pub fn age_s(&self) -> f64 {
        let written = SystemTime::now().duration_since(self.written);
        let since = written.unwrap_or_default().max(self.found.elapsed());
        since.as_secs_f64()
    }
}

impl Live {
    /// Opens the networks for a folder, which need not have frames yet.
    ///
    /// # Errors
    /// [`StudioError`] naming the training run or the folder that cannot be used.
    pub fn open(networks: &Networks, watch: Watch) -> Result<Self, StudioError> {
        let predictor = networks.predictor(watch.regions, watch.side)?;
        // Fails now rather than at the first request.
        std::fs::read_dir(&watch.folder).map_err(FileError::at("read", &watch.folder))?;
        let watched = Watched {
            folder: PairFolder::new(&watch.folder),
            found: 0,
            shown: None,
        };
        Ok(Self {
            networks: networks.clone(),
            watch,
            predictor,
            watched: Mutex::new(watched),
        })
    }

    /// Returns the newest pair if its number is above `after`. Older pairs found with it are skipped.
    pub fn newest(&self, after: u64) -> Result<Option<Arc<LivePair>>, StudioError> {
        let (pair, number) = {
            let mut watched = self.watched();
            let found = watched.folder.look()?;
            watched.found += found.len() as u64;
            (found.into_iter().next_back(), watched.found)
        };
        // Predicts without the lock, so that another page can ask meanwhile.
        let judged = pair.map(|pair| Arc::new(self.judge(pair, number)));
        let mut watched = self.watched();
        if let Some(judged) = judged
            && watched
                .shown
                .as_ref()
                .is_none_or(|shown| shown.report.number < number)
        {
            watched.shown = Some(judged);
        }
        let shown = watched.shown.clone();
        Ok(shown.filter(|shown| shown.report.number > after))
    }

    fn watched(&self) -> MutexGuard<'_, Watched> {
        self.watched.lock().unwrap_or_else(PoisonError::into_inner)
    }

    fn judge(&self, pair: FramePair, number: u64) -> LivePair {
        let files = pair.files.each_ref().map(|file| &**file);
        let answer = match self.predictor.predict(files) {
            Ok(prediction) => NetworkAnswer::Prediction(prediction),
            Err(error) => NetworkAnswer::Refused(ppa_core::text::error_chain(&error)),
        };
        let latency_ms = 1e3 * pair.found.elapsed().as_secs_f64();
        let written = |file: &PathBuf| std::fs::metadata(file)?.modified();
        let written = pair.files.iter().filter_map(|file| written(file).ok());
        LivePair {
            written: written.max().unwrap_or(SystemTime::now()),
            found: pair.found,
            png: self.picture(&pair).unwrap_or_default(),
            report: LiveReport {
                number,
                name: pair.name,
                latency_ms,
                answer,
            },
        }
    }

    /// Returns `None` if a frame cannot be read; the answer gives the reason.
    fn picture(&self, pair: &FramePair) -> Option<Vec<u8>> {
        let [left, right] = pair
            .files
            .each_ref()
            .map(|file| GrayImage16::read(file).ok());
        let images = [left?, right?];
        let (mut picture, _) = side_by_side(&images);
        for (region, left) in self.watch.regions.iter().zip([0, images[0].width]) {
            draw_square(&mut picture, region, left);
        }
        png(picture).ok()
    }
}

/// Draws the border of a region in the image that begins at column `left` of the picture.
fn draw_square(picture: &mut RgbImage, region: &Roi, left: u32) {
    let [x, y] = [left.saturating_add(region.x_start), region.y_start];
    let last = region.size.saturating_sub(1);
    // Pixels beyond this lie outside the picture.
    for along in 0..region.size.min(picture.width() + picture.height()) {
        for [dx, dy] in [[along, 0], [along, last], [0, along], [last, along]] {
            let place = [x.saturating_add(dx), y.saturating_add(dy)];
            if let Some(pixel) = picture.get_pixel_mut_checked(place[0], place[1]) {
                *pixel = REGION;
            }
        }
    }
}
