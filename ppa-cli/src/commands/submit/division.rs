//! The plan or command to submit, and its division into tasks.

use std::collections::BTreeSet;
use std::path::{Path, PathBuf};

use anyhow::{Context, ensure};
use ppa_cluster::{
    ClusterFolder, CostSource, ExperimentTrainings, PoseCost, PoseWork, Program, Submission,
    TaskSettings, TimeLimit, TrainingWork, Work, bundle,
};
use ppa_core::text::count;
use ppa_dataset::files::{remove_if_there, sha256_of_file};
use ppa_generate::{Plan, forecast};
use ppa_learn::experiment::{Experiment, ExperimentPlan, Runner};

use super::SlurmArgs;
use super::histories::HistoriesInput;
use crate::interrupt::{Interrupt, NOTHING_WRITTEN};
use crate::output::working;

/// Shortest time limit of a training run, seconds: each start reads all images, and Slurm sends TERM three minutes before the limit.
const SHORTEST_S: u64 = 10 * 60;

/// A plan of poses or of experiments, with the path of its file, or a command that simulates histories.
pub enum Input {
    Poses(PathBuf, Box<Plan>),
    Experiments(PathBuf, Box<ExperimentPlan>),
    Command(Box<HistoriesInput>),
}

impl Input {
    pub fn read(args: &SlurmArgs, program: &Program) -> anyhow::Result<Self> {
        let Some(path) = &args.plan else {
            let command = HistoriesInput::read(&args.command, program.sha256)?;
            return Ok(Self::Command(Box::new(command)));
        };
        Ok(match ExperimentPlan::is_in(path) {
            true => Self::Experiments(path.clone(), Box::new(ExperimentPlan::read(path)?)),
            false => Self::Poses(path.clone(), Box::new(Plan::read(path)?)),
        })
    }
}

/// Makes the submission of a plan or command, with the recorded division if there is one; writes a plan to the folder.
pub fn submission(
    args: &SlurmArgs,
    input: &Input,
    folder: &ClusterFolder,
    recorded: Option<Submission>,
) -> anyhow::Result<Submission> {
    let settings = settings(args, recorded.as_ref().map(|recorded| &recorded.settings));
    // Next to its destination, since a plan names cases relative to it.
    let copy = folder.slurm().join(".new.plan.toml");
    let path = match input {
        Input::Poses(path, plan) => {
            plan.write(&copy)?;
            path
        }
        Input::Experiments(path, plan) => {
            plan.write(&copy)?;
            path
        }
        Input::Command(command) => {
            let sha256 = sha256_of_file(&command.input)?;
            let source = Source {
                path: &command.input,
                sha256,
            };
            return divided(args, input, source, folder, recorded, settings);
        }
    };
    let source = Source {
        path,
        sha256: sha256_of_file(&copy)?,
    };
    let made = divided(args, input, source, folder, recorded, settings);
    let placed = made.and_then(|made| {
        std::fs::rename(&copy, folder.plan())
            .with_context(|| format!("cannot write {}", folder.plan().display()))?;
        Ok(made)
    });
    if placed.is_err() {
        // The first error is the one to report.
        let _ = remove_if_there(&copy);
    }
    placed
}

/// The file that must not change between tasks.
struct Source<'a> {
    path: &'a Path,
    /// Hash of the copy of a plan, or of the file itself.
    sha256: String,
}

fn divided(
    args: &SlurmArgs,
    input: &Input,
    source: Source,
    folder: &ClusterFolder,
    recorded: Option<Submission>,
    settings: TaskSettings,
) -> anyhow::Result<Submission> {
    let Source { path, sha256 } = source;
    let what = match input {
        Input::Command(_) => "file",
        Input::Poses(..) | Input::Experiments(..) => "plan",
    };
    if let Some(mut kept) = recorded
        .as_ref()
        .filter(|recorded| recorded.submitted)
        .cloned()
    {
        let is_same_kind = matches!(
            (&kept.work, input),
            (Work::Poses(_), Input::Poses(..))
                | (Work::Trainings(_), Input::Experiments(..))
                | (Work::Histories(_), Input::Command(_))
        );
        ensure!(
            is_same_kind,
            "{} contains other work, {} of {}: choose another --out",
            folder.root().display(),
            count(kept.work.tasks(), kept.work.task_name()),
            kept.plan.display()
        );
        if let (Work::Histories(work), Input::Command(command)) = (&kept.work, input) {
            command.check_same(work, args.tasks, &settings)?;
        }
        ensure!(
            kept.plan_sha256 == sha256,
            "{} differs from the {} that was submitted to {}: undo the edit, or choose another --out",
            path.display(),
            what,
            folder.root().display()
        );
        match &kept.work {
            Work::Trainings(work) => {
                let made: BTreeSet<_> = work
                    .experiments
                    .iter()
                    .map(|one| &*one.experiment)
                    .collect();
                let given: BTreeSet<_> = args.experiments.iter().map(|one| one.name()).collect();
                ensure!(
                    given.is_empty() || made == given,
                    "--experiments differ from those that were submitted; leave them out, or choose another --out"
                );
                check_time(&settings)?;
            }
            Work::Poses(work) => {
                ensure!(
                    args.pose_seconds.is_none(),
                    "the plan is divided into {} already, which --pose-seconds cannot change; choose another --out",
                    count(work.bundle.shards, "shard")
                );
                ensure!(
                    work.archive || !args.archive,
                    "the shards of {} are folders, which --archive cannot change; choose another --out",
                    folder.root().display()
                );
                bundle(work.poses, work.cost, settings.cpus, settings.time)?;
            }
            Work::Histories(_) => {}
        }
        kept.settings = settings;
        return Ok(kept);
    }
    // The scripts of a dry run are known as such, also if the plan was changed since.
    let scripts = recorded.as_ref().map(|recorded| recorded.scripts.clone());
    let known = recorded.filter(|recorded| recorded.plan_sha256 == sha256);
    let work = match input {
        Input::Poses(_, plan) => {
            let known = known.as_ref().map(|known| &known.work);
            Work::Poses(poses(args, plan, folder, known, &settings)?)
        }
        Input::Experiments(_, plan) => {
            check_time(&settings)?;
            Work::Trainings(trainings(plan, &args.experiments, folder)?)
        }
        Input::Command(command) => {
            let known = known.as_ref().map(|known| &known.work);
            Work::Histories(command.divided(args.tasks, known, &settings)?)
        }
    };
    let mut first = Submission::new(path.to_owned(), sha256, work, settings);
    first.scripts = scripts.unwrap_or_default();
    Ok(first)
}

/// Divides a plan into shards by the time of a pose: given, known from a dry run, or measured.
fn poses(
    args: &SlurmArgs,
    plan: &Plan,
    folder: &ClusterFolder,
    known: Option<&Work>,
    settings: &TaskSettings,
) -> anyhow::Result<PoseWork> {
    let (cost, cost_source) = match (args.pose_seconds, known) {
        (Some(pose_cpu_s), _) => {
            ensure!(
                pose_cpu_s > 0.0 && pose_cpu_s.is_finite(),
                "--pose-seconds is {pose_cpu_s}, expected a positive number"
            );
            let limb_cpu_s = 0.0;
            let cost = PoseCost {
                pose_cpu_s,
                limb_cpu_s,
                resumes: plan.xray.analog.is_some(),
            };
            (cost, CostSource::Given)
        }
        (None, Some(Work::Poses(known))) => (known.cost, known.cost_source),
        (None, _) => (measured(plan, folder)?, CostSource::Measured),
    };
    let poses = (plan.rotation.poses()?.len() * plan.cases.len()) as u64;
    Ok(PoseWork {
        poses,
        cost,
        cost_source,
        bundle: bundle(poses, cost, settings.cpus, settings.time)?,
        archive: args.archive || matches!(known, Some(Work::Poses(known)) if known.archive),
    })
}

/// Refuses a time limit that hardly leaves time to train.
fn check_time(settings: &TaskSettings) -> anyhow::Result<()> {
    ensure!(
        settings.time.seconds() >= SHORTEST_S,
        "the time limit {} is too short for a training run, expected at least {}",
        settings.time,
        TimeLimit::from_seconds(SHORTEST_S)
    );
    Ok(())
}

/// The training runs of the chosen experiments of a plan, or of all if none is chosen, after checking their data.
fn trainings(
    plan: &ExperimentPlan,
    chosen: &[Experiment],
    folder: &ClusterFolder,
) -> anyhow::Result<TrainingWork> {
    let mut experiments = plan.experiments();
    for &missing in chosen.iter().filter(|one| !experiments.contains(one)) {
        plan.target(missing)?;
    }
    experiments.retain(|one| chosen.is_empty() || chosen.contains(one));
    let runs = folder.runs();
    let mut needed = BTreeSet::new();
    let mut divided = Vec::new();
    for experiment in experiments {
        let runner = Runner::new(plan, experiment, &runs)?;
        runner.check_data(|_| true)?;
        let trainings = runner.runs();
        needed.extend(trainings.iter().filter_map(|training| training.needs()));
        divided.push(ExperimentTrainings {
            experiment: experiment.name().to_owned(),
            trainings: trainings.iter().map(ToString::to_string).collect(),
        });
    }
    let mut work = TrainingWork {
        experiments: divided,
        needed: Vec::new(),
    };
    let own: BTreeSet<&str> = work.trainings().collect();
    let needed = needed.iter().map(ToString::to_string);
    work.needed = needed.filter(|name| !own.contains(&**name)).collect();
    Ok(work)
}

/// Options as given, otherwise as before, otherwise their defaults.
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
        gres: or_before(&args.gres, |s| &s.gres),
        max_tasks: match args.max_tasks {
            Some(most) => Some(most.get()),
            None => before.and_then(|s| s.max_tasks),
        },
        setup: or_before(&args.setup, |s| &s.setup),
    }
}

/// Measures the time of a pose in the middle of the sweep of the first limb.
fn measured(plan: &Plan, folder: &ClusterFolder) -> anyhow::Result<PoseCost> {
    let mut one = plan.clone();
    one.cases.truncate(1);
    let interrupt = Interrupt::listen()?;
    let working = working("measuring one pose");
    let found = forecast(&one, folder.root(), 0.0, interrupt.flag(), &|_| {});
    working.finish_and_clear();
    let found = interrupt.or_how(found, || NOTHING_WRITTEN.to_owned())?;
    Ok(PoseCost {
        pose_cpu_s: found.cpu_s_per_unit,
        limb_cpu_s: found.cpu_s_per_limb,
        resumes: plan.xray.analog.is_some(),
    })
}
