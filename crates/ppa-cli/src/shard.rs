//! Which shard of a plan this process makes: told by `--shard`, or by what started it.

use std::env;

use anyhow::{Context, bail, ensure};
use ppa_xray::Part;

/// Where a shard was told.
struct Told {
    part: Part,
    by: &'static str,
}

/// The shard of `--shard`, of a Slurm job array, of `mpirun`, or of an indexed Kubernetes job.
///
/// Two that disagree are an error: half of a plan would be made twice, or not at all.
pub fn shard(option: Option<Part>) -> anyhow::Result<Part> {
    shard_told(option, &|name| env::var(name).ok())
}

fn shard_told(
    option: Option<Part>,
    variable: &dyn Fn(&str) -> Option<String>,
) -> anyhow::Result<Part> {
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
        let part = part.with_context(|| format!("{by}: rank {rank} of {count} is no shard"))?;
        anyhow::Ok(Told { part, by })
    };
    let mut told = Vec::new();
    if let Some(part) = option {
        told.push(Told {
            part,
            by: "--shard",
        });
    }
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
        // A list with gaps, such as 1-3,7, leaves it open which of its tasks this is.
        let even = step > 0
            && (first..=last).contains(&id)
            && (id - first) % step == 0
            && (last - first) / step + 1 == count;
        ensure!(
            even,
            "SLURM_ARRAY_TASK_ID is {id} of {count} tasks from {first} to {last} in steps of {step}, which leaves its \
             shard open; give --shard, or --array as a range"
        );
        told.push(part((id - first) / step, count, "SLURM_ARRAY_TASK_ID")?);
    }
    if variable("OMPI_COMM_WORLD_RANK").is_some() {
        let (rank, size) = (
            number("OMPI_COMM_WORLD_RANK")?,
            number("OMPI_COMM_WORLD_SIZE")?,
        );
        told.push(part(rank, size, "OMPI_COMM_WORLD_RANK")?);
    }
    if variable("JOB_COMPLETION_INDEX").is_some() {
        let count = number("JOB_COMPLETIONS").context(
            "JOB_COMPLETION_INDEX is set; set JOB_COMPLETIONS to the job's number of completions",
        )?;
        told.push(part(
            number("JOB_COMPLETION_INDEX")?,
            count,
            "JOB_COMPLETION_INDEX",
        )?);
    }
    match told.as_slice() {
        [] => Ok(Part::WHOLE),
        [first, others @ ..] => match others.iter().find(|other| other.part != first.part) {
            None => Ok(first.part),
            Some(other) => bail!(
                "{} tells shard {}, but {} tells {}; unset one of them",
                first.by,
                first.part,
                other.by,
                other.part
            ),
        },
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn told(option: Option<&str>, variables: &str) -> Result<String, String> {
        let variable = |name: &str| {
            let mut pairs = variables
                .split_whitespace()
                .filter_map(|p| p.split_once('='));
            pairs
                .find(|(key, _)| *key == name)
                .map(|(_, value)| value.to_owned())
        };
        let option = option.map(|text| text.parse().unwrap());
        match shard_told(option, &variable) {
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
        assert_eq!(told(None, ""), Ok("1/1".into()));
        assert_eq!(told(Some("2/7"), ""), Ok("2/7".into()));
        assert_eq!(told(None, &slurm(0, 16, 0, 15, 1)), Ok("1/16".into()));
        assert_eq!(told(None, &slurm(16, 16, 1, 16, 1)), Ok("16/16".into()));
        assert_eq!(told(None, &slurm(7, 4, 1, 10, 3)), Ok("3/4".into()));
        let mpi = "OMPI_COMM_WORLD_RANK=1 OMPI_COMM_WORLD_SIZE=4";
        assert_eq!(told(None, mpi), Ok("2/4".into()));
        let kubernetes = "JOB_COMPLETION_INDEX=2 JOB_COMPLETIONS=3";
        assert_eq!(told(None, kubernetes), Ok("3/3".into()));
        assert_eq!(told(Some("2/4"), mpi), Ok("2/4".into()));
    }

    #[test]
    fn what_leaves_it_open_is_an_error() {
        let mpi = "OMPI_COMM_WORLD_RANK=1 OMPI_COMM_WORLD_SIZE=4";
        for (option, variables, words) in [
            (
                Some("1/4"),
                mpi.to_owned(),
                ["--shard tells shard 1/4", "OMPI"],
            ),
            (
                None,
                format!("{mpi} {}", slurm(1, 4, 1, 4, 1)),
                ["SLURM", "tells 2/4"],
            ),
            (None, slurm(7, 4, 1, 7, 1), ["1 to 7", "--shard"]),
            (
                None,
                slurm(2, 4, 1, 10, 3),
                ["SLURM_ARRAY_TASK_ID is 2", "open"],
            ),
            (None, slurm(1, 4, 1, 4, 0), ["steps of 0", "open"]),
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
            let error = told(option, &variables).unwrap_err();
            for word in words {
                assert!(error.contains(word), "{error}");
            }
        }
    }
}
