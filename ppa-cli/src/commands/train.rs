//! `ppa train`: trains a network from a configuration.

use std::path::PathBuf;

use clap::Args;
use ppa_core::text::count;
use ppa_learn::Loaded;
use ppa_learn::train::{Ended, TrainConfig, cautions, read_start, train};
use serde::Serialize;

use super::learn::not_taken;

use crate::allocator::keep_freed_memory;
use crate::interrupt::Interrupt;
use crate::output::{Output, bar};
use crate::output_files::require_writable;
use crate::stderr::{note, warning};

#[derive(Debug, Args)]
pub struct TrainArgs {
    /// TOML with `preset = "quick"`, "standard" or "paper", `[[training]]`, `[[evaluation]]` and keys that differ from the preset
    config: PathBuf,
    /// Folder of the run; a run that was stopped is resumed
    #[arg(long, value_name = "DIR")]
    out: PathBuf,
}

#[derive(Debug, Serialize)]
struct Trained {
    out: PathBuf,
    finished: bool,
    step: u64,
    steps: u64,
    last_loss: Option<f32>,
    /// What was not loaded unchanged from the `start` file.
    start: Option<Loaded>,
}

pub fn run(args: &TrainArgs, output: Output) -> anyhow::Result<()> {
    let config = TrainConfig::read(&args.config)?;
    let schedule = config.schedule();
    let steps = schedule.steps();
    for caution in cautions(&config)? {
        warning(&caution);
    }
    require_writable("--out", &args.out)?;
    let interrupt = Interrupt::listen()?;
    keep_freed_memory();
    let bar = bar("training");
    bar.set_length(steps);
    let mut last_loss = None;
    let ended = train(&config, &args.out, interrupt.flag(), |progress| {
        // Steps of an earlier run are not part of the time of this one.
        if last_loss.is_none() {
            bar.suspend(|| {
                note(&format!(
                    "{} of the optimiser (steps = {}, step_counting = \"{}\"), {} each",
                    count(steps, "step"),
                    config.steps,
                    config.step_counting,
                    count(config.batch_size.get(), "sample")
                ));
                if progress.step > 1 {
                    let made = progress.step - 1;
                    note(&format!(
                        "resuming after {made} of {}",
                        count(steps, "step")
                    ));
                }
                if let Ok(Some(loaded)) = read_start(&args.out) {
                    let text = not_taken(&loaded.kept, &loaded.unused);
                    note(&format!(
                        "training starts from the weights of `start`{text}"
                    ));
                }
            });
            bar.set_position(progress.step - 1);
            bar.reset_eta();
        }
        last_loss = Some(progress.loss);
        bar.set_position(progress.step);
        bar.set_message(format!("loss {:.4}", progress.loss));
    });
    bar.finish_and_clear();
    let step = match ended? {
        Ended::Finished => steps,
        Ended::Stopped { step } => step,
    };
    let trained = Trained {
        out: args.out.clone(),
        finished: step == steps,
        step,
        steps,
        last_loss,
        start: read_start(&args.out)?,
    };
    if trained.finished || output.json {
        output.print(&trained, |trained| {
            let out = trained.out.display();
            format!("{out}/weights.safetensors after {}", count(steps, "step"))
        })?;
    }
    match trained.finished {
        true => Ok(()),
        false => Err(interrupt.stopped(format!(
            "after {step} of {}; repeat the command to resume",
            count(steps, "step")
        ))),
    }
}
