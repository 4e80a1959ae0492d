//! The shard that this process generates: from `--shard`, or from the environment of a scheduler.

use std::env;

use anyhow::{Context, bail};
use ppa_core::Part;

/// A shard and what named it.
struct Named {
    part: Part,
    by: &'static str,
}

/// The shard of a plan that a process is to make.
#[derive(Debug)]
pub enum ShardRequest {
    /// This shard.
    Part(Part),
    /// The shard of a task in a Slurm array that does not cover all shards, as when a task is run again.
    Task {
        /// Number of the task.
        id: u64,
        /// Description of the task in the environment.
        named: String,
    },
}

impl ShardRequest {
    /// Returns the part; `held` is that of its output folder, if the folder was started.
    pub fn part(
        &self,
        held: impl FnOnce() -> anyhow::Result<Option<Part>>,
    ) -> anyhow::Result<Part> {
        match self {
            Self::Part(part) => Ok(*part),
            Self::Task { id, named } => match held()? {
                // Arrays count from 0 or from 1.
                Some(part) if part != Part::WHOLE && [id + 1, *id].contains(&part.index()) => {
                    Ok(part)
                }
                Some(part) if part != Part::WHOLE => {
                    bail!("{named}, which is not shard {part} that the folder holds; give --shard")
                }
                _ => bail!(
                    "{named}, which does not determine the shard; give --shard, or run the whole array from 0 or 1 on"
                ),
            },
        }
    }
}

/// The shard of `--shard`, of a Slurm job array or job step, of `mpirun`, or of an indexed Kubernetes job.
///
/// Two that disagree are an error: otherwise half of a plan could be made twice, or not at all.
pub fn shard(option: Option<Part>) -> anyhow::Result<ShardRequest> {
    shard_named(option, &|name| env::var(name).ok())
}

fn shard_named(
    option: Option<Part>,
    variable: &dyn Fn(&str) -> Option<String>,
) -> anyhow::Result<ShardRequest> {
    let number = |name: &str| {
        let text = variable(name).with_context(|| format!("{name} is not set"))?;
        let number: u64 = text
            .trim()
            .parse()
            .with_context(|| format!("{name} is {text:?}, expected a whole number"))?;
        anyhow::Ok(number)
    };
    let part = |rank: u64, count: u64, by: &'static str| {
        let part = rank.checked_add(1).map(|k| format!("{k}/{count}"));
        let part = part.and_then(|text| text.parse().ok());
        let part =
            part.with_context(|| format!("{by}: rank {rank} of {count} is not a valid shard"))?;
        anyhow::Ok(Named { part, by })
    };
    let mut named = Vec::new();
    if let Some(part) = option {
        named.push(Named {
            part,
            by: "--shard",
        });
    }
    let mut task = None;
    if variable("SLURM_ARRAY_TASK_ID").is_some() {
        let (id, count) = (
            number("SLURM_ARRAY_TASK_ID")?,
            number("SLURM_ARRAY_TASK_COUNT")?,
        );
        let (first, last) = (
            number("SLURM_ARRAY_TASK_MIN")?,
            number("SLURM_ARRAY_TASK_MAX")?,
        );
        let step = number("SLURM_ARRAY_TASK_STEP")?;
        let even = step > 0
            && (first..=last).contains(&id)
            && (id - first) % step == 0
            && (last - first) / step + 1 == count;
        // A list with gaps does not determine the shard, and a single task or a range that begins later looks like repeated
        // tasks of a larger array.
        if even && count > 1 && first <= 1 {
            named.push(part((id - first) / step, count, "SLURM_ARRAY_TASK_ID")?);
        } else {
            let named = format!(
                "SLURM_ARRAY_TASK_ID is {id} in an array of {count} (from {first} to {last} in steps of {step})"
            );
            task = Some(ShardRequest::Task { id, named });
        }
    }
    // Processes of mpirun inherit the Slurm step that started mpirun's daemons, which is not their own.
    if variable("OMPI_COMM_WORLD_RANK").is_none() && variable("SLURM_STEP_ID").is_some() {
        let count = match variable("SLURM_STEP_NUM_TASKS") {
            Some(_) => number("SLURM_STEP_NUM_TASKS")?,
            None => number("SLURM_NTASKS")?,
        };
        if number("SLURM_STEP_ID")? < FIRST_SPECIAL_STEP && count > 1 {
            named.push(part(number("SLURM_PROCID")?, count, "SLURM_PROCID")?);
        }
    }
    if variable("OMPI_COMM_WORLD_RANK").is_some() {
        let (rank, size) = (
            number("OMPI_COMM_WORLD_RANK")?,
            number("OMPI_COMM_WORLD_SIZE")?,
        );
        named.push(part(rank, size, "OMPI_COMM_WORLD_RANK")?);
    }
    if variable("JOB_COMPLETION_INDEX").is_some() {
        let count = number("JOB_COMPLETIONS").context(
            "JOB_COMPLETION_INDEX is set; set JOB_COMPLETIONS to the job's number of completions",
        )?;
        named.push(part(
            number("JOB_COMPLETION_INDEX")?,
            count,
            "JOB_COMPLETION_INDEX",
        )?);
    }
    if let (Some(task), None) = (task, option) {
        if let (ShardRequest::Task { named: array, .. }, Some(other)) = (&task, named.first()) {
            bail!(
                "{array}, and {} means shard {}; give --shard and unset one of them",
                other.by,
                other.part
            );
        }
        return Ok(task);
    }
    match named.as_slice() {
        [] => Ok(ShardRequest::Part(Part::WHOLE)),
        [first, others @ ..] => match others.iter().find(|other| other.part != first.part) {
            None => Ok(ShardRequest::Part(first.part)),
            Some(other) => bail!(
                "{} means shard {}, but {} means {}; unset one of them",
                first.by,
                first.part,
                other.by,
                other.part
            ),
        },
    }
}

/// First number of Slurm steps that `srun` did not start: batch scripts, interactive steps, external processes.
const FIRST_SPECIAL_STEP: u64 = 0xffff_fff0;

#[cfg(test)]
mod tests {
    use super::*;

    fn named(option: Option<&str>, variables: &str) -> Result<String, String> {
        named_in(None, option, variables)
    }

    /// The part for a folder that already holds a part.
    fn named_in(
        held: Option<&str>,
        option: Option<&str>,
        variables: &str,
    ) -> Result<String, String> {
        let variable = |name: &str| {
            let mut pairs = variables
                .split_whitespace()
                .filter_map(|p| p.split_once('='));
            pairs
                .find(|(key, _)| *key == name)
                .map(|(_, value)| value.to_owned())
        };
        let option = option.map(|text| text.parse().unwrap());
        let held = || Ok(held.map(|text| text.parse().unwrap()));
        match shard_named(option, &variable).and_then(|request| request.part(held)) {
            Ok(part) => Ok(part.to_string()),
            Err(error) => Err(format!("{error:#}")),
        }
    }

    fn slurm(id: u32, count: u32, min: u32, max: u32, step: u32) -> String {
        format!(
            "SLURM_ARRAY_TASK_ID={id} SLURM_ARRAY_TASK_COUNT={count} SLURM_ARRAY_TASK_MIN={min} \
             SLURM_ARRAY_TASK_MAX={max} SLURM_ARRAY_TASK_STEP={step}"
        )
    }

    #[test]
    fn the_shard_follows_from_option_or_environment() {
        assert_eq!(named(None, ""), Ok("1/1".into()));
        assert_eq!(named(Some("2/7"), ""), Ok("2/7".into()));
        assert_eq!(named(None, &slurm(0, 16, 0, 15, 1)), Ok("1/16".into()));
        assert_eq!(named(None, &slurm(16, 16, 1, 16, 1)), Ok("16/16".into()));
        assert_eq!(named(None, &slurm(7, 4, 1, 10, 3)), Ok("3/4".into()));
        let mpi = "OMPI_COMM_WORLD_RANK=1 OMPI_COMM_WORLD_SIZE=4";
        assert_eq!(named(None, mpi), Ok("2/4".into()));
        let kubernetes = "JOB_COMPLETION_INDEX=2 JOB_COMPLETIONS=3";
        assert_eq!(named(None, kubernetes), Ok("3/3".into()));
        assert_eq!(named(Some("2/4"), mpi), Ok("2/4".into()));
    }

    #[test]
    fn a_task_run_again_takes_the_shard_of_its_folder() {
        let again = slurm(2, 1, 2, 2, 1);
        for variables in [
            &again,
            &slurm(1, 1, 1, 1, 1),
            &slurm(0, 1, 0, 0, 1),
            &slurm(3, 2, 2, 3, 1),
        ] {
            for held in [None, Some("1/1")] {
                let refused = named_in(held, None, variables).unwrap_err();
                assert!(
                    refused.contains("does not determine the shard; give --shard"),
                    "{refused}"
                );
            }
        }
        // Arrays that count from 1, and from 0.
        assert_eq!(named_in(Some("2/7"), None, &again), Ok("2/7".into()));
        assert_eq!(named_in(Some("3/7"), None, &again), Ok("3/7".into()));
        assert_eq!(
            named_in(Some("1/7"), None, &slurm(0, 1, 0, 0, 1)),
            Ok("1/7".into())
        );
        let refused = named_in(Some("5/7"), None, &again).unwrap_err();
        assert!(refused.contains("not shard 5/7"), "{refused}");
        assert_eq!(named_in(Some("5/7"), Some("4/7"), &again), Ok("4/7".into()));
    }

    #[test]
    fn each_task_of_a_job_step_makes_a_shard() {
        let step =
            |rank: u32, id: u64| format!("SLURM_STEP_ID={id} SLURM_PROCID={rank} SLURM_NTASKS=3");
        assert_eq!(named(None, &step(0, 0)), Ok("1/3".into()));
        assert_eq!(named(None, &step(2, 4)), Ok("3/3".into()));
        // A step with fewer tasks than its job.
        let fewer = format!("{} SLURM_STEP_NUM_TASKS=2", step(1, 0));
        assert_eq!(named(None, &fewer), Ok("2/2".into()));
        let one = format!("{} SLURM_STEP_NUM_TASKS=1", step(0, 0));
        assert_eq!(named(None, &one), Ok("1/1".into()));
        // A batch script is not a task of a step.
        assert_eq!(
            named(None, "SLURM_PROCID=0 SLURM_NTASKS=3"),
            Ok("1/1".into())
        );
        assert_eq!(named(None, &step(0, 0xffff_fffb)), Ok("1/1".into()));
        // Under mpirun the step belongs to its daemons.
        let mpi = format!(
            "{} OMPI_COMM_WORLD_RANK=4 OMPI_COMM_WORLD_SIZE=8",
            step(1, 0)
        );
        assert_eq!(named(None, &mpi), Ok("5/8".into()));
        // One task within each task of an array.
        let array = format!("{} {one}", slurm(5, 7, 1, 7, 1));
        assert_eq!(named(None, &array), Ok("5/7".into()));
        let refused = named(None, &format!("{} {}", slurm(5, 7, 1, 7, 1), step(0, 0))).unwrap_err();
        assert!(
            refused.contains("means shard 5/7, but SLURM_PROCID means 1/3"),
            "{refused}"
        );
        let refused = named(None, &format!("{} {}", slurm(2, 1, 2, 2, 1), step(0, 0))).unwrap_err();
        assert!(
            refused.contains("SLURM_PROCID means shard 1/3"),
            "{refused}"
        );
        let refused = named(Some("2/7"), &step(0, 0)).unwrap_err();
        assert!(refused.contains("--shard means shard 2/7"), "{refused}");
    }

    #[test]
    fn what_leaves_it_open_is_an_error() {
        let mpi = "OMPI_COMM_WORLD_RANK=1 OMPI_COMM_WORLD_SIZE=4";
        for (option, variables, words) in [
            (
                Some("1/4"),
                mpi.to_owned(),
                ["--shard means shard 1/4", "OMPI"],
            ),
            (
                None,
                format!("{mpi} {}", slurm(1, 4, 1, 4, 1)),
                ["SLURM", "means 2/4"],
            ),
            (None, slurm(7, 4, 1, 7, 1), ["1 to 7", "--shard"]),
            (
                None,
                slurm(2, 4, 1, 10, 3),
                ["SLURM_ARRAY_TASK_ID is 2", "does not determine"],
            ),
            (
                None,
                slurm(1, 4, 1, 4, 0),
                ["steps of 0", "does not determine"],
            ),
            (
                None,
                "SLURM_ARRAY_TASK_ID=3".into(),
                ["SLURM_ARRAY_TASK_COUNT", "not set"],
            ),
            (
                None,
                "OMPI_COMM_WORLD_RANK=4 OMPI_COMM_WORLD_SIZE=4".into(),
                ["rank 4", "4"],
            ),
            (
                None,
                "OMPI_COMM_WORLD_RANK=x OMPI_COMM_WORLD_SIZE=4".into(),
                ["\"x\"", "whole number"],
            ),
            (
                None,
                "JOB_COMPLETION_INDEX=2".into(),
                ["JOB_COMPLETIONS", "not set"],
            ),
        ] {
            let error = named(option, &variables).unwrap_err();
            for word in words {
                assert!(error.contains(word), "{error}");
            }
        }
    }
}
