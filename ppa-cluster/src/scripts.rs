//! The text of the job scripts.

use std::fmt::Write;
use std::path::Path;

use crate::error::FolderError;
use crate::folder::{ClusterFolder, VERIFIED};
use crate::quote::{shell_quoted, unicode};
use crate::submission::{Submission, TaskSettings};
use crate::usage::ended_line;

/// The scripts of one folder.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Scripts {
    /// Script of the array: one shard a task. Its argument is the number to add to the index of a task.
    pub shard: String,
    /// Script of the job that merges and verifies.
    pub merge: String,
}

/// Why no script can be written.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum ScriptError {
    /// A setting that would not be one word of an `#SBATCH` line.
    #[error(
        "--{option} is \"{found}\", expected a name without spaces, quotes or other special characters"
    )]
    Word {
        /// `partition`, `account` or `mem`.
        option: &'static str,
        /// What was given.
        found: String,
    },
    /// A path that cannot stand in a script.
    #[error(transparent)]
    Path(#[from] FolderError),
}

impl Scripts {
    /// The scripts of a submission; `program` is the ppa that the jobs run.
    ///
    /// # Errors
    /// [`ScriptError`] for settings and paths that a script cannot hold.
    pub fn new(
        folder: &ClusterFolder,
        submission: &Submission,
        program: &Path,
    ) -> Result<Self, ScriptError> {
        let shards = submission.bundle.shards;
        let head = head(folder, submission, program)?;
        let cpus = submission.settings.cpus;
        let ended = ended_line(cpus);
        let shard = format!(
            "#!/bin/bash\n\
             # Makes one shard of {shards}: argument 1 plus the index of the task. Written by ppa submit.\n\
             {head}\n\
             shard=$(($1 + SLURM_ARRAY_TASK_ID))\n\
             task=${{SLURM_ARRAY_JOB_ID}}_${{SLURM_ARRAY_TASK_ID}}\n\
             echo \"shard $shard of {shards}: job $task on $SLURMD_NODENAME, restart ${{SLURM_RESTART_COUNT:-0}}\"\n\
             trap 'echo \"{ended}\"' EXIT\n\
             {RUN}\n\
             # The shard is given: indices of the array are not those of the shards.\n\
             run env -u SLURM_ARRAY_TASK_ID \"$ppa\" --threads {cpus} generate slurm/plan.toml \\\n    \
             --shard \"$shard/{shards}\" --out \"shards/$shard\" --progress plain\n"
        );
        let merge = format!(
            "#!/bin/bash\n\
             # Merges {shards} shards and verifies the dataset. Written by ppa submit.\n\
             {head}\n\
             task=$SLURM_JOB_ID\n\
             echo \"merge: job $task on $SLURMD_NODENAME, restart ${{SLURM_RESTART_COUNT:-0}}\"\n\
             trap 'echo \"{ended}\"' EXIT\n\
             {RUN}\n\
             # This job starts after all tasks, failed ones included: the merge refuses shards that are missing.\n\
             missing=\n\
             shards=()\n\
             for ((shard = 1; shard <= {shards}; shard++)); do\n    \
             [ -d \"shards/$shard/.ppa\" ] || missing+=\" $shard\"\n    \
             shards+=(\"shards/$shard\")\n\
             done\n\
             if [ -n \"$missing\" ]; then\n    \
             echo \"no dataset: these shards were never begun:$missing\"\n    \
             exit 1\n\
             fi\n\
             run \"$ppa\" --threads {cpus} merge \"${{shards[@]}}\" --out dataset --progress plain\n\
             run \"$ppa\" --threads {cpus} verify dataset --plan slurm/plan.toml --progress plain\n\
             : >{VERIFIED}\n"
        );
        Ok(Self { shard, merge })
    }
}

/// What both scripts begin with: requests to Slurm, folder, program, setup and the check of the plan.
fn head(
    folder: &ClusterFolder,
    submission: &Submission,
    program: &Path,
) -> Result<String, ScriptError> {
    let TaskSettings {
        partition,
        account,
        time,
        cpus,
        mem,
        max_tasks: _,
        setup,
    } = &submission.settings;
    let mut text = String::new();
    let mut request = |what: String| {
        let _ = writeln!(text, "#SBATCH --{what}");
    };
    request(format!("job-name={}", folder.job_name()));
    for (option, value) in [("partition", partition), ("account", account), ("mem", mem)] {
        if let Some(value) = value {
            request(format!("{option}={}", word(option, value)?));
        }
    }
    request(format!("time={time}"));
    request("nodes=1".to_owned());
    request("ntasks=1".to_owned());
    request(format!("cpus-per-task={cpus}"));
    // Only to the script, which passes it on.
    request(format!("signal=B:TERM@{}", submission.bundle.warning_s));
    request("requeue".to_owned());
    request("open-mode=append".to_owned());
    let root = shell_quoted(unicode(folder.root())?);
    let program = shell_quoted(unicode(program)?);
    let _ = write!(text, "\ncd {root} || exit 1\nppa={program}\n");
    if let Some(setup) = setup {
        let _ = writeln!(text, "{}", setup.trim_end());
    }
    let _ = write!(
        text,
        "\n# An edited plan makes shards that do not fit together.\n\
         echo '{}  slurm/plan.toml' | sha256sum --check --quiet || exit 1\n",
        submission.plan_sha256
    );
    Ok(text)
}

/// A value that Slurm reads as one word.
fn word<'a>(option: &'static str, value: &'a str) -> Result<&'a str, ScriptError> {
    let is_plain = |c: char| c.is_alphanumeric() || "_-.,:+@=".contains(c);
    if value.is_empty() || !value.chars().all(is_plain) {
        return Err(ScriptError::Word {
            option,
            found: value.to_owned(),
        });
    }
    Ok(value)
}

/// Functions of both scripts. A job that its time limit stops again and again, as one that finishes no pose, ends after 20 restarts.
const RUN: &str = r#"
# Runs a command. TERM, which Slurm sends before the time limit, is passed on once: ppa finishes the poses in progress.
run() {
    stopped=
    trap '[ -n "$stopped" ] || kill -TERM "$child" 2>/dev/null; stopped=1' TERM
    "$@" &
    child=$!
    # A signal ends wait, but not the command.
    while
        wait "$child"
        code=$?
        kill -0 "$child" 2>/dev/null
    do :; done
    [ "$code" -ne 0 ] || return 0
    [ -z "$stopped" ] || queue_again
    exit "$code"
}

# Puts the job back into the queue, unless it was cancelled.
queue_again() {
    state=$(squeue --noheader --jobs="$task" --format=%T)
    if [ "$state" != RUNNING ]; then
        echo "stopped; the job is not queued again, since its state is ${state:-unknown}"
    elif [ "${SLURM_RESTART_COUNT:-0}" -ge 20 ]; then
        echo "stopped before the time limit for the 21st time: give more --time to ppa submit"
    else
        echo "stopped before the time limit; the job is queued again and goes on where it stopped"
        trap '' TERM
        scontrol requeue "$task"
    fi
}
"#;

#[cfg(test)]
mod tests {
    use std::fs;
    use std::process::Command;

    use super::*;
    use crate::submission::tests::submission;

    fn folder(name: &str) -> (tempfile::TempDir, ClusterFolder) {
        let above = tempfile::tempdir().unwrap();
        let folder = ClusterFolder::create(&above.path().join(name)).unwrap();
        (above, folder)
    }

    #[test]
    fn settings_stand_as_requests_in_both_scripts() {
        let (_above, folder) = folder("jobs");
        let scripts = Scripts::new(&folder, &submission(), Path::new("/opt/ppa")).unwrap();
        for script in [&scripts.shard, &scripts.merge] {
            for line in [
                "#SBATCH --partition=main",
                "#SBATCH --mem=4G",
                "#SBATCH --time=02:00:00",
                "#SBATCH --cpus-per-task=2",
                "#SBATCH --signal=B:TERM@2461",
                "#SBATCH --requeue",
                "ppa=/opt/ppa",
                "module load ppa",
            ] {
                assert!(script.lines().any(|l| l == line), "{line}: {script}");
            }
            assert!(!script.contains("--account"));
        }
        assert!(scripts.shard.contains("--shard \"$shard/2\""));
    }

    #[test]
    fn bash_accepts_scripts_of_paths_with_spaces() {
        let (_above, folder) = folder("two words, it's $HOME");
        let program = Path::new("/opt/my programs/ppa's");
        let scripts = Scripts::new(&folder, &submission(), program).unwrap();
        for script in [&scripts.shard, &scripts.merge] {
            // As far as the program is named, then what was read.
            let head = script.split("module load").next().unwrap();
            let script_file = folder.slurm().join("test.sh");
            fs::write(&script_file, script).unwrap();
            let checked = Command::new("bash").arg("-n").arg(&script_file).output();
            let checked = checked.unwrap();
            assert!(checked.status.success(), "{checked:?}");
            let read = format!("{head}printf '%s|%s' \"$PWD\" \"$ppa\"");
            let read = Command::new("bash").args(["-c", &read]).output().unwrap();
            assert_eq!(
                String::from_utf8(read.stdout).unwrap(),
                format!("{}|{}", folder.root().display(), program.display())
            );
        }
    }

    #[test]
    fn a_setting_of_two_words_is_refused() {
        let (_above, folder) = folder("jobs");
        for bad in ["two words", "a\nb", "", "x;y", "$x"] {
            let mut submission = submission();
            submission.settings.partition = Some(bad.to_owned());
            let refused = Scripts::new(&folder, &submission, Path::new("ppa")).unwrap_err();
            assert!(
                refused.to_string().starts_with("--partition is"),
                "{refused}"
            );
        }
    }
}
