//! `ppa submit`: submits a plan, a plan of experiments, or the histories of a command as jobs of a cluster.

mod divisible_command;
mod division;
mod histories;

use std::num::{NonZeroU32, NonZeroU64};
use std::path::{Path, PathBuf};

use anyhow::bail;
use clap::{Args, Subcommand};
use ppa_cluster::{
    ClusterFolder, CostSource, DEFAULT_MAX_ARRAY_SIZE, JobKind, PoseWork, Program, QueuedJob,
    SbatchCommand, Scripts, ShardState, Slurm, Submission, TimeLimit, Work, last_command,
    shell_quoted, split, task_commands,
};
use ppa_core::text::count;
use ppa_dataset::files::sha256_of_file;
use ppa_generate::check;
use ppa_learn::experiment::Experiment;
use serde::Serialize;

use crate::cluster_report::ClusterReport;
use crate::output::Output;
use crate::stderr;
use division::{Input, submission};
use histories::damaged_tally;

/// Duration below which tasks are mostly start-up for the scheduler, seconds.
const SHORT_S: f64 = 20.0 * 60.0;

#[derive(Debug, Subcommand)]
pub enum SubmitCommand {
    /// Submit to Slurm: the shards of a plan, the training runs of experiments, or parts of the histories of a command
    Slurm(SlurmArgs),
}

#[derive(Debug, Args)]
#[command(after_long_help = "\
  ppa submit slurm plan.toml --out jobs --cpus 4 --time 2:00:00
  ppa status jobs
  ppa submit slurm plan.toml --out jobs   # again: only missing shards

For a plan, one pose of the first limb is made here to measure its time, unless --pose-seconds gives it. Poses are bundled \
into shards of 20 to 40 minutes, or two thirds of --time where that is shorter; a plan that takes less is one shard. \
DIR/shards/K holds shard K, DIR/dataset the merged dataset, verified unless its engine is analog; with --archive they are DIR/shards/K.tar and \
DIR/dataset.tar, for file systems with a limit on the number of files. Before its time limit a task finishes the poses in \
progress and is requeued.

  ppa submit slurm experiments.toml --out jobs --cpus 4 --gres gpu:1

For experiments, each training run is a task. DIR/runs holds the training runs and the tables, DIR/experiments.html the \
report. Before its time limit a task writes a checkpoint and is requeued.

  ppa submit slurm --out jobs --cpus 4 -- \\
      xray simulate leg.case.toml --engine analog --histories 2e10 --out leg.png
  ppa submit slurm --out jobs --cpus 4 -- xray mcgpu scan.in --out scan

For a command that follows analog histories, each task follows a part of them, and the last job writes the outputs of the \
command, the same bytes as without tasks. Some histories are followed here to measure their time, unless --tasks is given. \
DIR/parts holds the tallies. Before its time limit a task saves its tallies and is requeued.

DIR/slurm holds the plan that the jobs read, their scripts and logs. Options that are not given again keep their values; a \
script that was edited is used as it is.")]
pub struct SlurmArgs {
    /// Plan, as for `ppa generate` or `ppa experiment`
    #[arg(required_unless_present = "command")]
    plan: Option<PathBuf>,
    /// Folder for the jobs and their output, on a disk that all nodes see; created if its parent folder exists
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
    /// Generic resources of a task as sbatch takes them, such as gpu:1
    #[arg(long, value_name = "LIST")]
    gres: Option<String>,
    /// Run at most this many tasks at a time
    #[arg(long, value_name = "K")]
    max_tasks: Option<NonZeroU64>,
    /// Shell commands that each job runs first, such as 'module load gcc'
    #[arg(long, value_name = "COMMANDS")]
    setup: Option<String>,
    /// For a plan of poses: processor time of a pose in seconds, as measured by `ppa plan`, instead of measuring it
    #[arg(long, value_name = "SECONDS")]
    pose_seconds: Option<f64>,
    /// For a plan of poses: make each shard one tar archive, and the dataset another one
    #[arg(long)]
    archive: bool,
    /// For a plan of experiments: only these, such as 1,2a [default: all that it has data for]
    #[arg(long, value_name = "NAMES", value_delimiter = ',')]
    experiments: Vec<Experiment>,
    /// Read all files of finished shards or parts, and redo damaged ones; a damaged tally is renamed *.damaged
    #[arg(long)]
    check: bool,
    /// For a command: divide its histories into this many tasks, instead of measuring their time
    #[arg(long, value_name = "N")]
    tasks: Option<NonZeroU64>,
    /// Write the scripts and print the commands, but queue nothing; needs no Slurm
    #[arg(long)]
    dry_run: bool,
    /// In place of a plan, `xray simulate --engine analog` or `xray mcgpu` with all their options
    #[arg(last = true, value_name = "COMMAND", conflicts_with = "plan")]
    command: Vec<String>,
}

#[derive(Debug, Serialize)]
struct Submitted {
    folder: PathBuf,
    /// Number of tasks: shards, training runs or parts.
    shards: u64,
    #[serde(flatten)]
    poses: Option<SubmittedPoses>,
    #[serde(flatten)]
    histories: Option<SubmittedHistories>,
    max_array_size: u64,
    dry_run: bool,
    /// Name of a task.
    #[serde(skip)]
    task: &'static str,
    /// Tasks without a job that are unfinished or whose shards are damaged.
    submitted: Vec<u64>,
    commands: Vec<String>,
    /// Job identifiers of the commands, in the same order.
    jobs: Vec<String>,
}

#[derive(Debug, Serialize)]
struct SubmittedPoses {
    #[serde(rename = "units")]
    poses: u64,
    cpu_s_per_unit: f64,
    cost_source: CostSource,
    /// Estimated time of the largest shard, seconds.
    task_s: f64,
}

impl SubmittedPoses {
    fn of(work: &Work) -> Option<Self> {
        let Work::Poses(PoseWork {
            poses,
            cost,
            cost_source,
            bundle,
            archive: _,
        }) = work
        else {
            return None;
        };
        Some(Self {
            poses: *poses,
            cpu_s_per_unit: cost.pose_cpu_s,
            cost_source: *cost_source,
            task_s: bundle.task_s,
        })
    }
}

#[derive(Debug, Serialize)]
struct SubmittedHistories {
    /// Total over all projections.
    histories: u64,
    /// As measured; absent if --tasks was given.
    cpu_s_per_million: Option<f64>,
}

impl SubmittedHistories {
    fn of(work: &Work) -> Option<Self> {
        let Work::Histories(work) = work else {
            return None;
        };
        Some(Self {
            histories: work.divided.all_histories(),
            cpu_s_per_million: work.cost.map(|cost| cost.million_cpu_s),
        })
    }
}

pub fn run(command: &SubmitCommand, program: &Path, output: Output) -> anyhow::Result<()> {
    match command {
        SubmitCommand::Slurm(args) => slurm(args, program, output),
    }
}

fn slurm(args: &SlurmArgs, program: &Path, output: Output) -> anyhow::Result<()> {
    let program = Program {
        path: program,
        sha256: &sha256_of_file(program)?,
    };
    let work = Input::read(args, &program)?;
    let experiments = ("--experiments", !args.experiments.is_empty());
    let pose_seconds = ("--pose-seconds", args.pose_seconds.is_some());
    let archive = ("--archive", args.archive);
    let check = ("--check", args.check);
    let tasks = ("--tasks", args.tasks.is_some());
    let (kind, of_others) = match work {
        Input::Poses(..) => ("a plan of poses", vec![experiments, tasks]),
        Input::Experiments(..) => (
            "a plan of experiments",
            vec![pose_seconds, archive, check, tasks],
        ),
        Input::Command(_) => ("a command", vec![experiments, pose_seconds, archive]),
    };
    if let Some((option, _)) = of_others.iter().find(|(_, given)| *given) {
        bail!("{option} does not apply to {kind}");
    }
    let max_array_size = match (Slurm.max_array_size(), args.dry_run) {
        (Ok(size), _) => size,
        (Err(_), true) => DEFAULT_MAX_ARRAY_SIZE,
        (Err(error), false) => return Err(error.into()),
    };
    let folder = ClusterFolder::create(&args.out)?;
    let _lock = folder.lock()?;
    let recorded = Submission::read(&folder.submission())?;
    let mut submission = submission(args, &work, &folder, recorded)?;
    folder.create_results(&submission.work)?;
    let scripts = Scripts::new(&folder, &submission, &program)?;
    for (path, text) in [
        (folder.task_script(&submission.work), &scripts.task),
        (folder.last_script(&submission.work), &scripts.last),
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
        lost.extend(damaged(&folder, &report, &submission.work, args.dry_run)?);
        lost.sort_unstable();
        lost.dedup();
    }
    let chunks = split(&lost, max_array_size);
    let arrays = task_commands(&folder, &submission, &chunks)?;
    // Outputs of a command belong to the user once they are written.
    let is_over =
        matches!(submission.work, Work::Histories(_)) && report.merge.state == ShardState::Done;
    let has_no_last = matches!(report.merge.state, ShardState::Failed | ShardState::Missing);
    let needs_last = !is_over && (!lost.is_empty() || has_no_last);
    let last = match needs_last {
        true => Some(last_command(&folder, &submission.work)?),
        false => None,
    };
    let mut submitted = Submitted {
        folder: args.out.clone(),
        shards: submission.work.tasks(),
        poses: SubmittedPoses::of(&submission.work),
        histories: SubmittedHistories::of(&submission.work),
        task: submission.work.task_name(),
        max_array_size,
        dry_run: args.dry_run,
        submitted: lost,
        commands: Vec::new(),
        jobs: Vec::new(),
    };
    if !args.dry_run {
        for command in arrays.iter().chain(&last) {
            Slurm.check(command)?;
        }
        if !submission.submitted {
            submission.submitted = true;
            submission.write(&folder.submission())?;
        }
    }
    // Without a limit all arrays may run at once; with one, each waits for the previous one.
    let one_by_one = submission.settings.max_tasks.is_some();
    let mut queued = Queueing {
        dry_run: args.dry_run,
        submitted: &mut submitted,
    };
    for command in arrays {
        let before = queued.submitted.jobs.last().filter(|_| one_by_one);
        let after: Vec<_> = before.cloned().into_iter().collect();
        queued.add(command.after(&after))?;
    }
    if let Some(last) = last {
        let mut after = waits_for(&queue);
        after.extend(queued.submitted.jobs.iter().cloned());
        if !args.dry_run {
            cancel_waiting_last(&queue)?;
        }
        queued.add(last.after(&after))?;
    }
    output.print(&submitted, describe)
}

/// Tasks without a job whose files are damaged. Damaged tallies are renamed, but not in a dry run.
fn damaged(
    folder: &ClusterFolder,
    report: &ClusterReport,
    work: &Work,
    dry_run: bool,
) -> anyhow::Result<Vec<u64>> {
    let mut damaged = Vec::new();
    for shard in report
        .shards
        .iter()
        .filter(|shard| shard.report.job.is_none())
    {
        let number = shard.shard;
        let problem = match work {
            Work::Histories(_) => damaged_tally(&folder.part(number), !dry_run)?,
            // An unfinished shard is repeated anyway.
            _ if shard.report.state != ShardState::Done => None,
            Work::Poses(work) => {
                let found = check(&folder.shard(work, number))?;
                found.problems.first().map(ToString::to_string)
            }
            // --check is refused for training runs.
            Work::Trainings(_) => None,
        };
        if let Some(problem) = problem {
            stderr::note(&format!(
                "{} {number} is made again: {problem}",
                work.task_name()
            ));
            damaged.push(number);
        }
    }
    Ok(damaged)
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

/// Identifiers of jobs of earlier submissions that the last job must wait for: arrays, and another last job that is running.
fn waits_for(queue: &[QueuedJob]) -> Vec<String> {
    let counts = |job: &&QueuedJob| job.kind != JobKind::Merge || !job.is_pending();
    let ids = queue.iter().filter(counts).map(QueuedJob::array_id);
    let mut ids: Vec<_> = ids.map(str::to_owned).collect();
    ids.sort();
    ids.dedup();
    ids
}

/// Cancels last jobs that wait only for earlier tasks: they would find results missing.
fn cancel_waiting_last(queue: &[QueuedJob]) -> anyhow::Result<()> {
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
    let tasks = |n: usize| count(n, submitted.task);
    let all = tasks(submitted.shards as usize);
    let mut lines = vec![match (&submitted.poses, &submitted.histories) {
        (Some(poses), _) => {
            let source = match poses.cost_source {
                CostSource::Measured => "measured on one pose of the first limb",
                CostSource::Given => "given by --pose-seconds",
            };
            let short = match poses.task_s < SHORT_S {
                true => ", less than the 20 minutes that suit a scheduler",
                false => "",
            };
            format!(
                "{out}: {} in {all} of up to {}{short}; {:.1} s of processor time a pose, {source}",
                count(poses.poses, "pose"),
                count((poses.task_s / 60.0).ceil().max(1.0) as u64, "minute"),
                poses.cpu_s_per_unit,
            )
        }
        (None, Some(histories)) => {
            let measured = histories.cpu_s_per_million;
            let measured = measured.map_or(String::new(), |cpu_s| {
                format!("; {cpu_s:.2} s of processor time a million, measured")
            });
            format!(
                "{out}: {:.4e} histories in {all}{measured}",
                histories.histories as f64
            )
        }
        (None, None) => format!("{out}: {all}, each a task"),
    }];
    let new = tasks(submitted.submitted.len());
    match (submitted.jobs.is_empty(), submitted.dry_run) {
        (true, _) => lines.push(format!(
            "nothing to submit: each {} is finished or has a job",
            submitted.task
        )),
        (false, true) => {
            lines.push(format!(
                "not submitted: {new}; arrays have fewer than {} tasks; JOBn is the number that command n prints",
                submitted.max_array_size
            ));
            lines.extend(submitted.commands.iter().cloned());
        }
        (false, false) => lines.push(format!(
            "submitted {new}: jobs {}; ppa status {} shows them",
            submitted.jobs.join(", "),
            shell_quoted(&out.to_string())
        )),
    }
    lines.join("\n")
}
