//! The programs of Slurm.

use std::io;
use std::process::Command;

use crate::error::SlurmError;
use crate::limits::max_array_size;
use crate::queue::{FORMAT, QueuedJob, parse_queue};
use crate::sbatch::SbatchCommand;

/// Slurm, through its programs in PATH.
#[derive(Debug, Clone, Copy)]
pub struct Slurm;

impl Slurm {
    /// MaxArraySize of the cluster.
    ///
    /// # Errors
    /// [`SlurmError`], for example if Slurm is not installed.
    pub fn max_array_size(self) -> Result<u64, SlurmError> {
        max_array_size(&output("scontrol", &["show", "config"])?)
    }

    /// Returns all waiting and running jobs of a name.
    ///
    /// # Errors
    /// [`SlurmError`].
    pub fn queue(self, name: &str) -> Result<Vec<QueuedJob>, SlurmError> {
        let format = format!("--format={FORMAT}");
        let name = format!("--name={name}");
        parse_queue(&output(
            "squeue",
            &["--noheader", "--array", &name, &format],
        )?)
    }

    /// Lets Slurm check a job without queueing it: partition, account, limits.
    ///
    /// # Errors
    /// [`SlurmError::Refused`] with Slurm's reason.
    pub fn check(self, command: &SbatchCommand) -> Result<(), SlurmError> {
        let arguments: Vec<_> = ["--test-only"]
            .into_iter()
            .chain(command.arguments())
            .collect();
        output("sbatch", &arguments).map(|_| ())
    }

    /// Queues a job and returns its identifier.
    ///
    /// # Errors
    /// [`SlurmError`].
    pub fn submit(self, command: &SbatchCommand) -> Result<String, SlurmError> {
        let arguments: Vec<_> = command.arguments().collect();
        job_id(&output("sbatch", &arguments)?)
    }

    /// Cancels jobs by their identifiers.
    ///
    /// # Errors
    /// [`SlurmError`].
    pub fn cancel(self, ids: &[&str]) -> Result<(), SlurmError> {
        output("scancel", ids).map(|_| ())
    }
}

/// Reads the number that `sbatch --parsable` prints, followed by the cluster's name if there are several.
fn job_id(said: &str) -> Result<String, SlurmError> {
    let id = said.trim().split(';').next().unwrap_or_default();
    if id.is_empty() || !id.bytes().all(|byte| byte.is_ascii_digit()) {
        return Err(SlurmError::Answer {
            program: "sbatch",
            found: said.trim().to_owned(),
            expected: "the number of a job",
        });
    }
    Ok(id.to_owned())
}

fn output(program: &'static str, arguments: &[&str]) -> Result<String, SlurmError> {
    let output = Command::new(program).args(arguments).output();
    let output = output.map_err(|source| match source.kind() {
        io::ErrorKind::NotFound => SlurmError::NotInstalled { program },
        _ => SlurmError::Run { program, source },
    })?;
    if !output.status.success() {
        return Err(SlurmError::Refused {
            program,
            said: in_one_line(&output.stderr, &output.stdout, output.status),
        });
    }
    Ok(String::from_utf8_lossy(&output.stdout).into_owned())
}

/// The output of a failed program, with its lines joined.
fn in_one_line(stderr: &[u8], stdout: &[u8], status: std::process::ExitStatus) -> String {
    for said in [stderr, stdout] {
        let said = String::from_utf8_lossy(said);
        let lines = said.lines().map(str::trim).filter(|line| !line.is_empty());
        let text = lines.collect::<Vec<_>>().join("; ");
        if !text.is_empty() {
            return text;
        }
    }
    status.to_string()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_number_of_a_job_is_read() {
        assert_eq!(job_id("4711\n").unwrap(), "4711");
        assert_eq!(job_id("4711;north\n").unwrap(), "4711");
        for bad in ["", "Submitted batch job 4711", ";north"] {
            assert!(job_id(bad).is_err(), "{bad}");
        }
    }

    #[test]
    fn a_missing_program_is_no_slurm() {
        let said = output("no-such-program-of-slurm", &[]).unwrap_err();
        assert!(
            said.to_string().contains("not installed on this machine"),
            "{said}"
        );
    }

    #[cfg(unix)]
    #[test]
    fn a_refusal_is_one_line() {
        let said = output("sh", &["-c", "echo one >&2; echo two >&2; exit 1"]).unwrap_err();
        assert_eq!(said.to_string(), "sh failed: one; two");
        let said = output("sh", &["-c", "exit 3"]).unwrap_err().to_string();
        assert!(said.contains('3'), "{said}");
    }
}
