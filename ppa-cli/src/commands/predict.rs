//! `ppa predict`: the quality of poses from a stream of depth images.

use std::io::{self, BufRead, Write};
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

use anyhow::Context;
use clap::Args;
use ppa_core::Roi;
use ppa_core::text::count;
use ppa_learn::DeviceName;
use ppa_learn::frames::{FramePair, PairFolder, PairPrediction, PairPredictor};
use serde::Serialize;

use crate::interrupt::{Interrupt, ends_at_once};
use crate::number_lists::square;
use crate::output::{Output, Stopwatch};
use crate::stderr;

/// Between two looks into a folder.
const PAUSE: Duration = Duration::from_millis(5);

#[derive(Debug, Args)]
#[command(
    after_help = "Prints one line of JSON for each pair: `name`, `left`, `right` and `quality` (their mean; alone where one network judges pairs) from 1 (ideal) to 3 \
(inadequate), and `latency_ms` from the moment when the pair was found to the answer: how long it waited before, while others were judged, is not \
in it. Frames that cannot be used are named on stderr and skipped. In a folder a name is judged again only after its files were gone. \
The last line gives pairs per second and latencies: on stderr, or on stdout with --json."
)]
pub struct PredictArgs {
    /// Folder of the finished `ppa train` of the left camera's network
    left: PathBuf,
    /// Of the right camera's [default: the first one judges both, and has to be of views = "unified" or "pairs"]
    right: Option<PathBuf>,
    /// Square around the joint in the left camera's frames, in pixels, as in `roi_depth.json`
    #[arg(long, value_name = "X,Y,SIZE", value_parser = square)]
    roi_left: Roi,
    /// The same in the right camera's frames
    #[arg(long, value_name = "X,Y,SIZE", value_parser = square)]
    roi_right: Roi,
    /// Where the networks compute: cpu, cuda or cuda:N
    #[arg(long, default_value_t)]
    device: DeviceName,
    #[command(flatten)]
    source: Source,
}

#[derive(Debug, Args)]
#[group(required = true, multiple = false)]
struct Source {
    /// Judge what is and comes in a folder, `depth_cam_left_NAME.png` with `depth_cam_right_NAME.png`, until Ctrl-C
    #[arg(long, value_name = "DIR")]
    watch: Option<PathBuf>,
    /// Read pairs from standard input, one a line: the path of the left frame, a tab, the path of the right frame
    #[arg(long)]
    stdin: bool,
}

#[derive(Debug, Serialize)]
struct Answer<'a> {
    name: &'a str,
    #[serde(flatten)]
    prediction: PairPrediction,
    latency_ms: f64,
}

#[derive(Debug, Serialize)]
struct Summary {
    pairs: usize,
    skipped: usize,
    /// Frames without the other camera's.
    alone: usize,
    /// Pairs that were found, but not judged before the end.
    unjudged: usize,
    /// From when the first pair was found to the last answer.
    pairs_per_s: Option<f64>,
    median_latency_ms: Option<f64>,
    /// 95 % of the latencies are not longer.
    latency_95_ms: Option<f64>,
    cpu_s: f64,
}

pub fn run(args: &PredictArgs, output: Output) -> anyhow::Result<()> {
    let regions = [args.roi_left, args.roi_right];
    let predictor = PairPredictor::new(&args.left, args.right.as_deref(), regions, args.device)?;
    let mut judge = Judge {
        predictor,
        watch: Stopwatch::start(),
        first: None,
        last: Instant::now(),
        latencies_ms: Vec::new(),
        skipped: 0,
        alone: 0,
        unjudged: 0,
    };
    let ended = match &args.source.watch {
        Some(folder) => judge.folder(folder),
        None => {
            let _stoppable = ends_at_once(
                "; the answers above are whole, and the pairs after them were not judged",
            )?;
            judge.lines(io::stdin().lock())
        }
    };
    if ended.is_err() && judge.first.is_none() && judge.skipped == 0 {
        return ended; // There is nothing that a summary could show.
    }
    let summary = judge.summary();
    let report = match output.json {
        true => output.print(&summary, |_| String::new()),
        false => {
            stderr::note(&describe(&summary));
            Ok(())
        }
    };
    ended.and(report)
}

struct Judge {
    predictor: PairPredictor,
    watch: Stopwatch,
    /// When the first pair was found.
    first: Option<Instant>,
    /// When the last one was answered.
    last: Instant,
    latencies_ms: Vec<f64>,
    skipped: usize,
    alone: usize,
    unjudged: usize,
}

impl Judge {
    fn folder(&mut self, folder: &Path) -> anyhow::Result<()> {
        let interrupt = Interrupt::listen()?;
        let mut pairs = PairFolder::new(folder);
        while !interrupt.is_asked() {
            let found = pairs.look()?;
            self.alone = pairs.alone();
            if found.is_empty() {
                std::thread::sleep(PAUSE);
            }
            self.unjudged = found.len();
            for pair in found {
                if interrupt.is_asked() {
                    return Ok(());
                }
                self.unjudged -= 1;
                if !self.pair(&pair)? {
                    return Ok(());
                }
            }
        }
        Ok(())
    }

    fn lines(&mut self, input: impl BufRead) -> anyhow::Result<()> {
        for (number, line) in input.split(b'\n').enumerate() {
            let line = line.context("cannot read standard input")?;
            let found = Instant::now();
            let line = line.strip_suffix(b"\r").unwrap_or(&line);
            let paths = std::str::from_utf8(line).ok();
            let Some((left, right)) = paths.and_then(|paths| paths.split_once('\t')) else {
                self.skip(&format!(
                    "line {} is {:?}, expected two paths in UTF-8 with a tab between them",
                    number + 1,
                    String::from_utf8_lossy(line)
                ));
                continue;
            };
            let pair = FramePair {
                name: left.to_owned(),
                files: [left.into(), right.into()],
                found,
            };
            if !self.pair(&pair)? {
                break;
            }
        }
        Ok(())
    }

    fn skip(&mut self, why: &str) {
        self.skipped += 1;
        stderr::warning(&format!("skipped: {why}"));
    }

    /// Judges a pair and prints the answer; false once nobody listens any more.
    fn pair(&mut self, pair: &FramePair) -> anyhow::Result<bool> {
        self.first.get_or_insert(pair.found);
        let answered = self
            .predictor
            .predict(pair.files.each_ref().map(|f| f.as_path()));
        self.last = Instant::now();
        let prediction = match answered {
            Ok(prediction) => prediction,
            Err(error) => {
                self.skip(&format!("{:#}", anyhow::Error::from(error)));
                return Ok(true);
            }
        };
        let latency_ms = 1e3 * (self.last - pair.found).as_secs_f64();
        self.latencies_ms.push(latency_ms);
        let answer = Answer {
            name: &pair.name,
            prediction,
            latency_ms,
        };
        match writeln!(io::stdout(), "{}", serde_json::to_string(&answer)?) {
            Err(error) if error.kind() == io::ErrorKind::BrokenPipe => Ok(false),
            result => Ok(result.map(|()| true)?),
        }
    }

    fn summary(mut self) -> Summary {
        self.latencies_ms.sort_by(f64::total_cmp);
        let pairs = self.latencies_ms.len();
        // The least latency that so many percent are not above.
        let percentile = |percent: usize| {
            let rank = (pairs * percent).div_ceil(100);
            Some(self.latencies_ms[rank.checked_sub(1)?])
        };
        let seconds = self.first.map(|first| (self.last - first).as_secs_f64());
        Summary {
            pairs,
            skipped: self.skipped,
            alone: self.alone,
            unjudged: self.unjudged,
            pairs_per_s: seconds.filter(|_| pairs > 0).map(|s| pairs as f64 / s),
            median_latency_ms: percentile(50),
            latency_95_ms: percentile(95),
            cpu_s: self.watch.read().cpu_s,
        }
    }
}

fn describe(summary: &Summary) -> String {
    let mut text = count(summary.pairs, "pair");
    if let (Some(rate), Some(median), Some(most)) = (
        summary.pairs_per_s,
        summary.median_latency_ms,
        summary.latency_95_ms,
    ) {
        text += &format!(
            ", {rate:.1} a second, {:.0} ms of processor time each; latency {median:.0} ms in the median, 95 % within {most:.0} ms",
            1e3 * summary.cpu_s / summary.pairs as f64
        );
    }
    if summary.skipped > 0 {
        text += &format!("; {} skipped", summary.skipped);
    }
    if summary.unjudged > 0 {
        text += &format!("; {} found but not judged", summary.unjudged);
    }
    if summary.alone > 0 {
        text += &format!(
            "; {} without the other camera's",
            count(summary.alone, "frame")
        );
    }
    text
}
