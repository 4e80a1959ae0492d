//! The plan to submit, and its division into tasks.

use std::collections::BTreeSet;
use std::path::Path;

use anyhow::{Context, ensure};
use ppa_cluster::{
    ClusterFolder, CostSource, ExperimentTrainings, PoseCost, PoseWork, Submission, TaskSettings,
    TimeLimit, TrainingWork, Work, bundle,
};
use ppa_core::text::count;
use ppa_dataset::files::{remove_if_there, sha256_of_file};
use ppa_generate::{Plan, forecast};
use ppa_learn::experiment::{Experiment, ExperimentPlan, Runner};

use super::SlurmArgs;
use crate::interrupt::{Interrupt, NOTHING_WRITTEN};
use crate::output::working;

/// Shortest time limit of a training, seconds: each start reads all images, and Slurm sends TERM three minutes before the limit.
const SHORTEST_S: u64 = 10 * 60;

/// A plan of poses, or of experiments.
pub enum AnyPlan {
    Poses(Box<Plan>),
    Experiments(Box<ExperimentPlan>),
}

impl AnyPlan {
    pub fn read(path: &Path) -> anyhow::Result<Self> {
        Ok(match ExperimentPlan::is_in(path) {
            true => Self::Experiments(Box::new(ExperimentPlan::read(path)?)),
            false => Self::Poses(Box::new(Plan::read(path)?)),
        })
    }

    fn write(&self, path: &Path) -> anyhow::Result<()> {
        match self {
            Self::Poses(plan) => plan.write(path)?,
            Self::Experiments(plan) => plan.write(path)?,
        }
        Ok(())
    }
}

/// The submission of a plan, as it was divided before or is divided now; writes the plan into the folder.
pub fn submission(
    args: &SlurmArgs,
    plan: &AnyPlan,
    folder: &ClusterFolder,
    recorded: Option<Submission>,
) -> anyhow::Result<Submission> {
    let settings = settings(args, recorded.as_ref().map(|recorded| &recorded.settings));
    // Beside its place, since a plan names cases from there.
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
    plan: &AnyPlan,
    copy: &Path,
    folder: &ClusterFolder,
    recorded: Option<Submission>,
    settings: TaskSettings,
) -> anyhow::Result<Submission> {
    let sha256 = sha256_of_file(copy)?;
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
                bundle(work.poses, work.cost, settings.cpus, settings.time)?;
            }
        }
        kept.settings = settings;
        return Ok(kept);
    }
    let known = recorded.filter(|recorded| recorded.plan_sha256 == sha256);
    let work = match plan {
        AnyPlan::Poses(plan) => {
            let known = known.as_ref().map(|known| &known.work);
            Work::Poses(poses(args, plan, folder, known, &settings)?)
        }
        AnyPlan::Experiments(plan) => {
            check_time(&settings)?;
            Work::Trainings(trainings(plan, &args.experiments, folder)?)
        }
    };
    let mut first = Submission::new(args.plan.clone(), sha256, work, settings);
    // Scripts of a dry run are known as such.
    first.scripts = known.map(|known| known.scripts).unwrap_or_default();
    Ok(first)
}

/// A plan in shards, by the time of a pose as it is given, known from a dry run, or measured.
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
    })
}

/// Refuses a time limit within which a task could hardly begin to train.
fn check_time(settings: &TaskSettings) -> anyhow::Result<()> {
    ensure!(
        settings.time.seconds() >= SHORTEST_S,
        "the time limit {} is too short for a training, expected at least {}",
        settings.time,
        TimeLimit::from_seconds(SHORTEST_S)
    );
    Ok(())
}

/// The trainings of the chosen experiments of a plan, all of them if none is chosen, after a look at their data.
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
        gres: or_before(&args.gres, |s| &s.gres),
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
