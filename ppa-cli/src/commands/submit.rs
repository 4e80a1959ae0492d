//! `ppa submit`: a plan as jobs of a cluster.

use std::num::{NonZeroU32, NonZeroU64};
use std::path::{Path, PathBuf};

use anyhow::{Context, ensure};
use clap::{Args, Subcommand};
use ppa_cluster::{
    ClusterFolder, CostSource, DEFAULT_MAX_ARRAY_SIZE, JobKind, PoseCost, QueuedJob, SbatchCommand,
    Scripts, ShardState, Slurm, Submission, TaskSettings, TimeLimit, bundle, merge_command,
    shard_commands, shell_quoted, split,
};
use ppa_core::text::count;
use ppa_dataset::files::{remove_if_there, sha256_of_file};
use ppa_generate::{Plan, check, forecast};
use serde::Serialize;

use crate::cluster_report::ClusterReport;
use crate::interrupt::{Interrupt, NOTHING_WRITTEN};
use crate::output::{Output, working};
use crate::stderr;

/// Tasks below this are mostly start-up for the scheduler, seconds.
const SHORT_S: f64 = 20.0 * 60.0;

#[derive(Debug, Subcommand)]
pub enum SubmitCommand {
    /// Submit a plan to Slurm: an array of shards, then their merge
    Slurm(SlurmArgs),
}

#[derive(Debug, Args)]
#[command(after_long_help = "\
One pose of the first limb is made here to measure its time, unless --pose-seconds gives it. Poses are bundled into shards \
of 20 to 40 minutes, or two thirds of --time where that is shorter; a plan that takes less is one shard.

  ppa submit slurm plan.toml --out jobs --cpus 4 --time 2:00:00
  ppa status jobs
  ppa submit slurm plan.toml --out jobs      # again: only shards that are missing

DIR/slurm holds the plan that the jobs read, the scripts shard.sh and merge.sh, and logs; DIR/shards/K holds shard K, \
DIR/dataset the merged and verified dataset. Options that are not given again keep their values; a script that was edited is \
used as it is. Before its time limit a task finishes the poses in progress and is requeued.")]
pub struct SlurmArgs {
    /// Plan file
    plan: PathBuf,
    /// Folder of the jobs and of the dataset, on a disk that all nodes see; created if the folder above exists
    #[arg(long, value_name = "DIR")]
    out: PathBuf,
    /// Partition [default: the cluster's]
    #[arg(long, value_name = "NAME")]
    partition: Option<String>,
    /// Account [default: the user's]
    #[arg(long, value_name = "NAME")]
    account: Option<String>,
    /// Time limit of a task as sbatch takes it, such as 90 (minutes) or 1:30:00 [default: 2:00:00]
    #[arg(long)]
    time: Option<TimeLimit>,
    /// Processors of a task [default: 1]
    #[arg(long, value_name = "N")]
    cpus: Option<NonZeroU32>,
    /// Memory of a task as sbatch takes it, such as 4G [default: the cluster's]
    #[arg(long, value_name = "SIZE")]
    mem: Option<String>,
    /// Run at most this many tasks at a time
    #[arg(long, value_name = "K")]
    max_tasks: Option<NonZeroU64>,
    /// Shell commands that each job runs first, such as 'module load gcc'
    #[arg(long, value_name = "COMMANDS")]
    setup: Option<String>,
    /// Processor time of a pose in seconds, as `ppa plan` measures it; nothing is measured then
    #[arg(long, value_name = "SECONDS")]
    pose_seconds: Option<f64>,
    /// Compare the files of shards that are done with their records, and make damaged ones again
    #[arg(long)]
    check: bool,
    /// Write the scripts and print the commands, but queue nothing; needs no Slurm
    #[arg(long)]
    dry_run: bool,
}

#[derive(Debug, Serialize)]
struct Submitted {
    folder: PathBuf,
    shards: u64,
    #[serde(rename = "units")]
    poses: u64,
    cpu_s_per_unit: f64,
    cost_source: CostSource,
    /// Estimated time of the largest shard.
    task_s: f64,
    max_array_size: u64,
    dry_run: bool,
    /// Shards that are not made, or damaged, and have no job.
    submitted: Vec<u64>,
    commands: Vec<String>,
    /// Of the commands, in their order.
    jobs: Vec<String>,
}

pub fn run(command: &SubmitCommand, program: &Path, output: Output) -> anyhow::Result<()> {
    match command {
        SubmitCommand::Slurm(args) => slurm(args, program, output),
    }
}

fn slurm(args: &SlurmArgs, program: &Path, output: Output) -> anyhow::Result<()> {
    let plan = Plan::read(&args.plan)?;
    let max_array_size = match (Slurm.max_array_size(), args.dry_run) {
        (Ok(size), _) => size,
        (Err(_), true) => DEFAULT_MAX_ARRAY_SIZE,
        (Err(error), false) => return Err(error.into()),
    };
    let folder = ClusterFolder::create(&args.out)?;
    let _lock = folder.lock()?;
    let recorded = Submission::read(&folder.submission())?;
    let mut submission = submission(args, &plan, &folder, recorded)?;
    let scripts = Scripts::new(&folder, &submission, program)?;
    for (path, text) in [
        (folder.shard_script(), &scripts.shard),
        (folder.merge_script(), &scripts.merge),
    ] {
        if submission.write_script(&path, text)? {
            stderr::note(&format!(
                "{} was edited and is used as it is; move it away to have it written again",
                path.display()
            ));
        }
    }
    submission.write(&folder.submission())?;

    let queue = match (Slurm.queue(&folder.job_name()), args.dry_run) {
        (Ok(queue), _) => queue,
        (Err(_), true) => Vec::new(),
        (Err(error), false) => return Err(error.into()),
    };
    let report = ClusterReport::of(&folder, &submission, &queue)?;
    let mut lost = report.lost();
    if args.check {
        lost.extend(damaged(&folder, &report)?);
        lost.sort_unstable();
    }
    let chunks = split(&lost, max_array_size);
    let arrays = shard_commands(&folder, &chunks, submission.settings.max_tasks)?;
    let merges =
        !lost.is_empty() || matches!(report.merge.state, ShardState::Failed | ShardState::Missing);
    let merge = match merges {
        true => Some(merge_command(&folder)?),
        false => None,
    };
    let mut submitted = Submitted {
        folder: args.out.clone(),
        shards: submission.bundle.shards,
        poses: submission.poses,
        cpu_s_per_unit: submission.cost.pose_cpu_s,
        cost_source: submission.cost_source,
        task_s: submission.bundle.task_s,
        max_array_size,
        dry_run: args.dry_run,
        submitted: lost,
        commands: Vec::new(),
        jobs: Vec::new(),
    };
    if !args.dry_run {
        for command in arrays.iter().chain(&merge) {
            Slurm.check(command)?;
        }
        if !submission.submitted {
            submission.submitted = true;
            submission.write(&folder.submission())?;
        }
    }
    // Without limit all arrays may run at once; with one, each waits for the one before.
    let one_by_one = submission.settings.max_tasks.is_some();
    let mut queued = Queueing {
        dry_run: args.dry_run,
        submitted: &mut submitted,
    };
    for command in arrays {
        let last = queued.submitted.jobs.last().filter(|_| one_by_one);
        let after: Vec<_> = last.cloned().into_iter().collect();
        queued.add(command.after(&after))?;
    }
    if let Some(merge) = merge {
        let mut after = waits_for(&queue);
        after.extend(queued.submitted.jobs.iter().cloned());
        if !args.dry_run {
            cancel_waiting_merge(&queue)?;
        }
        queued.add(merge.after(&after))?;
    }
    output.print(&submitted, describe)
}

/// Shards that are done and whose files are not as they were made.
fn damaged(folder: &ClusterFolder, report: &ClusterReport) -> anyhow::Result<Vec<u64>> {
    let mut damaged = Vec::new();
    let shards = report.shards.iter();
    for shard in shards.filter(|shard| shard.report.state == ShardState::Done) {
        let found = check(&folder.shard(shard.shard))?;
        if let Some(problem) = found.problems.first() {
            let number = shard.shard;
            stderr::note(&format!("shard {number} is made again: {problem}"));
            damaged.push(number);
        }
    }
    Ok(damaged)
}

/// The submission of the plan, as it was divided before or is divided now; writes the plan into the folder.
fn submission(
    args: &SlurmArgs,
    plan: &Plan,
    folder: &ClusterFolder,
    recorded: Option<Submission>,
) -> anyhow::Result<Submission> {
    let settings = settings(args, recorded.as_ref().map(|recorded| &recorded.settings));
    // Beside its place, since it names cases from there.
    let copy = folder.slurm().join(".new.plan.toml");
    plan.write(&copy)?;
    let made = divided(args, plan, &copy, folder, recorded, settings);
    let placed = made.and_then(|made| {
        std::fs::rename(&copy, folder.plan())
            .with_context(|| format!("cannot write {}", folder.plan().display()))?;
        Ok(made)
    });
    if placed.is_err() {
        // What failed first is what counts.
        let _ = remove_if_there(&copy);
    }
    placed
}

fn divided(
    args: &SlurmArgs,
    plan: &Plan,
    copy: &Path,
    folder: &ClusterFolder,
    recorded: Option<Submission>,
    settings: TaskSettings,
) -> anyhow::Result<Submission> {
    let sha256 = sha256_of_file(copy)?;
    let (time, cpus) = (settings.time, settings.cpus);
    if let Some(mut kept) = recorded
        .as_ref()
        .filter(|recorded| recorded.submitted)
        .cloned()
    {
        ensure!(
            kept.plan_sha256 == sha256,
            "{} differs from the plan that was submitted, {}: undo the edit, or choose another --out",
            args.plan.display(),
            folder.plan().display()
        );
        ensure!(
            args.pose_seconds.is_none(),
            "the plan is divided into {} already, which --pose-seconds cannot change; choose another --out",
            count(kept.bundle.shards, "shard")
        );
        bundle(kept.poses, kept.cost, cpus, time)?;
        kept.settings = settings;
        return Ok(kept);
    }
    let known = recorded.filter(|recorded| recorded.plan_sha256 == sha256);
    let cost = match (args.pose_seconds, &known) {
        (Some(pose_cpu_s), _) => {
            ensure!(
                pose_cpu_s > 0.0 && pose_cpu_s.is_finite(),
                "--pose-seconds is {pose_cpu_s}, expected a positive number"
            );
            let limb_cpu_s = 0.0;
            let cost = PoseCost {
                pose_cpu_s,
                limb_cpu_s,
            };
            (cost, CostSource::Given)
        }
        (None, Some(known)) => (known.cost, known.cost_source),
        (None, None) => (measured(plan, folder)?, CostSource::Measured),
    };
    let poses = (plan.rotation.poses()?.len() * plan.cases.len()) as u64;
    let bundle = bundle(poses, cost.0, cpus, time)?;
    let mut first = Submission::new(args.plan.clone(), sha256, poses, cost, bundle, settings);
    // Scripts of a dry run are known as such.
    first.scripts = known.map(|known| known.scripts).unwrap_or_default();
    Ok(first)
}

/// Options as given, else as before, else their defaults.
fn settings(args: &SlurmArgs, before: Option<&TaskSettings>) -> TaskSettings {
    let or_before = |given: &Option<String>, of: fn(&TaskSettings) -> &Option<String>| {
        given.clone().or_else(|| before.and_then(|s| of(s).clone()))
    };
    TaskSettings {
        partition: or_before(&args.partition, |s| &s.partition),
        account: or_before(&args.account, |s| &s.account),
        time: args
            .time
            .or(before.map(|s| s.time))
            .unwrap_or(TimeLimit::DEFAULT),
        cpus: match args.cpus {
            Some(cpus) => cpus.get(),
            None => before.map_or(1, |s| s.cpus),
        },
        mem: or_before(&args.mem, |s| &s.mem),
        max_tasks: match args.max_tasks {
            Some(most) => Some(most.get()),
            None => before.and_then(|s| s.max_tasks),
        },
        setup: or_before(&args.setup, |s| &s.setup),
    }
}

/// The time of a pose in the middle of the sweep of the first limb.
fn measured(plan: &Plan, folder: &ClusterFolder) -> anyhow::Result<PoseCost> {
    let mut one = plan.clone();
    one.cases.truncate(1);
    let interrupt = Interrupt::listen()?;
    let working = working("measuring one pose");
    let found = forecast(&one, &folder.dataset(), 0.0, interrupt.flag(), &|_| {});
    working.finish_and_clear();
    let found = interrupt.or_how(found, || NOTHING_WRITTEN.to_owned())?;
    Ok(PoseCost {
        pose_cpu_s: found.cpu_s_per_unit,
        limb_cpu_s: found.cpu_s_per_limb,
    })
}

struct Queueing<'a> {
    dry_run: bool,
    submitted: &'a mut Submitted,
}

impl Queueing<'_> {
    fn add(&mut self, command: SbatchCommand) -> anyhow::Result<()> {
        let job = match self.dry_run {
            true => format!("JOB{}", self.submitted.jobs.len() + 1),
            false => Slurm.submit(&command)?,
        };
        self.submitted.commands.push(command.to_string());
        self.submitted.jobs.push(job);
        Ok(())
    }
}

/// Jobs of earlier submissions that a merge must wait for: arrays, and a merge that runs.
fn waits_for(queue: &[QueuedJob]) -> Vec<String> {
    let counts = |job: &&QueuedJob| job.kind != JobKind::Merge || !job.is_pending();
    let ids = queue.iter().filter(counts).map(QueuedJob::array_id);
    let mut ids: Vec<_> = ids.map(str::to_owned).collect();
    ids.sort();
    ids.dedup();
    ids
}

/// A merge that waits for earlier tasks alone would find shards missing.
fn cancel_waiting_merge(queue: &[QueuedJob]) -> anyhow::Result<()> {
    let waiting = queue
        .iter()
        .filter(|job| job.kind == JobKind::Merge && job.is_pending());
    let ids: Vec<_> = waiting.map(|job| job.id.as_str()).collect();
    match ids.is_empty() {
        true => Ok(()),
        false => Ok(Slurm.cancel(&ids)?),
    }
}

fn describe(submitted: &Submitted) -> String {
    let out = submitted.folder.display();
    let source = match submitted.cost_source {
        CostSource::Measured => "measured on one pose of the first limb",
        CostSource::Given => "as --pose-seconds says",
    };
    let short = match submitted.task_s < SHORT_S {
        true => ", less than the 20 minutes that suit a scheduler",
        false => "",
    };
    let mut lines = vec![format!(
        "{out}: {} in {} of up to {}{short}; {:.1} s of processor time a pose, {source}",
        count(submitted.poses, "pose"),
        count(submitted.shards, "shard"),
        count((submitted.task_s / 60.0).ceil().max(1.0) as u64, "minute"),
        submitted.cpu_s_per_unit,
    )];
    let shards = count(submitted.submitted.len(), "shard");
    match (submitted.jobs.is_empty(), submitted.dry_run) {
        (true, _) => lines.push("nothing to submit: each shard is made or has a job".to_owned()),
        (false, true) => {
            lines.push(format!(
                "not submitted: {shards}; arrays have fewer than {} tasks; JOBn is the number that command n prints",
                submitted.max_array_size
            ));
            lines.extend(submitted.commands.iter().cloned());
        }
        (false, false) => lines.push(format!(
            "submitted {shards}: jobs {}; ppa status {} shows them",
            submitted.jobs.join(", "),
            shell_quoted(&out.to_string())
        )),
    }
    lines.join("\n")
}
