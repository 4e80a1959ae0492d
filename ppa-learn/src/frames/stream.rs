//! Judgement of a stream of pairs: what was answered, what was skipped, and how long it took.

use std::io::{self, BufRead};
use std::ops::ControlFlow;
use std::path::Path;
use std::time::{Duration, Instant};

use ppa_dataset::FileError;
use serde::Serialize;

use super::error::FramesError;
use super::folder::{FramePair, PairFolder};
use super::predictor::{PairPrediction, PairPredictor};

/// Between two looks into a folder.
const PAUSE: Duration = Duration::from_millis(5);

/// Why a pair of a stream is skipped.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum SkippedPair {
    /// A frame that cannot be used.
    #[error(transparent)]
    Frames(#[from] FramesError),
    /// A line that names no pair.
    #[error("line {number} is {found:?}, expected two paths in UTF-8 with a tab between them")]
    Line {
        /// Its number, from 1.
        number: usize,
        /// What it holds.
        found: String,
    },
}

/// Why a stream ends before its end.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum StreamError {
    /// The folder cannot be read.
    #[error(transparent)]
    Folder(#[from] FileError),
    /// Standard input cannot be read.
    #[error("cannot read standard input")]
    Lines(#[source] io::Error),
    /// An answer cannot be handed on.
    #[error(transparent)]
    Answer(#[from] io::Error),
}

/// The answer for one pair.
#[derive(Debug, Serialize)]
pub struct StreamAnswer<'a> {
    /// Name of the pair.
    pub name: &'a str,
    /// What the networks say.
    #[serde(flatten)]
    pub prediction: PairPrediction,
    /// From when the pair was found to the answer.
    pub latency_ms: f64,
}

/// Counts, rate and latencies of a stream.
#[derive(Debug, Serialize)]
pub struct StreamSummary {
    /// Pairs that were answered.
    pub pairs: usize,
    /// Pairs that could not be used.
    pub skipped: usize,
    /// Frames without the other camera's.
    pub alone: usize,
    /// Pairs that were found, but not judged before the end.
    pub unjudged: usize,
    /// From when the first pair was found to the last answer.
    pub pairs_per_s: Option<f64>,
    /// The median of the latencies.
    pub median_latency_ms: Option<f64>,
    /// 95 % of the latencies are not longer.
    pub latency_95_ms: Option<f64>,
}

/// Judges the pairs of a stream and hands each answer, or why there is none, to `on_answer`, which ends the stream with
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
    /// A stream of which nothing was judged.
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

    /// Judges what is and comes in a folder until `is_ended` says so, which is asked before every pair.
    ///
    /// # Errors
    /// [`StreamError`] if the folder cannot be read or an answer cannot be handed on.
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

    /// Judges the pairs that the lines of standard input name: the path of the left frame, a tab, the path of the right frame.
    ///
    /// # Errors
    /// [`StreamError`] if a line cannot be read or an answer cannot be handed on.
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

    /// What was judged so far.
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

/// Percentile of sorted values: the least value that `percent` of them do not exceed.
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
