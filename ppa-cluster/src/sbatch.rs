//! The commands that submit the scripts of a folder.

use std::fmt;

use crate::array::{ArrayChunk, index_list};
use crate::error::FolderError;
use crate::folder::ClusterFolder;
use crate::logs::log_pattern;
use crate::queue::JobKind;
use crate::quote::{shell_quoted, unicode};
use crate::submission::{Submission, Work};

/// One call of `sbatch`; displayed as a shell command.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct SbatchCommand {
    arguments: Vec<String>,
    /// The script and its arguments.
    script: Vec<String>,
}

impl SbatchCommand {
    /// Delays the job until others have succeeded or failed; `after` holds their identifiers, which the script gets as its last argument,
    /// separated by commas.
    #[must_use]
    pub fn after(mut self, after: &[String]) -> Self {
        if !after.is_empty() {
            self.arguments
                .push(format!("--dependency=afterany:{}", after.join(":")));
            // A job whose dependency cannot be met would wait for ever.
            self.arguments.push("--kill-on-invalid-dep=yes".to_owned());
            self.script.push(after.join(","));
        }
        self
    }

    /// Arguments of `sbatch`.
    pub fn arguments(&self) -> impl Iterator<Item = &str> {
        let all = self.arguments.iter().chain(&self.script);
        all.map(String::as_str)
    }
}

impl fmt::Display for SbatchCommand {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("sbatch")?;
        for argument in self.arguments() {
            write!(f, " {}", shell_quoted(argument))?;
        }
        Ok(())
    }
}

/// Returns the commands that submit chunks of tasks, one per chunk; at most `max_tasks` tasks of a chunk run at a time.
///
/// # Errors
/// [`FolderError::NotUnicode`].
pub fn task_commands(
    folder: &ClusterFolder,
    submission: &Submission,
    chunks: &[ArrayChunk],
) -> Result<Vec<SbatchCommand>, FolderError> {
    let script = folder.task_script(&submission.work);
    let script = unicode(&script)?;
    let max_tasks = submission.settings.max_tasks;
    let command = |chunk: &ArrayChunk| {
        let most = max_tasks.map_or(String::new(), |most| format!("%{most}"));
        let array = format!("--array={}{most}", index_list(&chunk.indices));
        let mut command = command(
            folder,
            Some(chunk.offset),
            &log_pattern(&submission.work, chunk.offset),
        )?;
        command.arguments.push(array);
        command.script = vec![script.to_owned(), chunk.offset.to_string()];
        Ok(command)
    };
    chunks.iter().map(command).collect()
}

/// The command that submits the last job, the merge or the tables.
///
/// # Errors
/// [`FolderError::NotUnicode`].
pub fn last_command(folder: &ClusterFolder, work: &Work) -> Result<SbatchCommand, FolderError> {
    let script = folder.last_script(work);
    let mut command = command(folder, None, &format!("{}.log", work.last_name()))?;
    command.script = vec![unicode(&script)?.to_owned()];
    Ok(command)
}

fn command(
    folder: &ClusterFolder,
    offset: Option<u64>,
    log: &str,
) -> Result<SbatchCommand, FolderError> {
    Ok(SbatchCommand {
        arguments: vec![
            "--parsable".to_owned(),
            format!("--chdir={}", unicode(folder.root())?),
            format!("--comment={}", JobKind::comment(offset)),
            // Relative to the folder, since Slurm replaces % patterns in the full path.
            format!("--output=slurm/logs/{log}"),
        ],
        script: Vec::new(),
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::array::split;
    use crate::submission::tests::{submission, trainings};

    #[test]
    fn chunks_of_shards_are_arrays_with_their_offset() {
        let above = tempfile::tempdir().unwrap();
        let folder = ClusterFolder::create(&above.path().join("a b")).unwrap();
        let chunks = split(&[1, 2, 3, 5, 1001], 1001);
        let mut submission = submission();
        submission.settings.max_tasks = Some(4);
        let commands = task_commands(&folder, &submission, &chunks).unwrap();
        let said: Vec<_> = commands.iter().map(ToString::to_string).collect();
        assert_eq!(said.len(), 2);
        let root = folder.root().display();
        for part in [
            "sbatch --parsable ",
            &format!("'--chdir={root}'"),
            "'--comment=shards 0'",
            "--output=slurm/logs/shard_%a.log",
            "--array=1-3,5%4",
            &format!("'{root}/slurm/shard.sh' 0"),
        ] {
            assert!(said[0].contains(part), "{part}: {}", said[0]);
        }
        assert!(
            said[1].contains("shard_1000+%a.log --array=1%4"),
            "{}",
            said[1]
        );
        assert!(said[1].ends_with("shard.sh' 1000"), "{}", said[1]);
    }

    #[test]
    fn the_merge_waits_for_all_arrays() {
        let above = tempfile::tempdir().unwrap();
        let folder = ClusterFolder::create(&above.path().join("ab")).unwrap();
        let tables = last_command(&folder, &trainings().work).unwrap();
        assert!(tables.to_string().ends_with("slurm/tables.sh"), "{tables}");
        let merge = last_command(&folder, &submission().work).unwrap();
        assert!(!merge.to_string().contains("dependency"));
        let after = merge.after(&["7".to_owned(), "9".to_owned()]).to_string();
        assert!(
            after.contains("--dependency=afterany:7:9 --kill-on-invalid-dep=yes"),
            "{after}"
        );
        assert!(after.ends_with("slurm/merge.sh 7,9"), "{after}");
    }
}
