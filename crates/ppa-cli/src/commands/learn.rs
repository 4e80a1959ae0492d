//! `ppa learn`: the network beside reference values, and its weight files.

use std::path::PathBuf;

use anyhow::Context;
use clap::{Args, Subcommand, ValueEnum};
use ppa_learn::{EfficientNetB0, FirstConvolution, Loaded, Options, parity};
use serde::Serialize;

use crate::output::{Output, working};

#[derive(Debug, Subcommand)]
pub enum LearnCommand {
    /// Outputs, loss and gradients of the network beside reference values of another program
    Parity(ParityArgs),
    /// Turn weights of torchvision or timm into safetensors with torchvision's names, or into ONNX
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
pub struct ExportArgs {
    /// Weights of `efficientnet_b0`: .safetensors, .pth or .pt
    weights: PathBuf,
    /// Where they go: .safetensors or .onnx
    #[arg(long)]
    out: PathBuf,
    /// What becomes of a first convolution of several channels
    #[arg(long, value_enum, default_value_t = First::Fresh)]
    first_conv: First,
    /// Seed of what the file does not give
    #[arg(long, default_value_t = 0)]
    seed: u64,
}

#[derive(Debug, Clone, Copy, ValueEnum)]
enum First {
    /// Thrown away and made new, as the paper's authors do
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
    let network = EfficientNetB0::new(args.seed, Options::default())?;
    let first = match args.first_conv {
        First::Fresh => FirstConvolution::Fresh,
        First::Sum => FirstConvolution::Sum,
        First::Mean => FirstConvolution::Mean,
    };
    let Loaded {
        first_convolution,
        fresh_classifier,
        unused,
    } = network.load(&args.weights, first)?;
    let written = if onnx {
        network.save_onnx(&args.out)
    } else {
        network.save(&args.out)
    };
    written.with_context(|| format!("exporting {}", args.weights.display()))?;
    let exported = Exported {
        out: args.out.clone(),
        fresh_first_convolution: first_convolution == Some(FirstConvolution::Fresh),
        fresh_classifier,
        unused,
    };
    output.print(&exported, |exported| {
        let mut text = format!("wrote {}", exported.out.display());
        if exported.fresh_first_convolution {
            text += "; its first convolution is new (--first-conv)";
        }
        if exported.fresh_classifier {
            text += "; its classifier is new, as the file's has another number of outputs";
        }
        if !exported.unused.is_empty() {
            text += &format!("; not used: {}", exported.unused.join(", "));
        }
        text
    })
}
