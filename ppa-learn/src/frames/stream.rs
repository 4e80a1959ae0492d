//! Predictions for a stream of pairs: answers, skipped pairs and latencies.

use std::io::{self, BufRead};
use std::ops::ControlFlow;
use std::path::Path;
use std::time::{Duration, Instant};

use ppa_dataset::FileError;
use serde::Serialize;

use super::error::FramesError;
use super::folder::{FramePair, PairFolder};
use super::predictor::{PairPrediction, PairPredictor};

/// Pause between two looks into a folder.
const PAUSE: Duration = Duration::from_millis(5);

/// Error for which a pair of a stream is skipped.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum SkippedPair {
    /// A frame that cannot be used.
    #[error(transparent)]
    Frames(#[from] FramesError),
    /// A line that names no pair.
    #[error("line {number} is {found:?}, expected two paths in UTF-8 with a tab between them")]
    Line {
        /// Number of the line, from 1.
        number: usize,
        /// Content of the line.
        found: String,
    },
}

/// Error that ends a stream early.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum StreamError {
    /// The folder cannot be read.
    #[error(transparent)]
    Folder(#[from] FileError),
    /// Standard input cannot be read.
    #[error("cannot read standard input")]
    Lines(#[source] io::Error),
    /// An answer cannot be passed on.
    #[error(transparent)]
    Answer(#[from] io::Error),
}

/// The answer for one pair.
#[derive(Debug, Serialize)]
pub struct StreamAnswer<'a> {
    /// Name of the pair.
    pub name: &'a str,
    /// Prediction of the networks.
    #[serde(flatten)]
    pub prediction: PairPrediction,
    /// Time from finding the pair to the answer, in ms.
    pub latency_ms: f64,
}

/// Counts, rate and latencies of a stream.
#[derive(Debug, Serialize)]
pub struct StreamSummary {
    /// Number of answered pairs.
    pub pairs: usize,
    /// Number of pairs that could not be used.
    pub skipped: usize,
    /// Number of frames without one of the other camera.
    pub alone: usize,
    /// Number of pairs that were found but not evaluated before the end.
    pub unjudged: usize,
    /// Answered pairs per second, from finding the first pair to the last answer.
    pub pairs_per_s: Option<f64>,
    /// Median latency in ms.
    pub median_latency_ms: Option<f64>,
    /// 95th percentile of the latencies in ms.
    pub latency_95_ms: Option<f64>,
}

/// Predicts the quality of the pairs of a stream and passes each answer or error to `on_answer`, which ends the stream with
/// [`ControlFlow::Break`].
#[derive(Debug)]
pub struct StreamJudge<F> {
    predictor: PairPredictor,
    on_answer: F,
    /// When the first pair was found.
    first: Option<Instant>,
    /// When the last one was answered.
    last: Instant,
    latencies_ms: Vec<f64>,
    skipped: usize,
    alone: usize,
    unjudged: usize,
}

impl<F> StreamJudge<F>
where
    F: FnMut(Result<StreamAnswer, SkippedPair>) -> io::Result<ControlFlow<()>>,
{
    /// Starts a stream.
    pub fn new(predictor: PairPredictor, on_answer: F) -> Self {
        Self {
            predictor,
            on_answer,
            first: None,
            last: Instant::now(),
            latencies_ms: Vec::new(),
            skipped: 0,
            alone: 0,
            unjudged: 0,
        }
    }

    /// Evaluates the present and future pairs of a folder until `is_ended`, called before every pair, returns true.
    ///
    /// # Errors
    /// [`StreamError`] if the folder cannot be read or an answer cannot be passed on.
    pub fn folder(
        &mut self,
        folder: &Path,
        is_ended: impl Fn() -> bool,
    ) -> Result<(), StreamError> {
        let mut pairs = PairFolder::new(folder);
        while !is_ended() {
            let found = pairs.look()?;
            self.alone = pairs.alone();
            if found.is_empty() {
                std::thread::sleep(PAUSE);
            }
            self.unjudged = found.len();
            for pair in found {
                if is_ended() {
                    return Ok(());
                }
                self.unjudged -= 1;
                if self.pair(&pair)?.is_break() {
                    return Ok(());
                }
            }
        }
        Ok(())
    }

    /// Evaluates the pairs named in the lines of standard input: the path of the left frame, a tab, the path of the right frame.
    ///
    /// # Errors
    /// [`StreamError`] if a line cannot be read or an answer cannot be passed on.
    pub fn lines(&mut self, input: impl BufRead) -> Result<(), StreamError> {
        for (index, line) in input.split(b'\n').enumerate() {
            let line = line.map_err(StreamError::Lines)?;
            let found = Instant::now();
            let line = line.strip_suffix(b"\r").unwrap_or(&line);
            let paths = std::str::from_utf8(line).ok();
            let flow = match paths.and_then(|paths| paths.split_once('\t')) {
                Some((left, right)) => self.pair(&FramePair {
                    name: left.to_owned(),
                    files: [left.into(), right.into()],
                    found,
                })?,
                None => self.skip(SkippedPair::Line {
                    number: index + 1,
                    found: String::from_utf8_lossy(line).into_owned(),
                })?,
            };
            if flow.is_break() {
                break;
            }
        }
        Ok(())
    }

    fn skip(&mut self, why: SkippedPair) -> io::Result<ControlFlow<()>> {
        self.skipped += 1;
        (self.on_answer)(Err(why))
    }

    fn pair(&mut self, pair: &FramePair) -> io::Result<ControlFlow<()>> {
        self.first.get_or_insert(pair.found);
        let files = pair.files.each_ref().map(|file| file.as_path());
        let answered = self.predictor.predict(files);
        self.last = Instant::now();
        let prediction = match answered {
            Ok(prediction) => prediction,
            Err(error) => return self.skip(error.into()),
        };
        let latency_ms = 1e3 * (self.last - pair.found).as_secs_f64();
        self.latencies_ms.push(latency_ms);
        (self.on_answer)(Ok(StreamAnswer {
            name: &pair.name,
            prediction,
            latency_ms,
        }))
    }

    /// Returns the summary of the stream so far.
    pub fn summary(mut self) -> StreamSummary {
        self.latencies_ms.sort_by(f64::total_cmp);
        let pairs = self.latencies_ms.len();
        let seconds = self.first.map(|first| (self.last - first).as_secs_f64());
        StreamSummary {
            pairs,
            skipped: self.skipped,
            alone: self.alone,
            unjudged: self.unjudged,
            pairs_per_s: seconds.filter(|_| pairs > 0).map(|s| pairs as f64 / s),
            median_latency_ms: percentile(&self.latencies_ms, 50),
            latency_95_ms: percentile(&self.latencies_ms, 95),
        }
    }
}

/// Returns a percentile of sorted values: the smallest value that `percent` of them do not exceed.
fn percentile(sorted: &[f64], percent: usize) -> Option<f64> {
    let rank = (sorted.len() * percent).div_ceil(100);
    Some(sorted[rank.checked_sub(1)?])
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_percentile_is_the_least_value_that_suffices() {
        let values: Vec<f64> = (1..=20).map(f64::from).collect();
        assert_eq!(percentile(&values, 50), Some(10.0));
        assert_eq!(percentile(&values, 95), Some(19.0));
        assert_eq!(percentile(&values[..1], 95), Some(1.0));
        assert_eq!(percentile(&[], 50), None);
    }
}
