//! `ppa learn`: comparison of the network with reference values, and its weight files.

use std::path::{Path, PathBuf};

use anyhow::Context;
use clap::{Args, Subcommand, ValueEnum};
use ppa_dataset::layout::View;
use ppa_learn::frames::of_camera;
use ppa_learn::train::trained;
use ppa_learn::{FirstConvolution, Loaded, QualityNetwork, WeightsMetadata, parity};
use serde::Serialize;

use crate::output::{Output, working};
use crate::output_files::ReplaceArgs;

#[derive(Debug, Subcommand)]
pub enum LearnCommand {
    /// Compare outputs, loss and gradients with those of another program
    Parity(ParityArgs),
    /// Export a training or a weight file as safetensors or ONNX
    ///
    /// Reads weights of `ppa train`, torchvision and timm; safetensors are written with torchvision's names.
    Export(ExportArgs),
}

#[derive(Debug, Args)]
pub struct ParityArgs {
    /// Weights of EfficientNet-B0 with one channel and one output
    weights: PathBuf,
    /// Safetensors with `input`, `target`, `eval_output_f64`, `train_output_f64` and gradients as `grad_f64.NAME`
    io: PathBuf,
}

#[derive(Debug, Args)]
#[command(
    after_help = "An ONNX model takes `images` [N, 1, H, W], or `left` and `right` for a network of pairs, and gives `quality` [N, 1]. `mirror` = `true` in the metadata of \
either format: left limbs must be shown mirrored, with the cameras exchanged, as in training. Which \
network a weight file is of follows from its names; score fusion with shared weights is distinguished from a single network by its training's folder only."
)]
pub struct ExportArgs {
    /// Folder of a finished `ppa train`, or weights: .safetensors, .pth or .pt
    weights: PathBuf,
    /// Network of the right camera, where WEIGHTS is that of the left one: exports both as one, with averaged outputs
    right: Option<PathBuf>,
    /// File to write: .safetensors or .onnx
    #[arg(long)]
    out: PathBuf,
    /// How a first convolution of several channels is converted to one
    #[arg(long, value_enum, default_value_t = First::Fresh)]
    first_conv: First,
    /// Seed of the weights that the file does not contain
    #[arg(long, default_value_t = 0)]
    seed: u64,
    #[command(flatten)]
    replace: ReplaceArgs,
}

#[derive(Debug, Clone, Copy, ValueEnum)]
enum First {
    /// Replaced by random weights, as the paper's authors do
    Fresh,
    /// Summed over the channels
    Sum,
    /// Averaged over the channels
    Mean,
}

#[derive(Debug, Serialize)]
struct Exported {
    out: PathBuf,
    fresh_first_convolution: bool,
    fresh_classifier: bool,
    kept: Vec<String>,
    unused: Vec<String>,
}

pub fn run(command: &LearnCommand, output: Output) -> anyhow::Result<()> {
    match command {
        LearnCommand::Parity(args) => {
            let spinner = working("forward and backward");
            let parity = parity(&args.weights, &args.io);
            spinner.finish_and_clear();
            output.print(&parity?, |parity| {
                format!(
                    "largest error of an output {:.1e}, loss {:.7}, worst relative error of a gradient {:.1e}",
                    parity.max_abs_output_error, parity.loss, parity.worst_gradient_rel_l2
                )
            })
        }
        LearnCommand::Export(args) => export(args, output),
    }
}

/// Opens the network of a training run's folder or of a weight file; also returns what was not loaded unchanged, and the metadata. Refuses
/// a network for the other camera than `camera`.
fn open(
    path: &Path,
    camera: Option<View>,
    args: &ExportArgs,
) -> anyhow::Result<(QualityNetwork, Loaded, WeightsMetadata)> {
    if path.is_dir() {
        let (config, network) = trained(path)?;
        if let Some(camera) = camera {
            of_camera(path, config.views, camera)?;
        }
        return Ok((network, Loaded::default(), config.weights_metadata()));
    }
    let first = match args.first_conv {
        First::Fresh => FirstConvolution::Fresh,
        First::Sum => FirstConvolution::Sum,
        First::Mean => FirstConvolution::Mean,
    };
    let (network, loaded) = QualityNetwork::open(path, args.seed, first)?;
    Ok((network, loaded, WeightsMetadata::read(path)?))
}

/// Joins the lists of what was not loaded unchanged from two files.
fn both(left: Loaded, right: Loaded) -> Loaded {
    let named = |camera: &str, names: Vec<String>| -> Vec<String> {
        let names = names.into_iter();
        names.map(|name| format!("{camera}: {name}")).collect()
    };
    let mut kept = named("left", left.kept);
    kept.extend(named("right", right.kept));
    let mut unused = named("left", left.unused);
    unused.extend(named("right", right.unused));
    Loaded {
        first_convolution: left.first_convolution.or(right.first_convolution),
        fresh_classifier: left.fresh_classifier || right.fresh_classifier,
        kept,
        unused,
    }
}

fn export(args: &ExportArgs, output: Output) -> anyhow::Result<()> {
    let onnx = match args
        .out
        .extension()
        .and_then(|extension| extension.to_str())
    {
        Some("onnx") => true,
        Some("safetensors") => false,
        _ => anyhow::bail!(
            "--out {}: expected a name that ends in .onnx or .safetensors",
            args.out.display()
        ),
    };
    let mut outputs = args.replace.outputs();
    outputs.file_in_new_folder("--out", &args.out, &[])?;
    let camera = args.right.is_some().then_some(View::Left);
    let (mut network, mut loaded, metadata) = open(&args.weights, camera, args)?;
    if let Some(right) = &args.right {
        let (of_right, more, of_other) = open(right, Some(View::Right), args)?;
        anyhow::ensure!(
            of_other.mirror == metadata.mirror,
            "one of {} and {} was trained with mirror = true, the other was not",
            args.weights.display(),
            right.display()
        );
        network = QualityNetwork::averaged(&network, &of_right)?;
        loaded = both(loaded, more);
    }
    let Loaded {
        first_convolution,
        fresh_classifier,
        kept,
        unused,
    } = loaded;
    let written = if onnx {
        network.save_onnx(&args.out, metadata)
    } else {
        network.save(&args.out, metadata)
    };
    written.with_context(|| format!("exporting {}", args.weights.display()))?;
    let exported = Exported {
        out: args.out.clone(),
        fresh_first_convolution: first_convolution == Some(FirstConvolution::Fresh),
        fresh_classifier,
        kept,
        unused,
    };
    output.print(&exported, |exported| {
        let mut text = format!("wrote {}", exported.out.display());
        if exported.fresh_first_convolution {
            text += "; its first convolution is new (--first-conv)";
        }
        if exported.fresh_classifier {
            text += "; its classifier is new, since the file's has a different number of outputs";
        }
        text + &not_taken(&exported.kept, &exported.unused)
    })
}

/// Lists what was not loaded from a weight file by name; empty if everything was.
pub fn not_taken(kept: &[String], unused: &[String]) -> String {
    let mut text = String::new();
    for (what, names) in [("new instead", kept), ("not used", unused)] {
        if !names.is_empty() {
            text += &format!("; {what}: {}", names.join(", "));
        }
    }
    text
}
