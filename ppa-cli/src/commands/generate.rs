//! `ppa generate`: makes the dataset of a plan.

use std::path::{Path, PathBuf};

use clap::Args;
use ppa_core::Part;
use ppa_core::text::count;
use ppa_dataset::published::{Published, PublishedError};
use ppa_generate::{GenerateSettings, Plan, Progress, Summary, generate, held_part};

use crate::interrupt::Interrupt;
use crate::output::Output;
use crate::progress::{ProgressArgs, Watch};
use crate::shard::shard;
use crate::stderr;

#[derive(Debug, Args)]
#[command(after_long_help = "\
A run may be killed at any time and started again: only missing poses are made. On several machines, each makes one shard \
in its own folder; `ppa merge` joins them to the same bytes as a single run.

  ppa generate plan.toml --out dataset
  ppa generate plan.toml --shard 2/7 --out shard_2 --disk-limit 20GB
  ppa merge shard_1 shard_2 ... --out dataset --verify

With --out NAME.tar the files of the dataset are put into one archive, for file systems with a limit on the number of files. Poses are made in \
a temporary folder (TMPDIR) and added to the archive one by one. `ppa merge`, `ppa status` and `ppa verify` read archives; other \
commands need the folder, which `tar -xf` extracts.

The shard is also taken from a Slurm job array (SLURM_ARRAY_TASK_ID, _COUNT, _MIN, _MAX, _STEP), from the tasks of srun \
(SLURM_PROCID, SLURM_STEP_NUM_TASKS), from mpirun (OMPI_COMM_WORLD_RANK, _SIZE) and from an indexed Kubernetes job \
(JOB_COMPLETION_INDEX, and JOB_COMPLETIONS, which you set). Where two of them disagree, nothing is made. A folder keeps its \
shard: another one is refused there, and a single task of a Slurm array that runs again keeps the shard of its folder.

A folder that holds poses of other settings, scans or sources, or poses that the plan does not have, is refused as well. \
--replace replaces them pose by pose: each stays until the new one is complete, and what the plan does not have is \
removed at the end. Files that ppa did not write, or that were altered since, are never overwritten but moved to .ppa/altered.")]
pub struct GenerateArgs {
    /// Plan file
    plan: PathBuf,
    /// Folder of the dataset, or a tar archive NAME.tar [default: a folder next to the plan, named after it and the shard]
    #[arg(long, value_name = "DIR")]
    out: Option<PathBuf>,
    /// Use another seed than the plan's
    #[arg(long)]
    seed: Option<u64>,
    /// Make only shard k of n
    #[arg(long, value_name = "K/N")]
    shard: Option<Part>,
    /// Replace what differs from the plan; old images stay until the new ones are complete
    #[arg(long)]
    replace: bool,
    /// Stop before the images exceed this size, such as 500MB or 20GB
    #[arg(long, value_name = "SIZE", value_parser = crate::output::parse_bytes)]
    disk_limit: Option<u64>,
    #[command(flatten)]
    progress: ProgressArgs,
}

pub fn run(args: &GenerateArgs, output: Output) -> anyhow::Result<()> {
    let mut plan = Plan::read(&args.plan)?;
    plan.seed = args.seed.unwrap_or(plan.seed);
    let held = || match &args.out {
        Some(out) => Ok(held_part(out)?),
        None => Ok(None),
    };
    let interrupt = Interrupt::listen()?;
    let settings = GenerateSettings {
        part: shard(args.shard)?.part(held)?,
        disk_limit: args.disk_limit,
        replace: args.replace,
        stop: Some(interrupt.flag()),
    };
    let out = match &args.out {
        Some(out) => out.clone(),
        None if settings.part == Part::WHOLE => dataset_folder(&args.plan)?,
        None => {
            let mut folder = dataset_folder(&args.plan)?.into_os_string();
            folder.push(format!("_{}", settings.part).replace('/', "_of_"));
            folder.into()
        }
    };
    let watch = args.progress.watch("pose", output);
    let summary = with_progress(&plan, &out, &settings, &watch, &interrupt)?;
    if summary.made > 0
        && let Err(outdated @ PublishedError::Outdated { .. }) = Published::read(&out)
    {
        stderr::warning(&outdated.to_string());
    }
    output.print(&summary, |s| describe(s, &out, "made"))
}

/// The folder next to the plan that is named after it.
pub fn dataset_folder(plan: &Path) -> anyhow::Result<PathBuf> {
    let folder = plan.with_extension("");
    anyhow::ensure!(
        folder != plan,
        "{} has no extension: name a folder with --out",
        plan.display()
    );
    Ok(folder)
}

/// Generates a dataset and shows the progress.
pub fn with_progress(
    plan: &Plan,
    out: &Path,
    settings: &GenerateSettings,
    watch: &Watch,
    interrupt: &Interrupt,
) -> anyhow::Result<Summary> {
    let summary = generate(plan, out, settings, &|progress| watch.report(progress));
    if let Ok(summary) = &summary {
        // Some findings appear only while poses are made.
        watch.report(Progress::Findings(&summary.findings));
    }
    watch.finish();
    interrupt.or_how(summary, || watch.how_to_resume())
}

/// Describes the summary; `done` is the verb for the poses that were missing.
pub fn describe(summary: &Summary, out: &Path, done: &str) -> String {
    let mut text = format!(
        "{}: {} and {} of {}, {} of them {done} now",
        out.display(),
        count(summary.depth_images, "depth image"),
        count(summary.radiographs, "radiograph"),
        count(summary.pose_jobs, "pose"),
        summary.made
    );
    if summary.replaced > 0 {
        text += &format!(", {} replacing others", summary.replaced);
    }
    if summary.removed > 0 {
        text += &format!(
            "; removed {} that the plan does not have",
            count(summary.removed, "pose")
        );
    }
    text += &listed("healed", &summary.healed);
    text + &listed("set aside", &summary.set_aside)
}

/// Describes what was done to files and names the first of them.
fn listed(done: &str, files: &[String]) -> String {
    const TOLD: usize = 5;
    if files.is_empty() {
        return String::new();
    }
    let more = files.len().saturating_sub(TOLD);
    let more = if more == 0 {
        String::new()
    } else {
        format!(" and {more} more")
    };
    let first = files
        .iter()
        .take(TOLD)
        .cloned()
        .collect::<Vec<_>>()
        .join(", ");
    format!("\n{done}: {first}{more}")
}
