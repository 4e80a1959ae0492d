//! `ppa predict`: the quality of poses from a stream of depth images.

use std::io::{self, Write};
use std::ops::ControlFlow;
use std::path::PathBuf;

use clap::Args;
use ppa_core::text::count;
use ppa_core::{Roi, Side};
use ppa_learn::DeviceName;
use ppa_learn::frames::{
    FramesError, PairPredictor, SkippedPair, StreamAnswer, StreamJudge, StreamSummary,
};
use serde::Serialize;

use crate::interrupt::{Interrupt, ends_at_once};
use crate::number_lists::square;
use crate::output::{Output, Stopwatch};
use crate::side_name::SideName;
use crate::stderr;

#[derive(Debug, Args)]
#[command(
    after_help = "Prints one line of JSON for each pair: `name`, `left`, `right` and `quality` (their mean; the only value of a network of pairs) from 1 (ideal) to 3 \
(inadequate), `correction_deg` where networks were trained with a `correction_weight` (medial rotation to the best pose), and `latency_ms` from the moment when the pair was found to the prediction; the time that it waited while others were processed is not \
included. Frames that cannot be used are named on stderr and skipped. In a folder, a name is processed again only after its files were removed. \
The last line gives pairs per second and latencies: on stderr, or on stdout with --json."
)]
pub struct PredictArgs {
    /// Folder of the finished `ppa train` of the left camera's network
    left: PathBuf,
    /// Folder of the right camera's network [default: LEFT is used for both cameras; its views must be "unified" or "pairs"]
    right: Option<PathBuf>,
    /// Square around the joint in the left camera's frames, in pixels, as in `roi_depth.json`
    #[arg(long, value_name = "X,Y,SIZE", value_parser = square)]
    roi_left: Roi,
    /// The same in the right camera's frames
    #[arg(long, value_name = "X,Y,SIZE", value_parser = square)]
    roi_right: Roi,
    /// Side of the limb in the frames: needed by networks that were trained with `mirror = true`
    #[arg(long, value_enum)]
    side: Option<SideName>,
    /// File that `ppa calibrate` wrote for the same networks: adds `interval` and `diagnostic` (yes, no or not_sure), and skips frames unlike the training images
    #[arg(long, value_name = "FILE")]
    confidence: Option<PathBuf>,
    /// Device to run the networks on: cpu, cuda or cuda:N
    #[arg(long, default_value_t)]
    device: DeviceName,
    #[command(flatten)]
    source: Source,
}

#[derive(Debug, Args)]
#[group(required = true, multiple = false)]
struct Source {
    /// Predict for all pairs in this folder, now and later, `depth_cam_left_NAME.png` with `depth_cam_right_NAME.png`, until Ctrl-C
    #[arg(long, value_name = "DIR")]
    watch: Option<PathBuf>,
    /// Read pairs from standard input, one a line: the path of the left frame, a tab, the path of the right frame
    #[arg(long)]
    stdin: bool,
}

#[derive(Debug, Serialize)]
struct Summary {
    #[serde(flatten)]
    stream: StreamSummary,
    cpu_s: f64,
}

pub fn run(args: &PredictArgs, output: Output) -> anyhow::Result<()> {
    let regions = [args.roi_left, args.roi_right];
    let (left, right) = (&args.left, args.right.as_deref());
    let side = args.side.map(Side::from);
    let predictor = match PairPredictor::new(left, right, regions, side, args.device) {
        Err(error @ FramesError::Side { .. }) => {
            return Err(anyhow::Error::from(error).context("give --side l or --side r"));
        }
        predictor => predictor?,
    };
    let predictor = match &args.confidence {
        Some(file) => predictor.with_confidence(file)?,
        None => predictor,
    };
    let watch = Stopwatch::start();
    let mut judge = StreamJudge::new(predictor, print);
    let ended = match &args.source.watch {
        Some(folder) => {
            let interrupt = Interrupt::listen()?;
            judge.folder(folder, || interrupt.is_asked())
        }
        None => {
            let _stoppable = ends_at_once(
                "; the predictions above are complete, and the pairs after them were not processed",
            )?;
            judge.lines(io::stdin().lock())
        }
    };
    let stream = judge.summary();
    if ended.is_err() && stream.pairs + stream.skipped == 0 {
        return Ok(ended?); // There is nothing that a summary could show.
    }
    let cpu_s = watch.read().cpu_s;
    let summary = Summary { stream, cpu_s };
    let report = match output.json {
        true => output.print(&summary, |_| String::new()),
        false => {
            stderr::note(&describe(&summary));
            Ok(())
        }
    };
    ended.map_err(anyhow::Error::from).and(report)
}

/// Prints an answer, or reports a skipped pair on stderr; ends the stream when the reader has closed it.
fn print(answer: Result<StreamAnswer, SkippedPair>) -> io::Result<ControlFlow<()>> {
    let answer = match answer {
        Ok(answer) => answer,
        Err(why) => {
            stderr::warning(&format!("skipped: {:#}", anyhow::Error::from(why)));
            return Ok(ControlFlow::Continue(()));
        }
    };
    match writeln!(io::stdout(), "{}", serde_json::to_string(&answer)?) {
        Err(error) if error.kind() == io::ErrorKind::BrokenPipe => Ok(ControlFlow::Break(())),
        result => result.map(ControlFlow::Continue),
    }
}

fn describe(Summary { stream, cpu_s }: &Summary) -> String {
    let mut text = count(stream.pairs, "pair");
    if let (Some(rate), Some(median), Some(most)) = (
        stream.pairs_per_s,
        stream.median_latency_ms,
        stream.latency_95_ms,
    ) {
        text += &format!(
            ", {rate:.1} a second, {:.0} ms of processor time each; latency {median:.0} ms in the median, 95 % within {most:.0} ms",
            1e3 * cpu_s / stream.pairs as f64
        );
    }
    if stream.skipped > 0 {
        text += &format!("; {} skipped", stream.skipped);
    }
    if stream.unjudged > 0 {
        text += &format!("; {} found but not processed", stream.unjudged);
    }
    if stream.alone > 0 {
        text += &format!(
            "; {} without the other camera's",
            count(stream.alone, "frame")
        );
    }
    text
}
