//! The text of the job scripts.

use std::fmt::Write;
use std::path::Path;

use crate::error::FolderError;
use crate::folder::{ClusterFolder, DONE, FINISHED, last_name, task_name};
use crate::quote::{shell_quoted, unicode};
use crate::submission::{Submission, TaskSettings, TrainingWork, Work};
use crate::usage::ended_line;

/// The scripts of one folder.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Scripts {
    /// Script of the array: one shard or training a task. Its argument is the number to add to the index of a task.
    pub task: String,
    /// Script of the job that merges and verifies, or writes tables.
    pub last: String,
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
        /// `partition`, `account`, `mem` or `gres`.
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
        let head = head(folder, submission, program)?;
        let (task, last) = match &submission.work {
            Work::Poses(work) => of_poses(work.bundle.shards, submission.settings.cpus),
            Work::Trainings(work) => of_trainings(work, submission.settings.cpus),
        };
        let whole = |parts: Parts, named: &str| {
            let ended = ended_line(submission.settings.cpus);
            let Parts { title, number, run } = parts;
            format!(
                "#!/bin/bash\n\
                 # {title} Written by ppa submit.\n\
                 {head}\n\
                 {number}\
                 echo \"{named}: job $task on $SLURMD_NODENAME, restart ${{SLURM_RESTART_COUNT:-0}}\"\n\
                 trap 'echo \"{ended}\"' EXIT\n\
                 {RUN}\n\
                 {run}"
            )
        };
        let (work, tasks) = (&submission.work, submission.work.tasks());
        Ok(Self {
            task: whole(task, &format!("{} $number of {tasks}", task_name(work))),
            last: whole(last, last_name(work)),
        })
    }
}

/// What differs between scripts.
struct Parts {
    /// What the script does, in a sentence.
    title: String,
    /// Shell variables: the number of the task, and Slurm's name of the job.
    number: &'static str,
    /// The work.
    run: String,
}

/// Variables of a task of the array, and of the last job.
const OF_TASK: &str = "number=$(($1 + SLURM_ARRAY_TASK_ID))\n\
                       task=${SLURM_ARRAY_JOB_ID}_${SLURM_ARRAY_TASK_ID}\n";
const OF_LAST: &str = "task=$SLURM_JOB_ID\n";

/// The scripts of the shards of a plan.
fn of_poses(shards: u64, cpus: u32) -> (Parts, Parts) {
    let task = Parts {
        title: format!("Makes one shard of {shards}: argument 1 plus the index of the task."),
        number: OF_TASK,
        run: format!(
            "# The shard is given: indices of the array are not those of the shards.\n\
             run env -u SLURM_ARRAY_TASK_ID \"$ppa\" --threads {cpus} generate slurm/plan.toml \\\n    \
             --shard \"$number/{shards}\" --out \"shards/$number\" --progress plain\n"
        ),
    };
    let last = Parts {
        title: format!("Merges {shards} shards and verifies the dataset."),
        number: OF_LAST,
        run: format!(
            "# This job starts after all tasks, failed ones included: the merge refuses shards that are missing.\n\
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
             : >{DONE}\n"
        ),
    };
    (task, last)
}

/// The scripts of the trainings of experiments.
fn of_trainings(work: &TrainingWork, cpus: u32) -> (Parts, Parts) {
    let all = work.trainings().count();
    let mut choice = String::new();
    let mut before = 0;
    for one in &work.experiments {
        let (experiment, count) = (&one.experiment, one.trainings.len());
        let word = if before == 0 { "if" } else { "elif" };
        let _ = write!(
            choice,
            "{word} [ \"$number\" -le {} ]; then\n    \
             experiment={experiment} part=$((number - {before}))/{count}\n",
            before + count
        );
        before += count;
    }
    let task = Parts {
        title: format!("Makes one training of {all}: argument 1 plus the index of the task."),
        number: OF_TASK,
        run: format!(
            "{choice}fi\n\
             # A training that others need is made by the first of them; the others wait for it.\n\
             run env -u SLURM_ARRAY_TASK_ID \"$ppa\" --threads {cpus} experiment \"$experiment\" slurm/plan.toml \\\n    \
             --shard \"$part\" --out runs\n"
        ),
    };
    let needed = work.needed.iter().map(String::as_str);
    let folders: Vec<&str> = needed.chain(work.trainings()).collect();
    let count = folders.len();
    let folders: String = folders.iter().map(|name| format!("{name}\n")).collect();
    let names = work.experiments.iter().map(|one| one.experiment.as_str());
    let names = names.collect::<Vec<_>>().join(" ");
    let last = Parts {
        title: format!("Writes the tables of {all} trainings."),
        number: OF_LAST,
        run: format!(
            "# This job starts after all tasks, failed ones included. It trains nothing itself.\n\
             missing=()\n\
             while read -r training; do\n    \
             [ -f \"runs/$training/{FINISHED}\" ] || missing+=(\"$training\")\n\
             done <<'END'\n\
             {folders}END\n\
             if [ ${{#missing[@]}} -gt 0 ]; then\n    \
             echo \"no tables: ${{#missing[@]}} of {count} trainings are not finished, such as ${{missing[0]}}\"\n    \
             exit 1\n\
             fi\n\
             for experiment in {names}; do\n    \
             run \"$ppa\" --threads {cpus} experiment \"$experiment\" slurm/plan.toml --out runs --replace\n\
             done\n\
             run \"$ppa\" --threads {cpus} experiment report slurm/plan.toml --runs runs --out experiments.html --replace\n\
             : >{DONE}\n"
        ),
    };
    (task, last)
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
        gres,
        max_tasks: _,
        setup,
    } = &submission.settings;
    let mut text = String::new();
    let mut request = |what: String| {
        let _ = writeln!(text, "#SBATCH --{what}");
    };
    request(format!("job-name={}", folder.job_name()));
    for (option, value) in [
        ("partition", partition),
        ("account", account),
        ("mem", mem),
        ("gres", gres),
    ] {
        if let Some(value) = value {
            request(format!("{option}={}", word(option, value)?));
        }
    }
    request(format!("time={time}"));
    request("nodes=1".to_owned());
    request("ntasks=1".to_owned());
    request(format!("cpus-per-task={cpus}"));
    // Only to the script, which passes it on.
    request(format!("signal=B:TERM@{}", submission.work.warning_s()));
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
        "\n# An edited plan makes results that do not fit together.\n\
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
# Runs a command. TERM, which Slurm sends before the time limit, is passed on once: ppa finishes the poses or the step in progress.
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
    use crate::submission::tests::{submission, trainings};

    fn folder(name: &str) -> (tempfile::TempDir, ClusterFolder) {
        let above = tempfile::tempdir().unwrap();
        let folder = ClusterFolder::create(&above.path().join(name)).unwrap();
        (above, folder)
    }

    #[test]
    fn settings_stand_as_requests_in_both_scripts() {
        let (_above, folder) = folder("jobs");
        let scripts = Scripts::new(&folder, &submission(), Path::new("/opt/ppa")).unwrap();
        for script in [&scripts.task, &scripts.last] {
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
        assert!(scripts.task.contains("--shard \"$number/2\""));
    }

    #[test]
    fn each_task_makes_its_training() {
        let (_above, folder) = folder("jobs");
        let scripts = Scripts::new(&folder, &trainings(), Path::new("ppa")).unwrap();
        assert!(scripts.task.contains("#SBATCH --gres=gpu:1\n"));
        let from = scripts.task.find("if [ \"$number\"").unwrap();
        let choice = scripts.task[from..].split_inclusive("\nfi\n").next();
        let choice = choice.unwrap();
        for (number, expected) in [(1, "1 1/2"), (2, "1 2/2"), (3, "2a 1/1")] {
            let script =
                format!("number={number}\n{choice}printf '%s %s' \"$experiment\" \"$part\"");
            let said = Command::new("bash").args(["-c", &script]).output().unwrap();
            assert_eq!(String::from_utf8(said.stdout).unwrap(), expected);
        }
        // The one that they need counts as well.
        let last = &scripts.last;
        assert!(last.contains("<<'END'\np\na\nb\nc\nEND\n"), "{last}");
    }

    #[test]
    fn bash_accepts_scripts_of_paths_with_spaces() {
        let (_above, folder) = folder("two words, it's $HOME");
        let program = Path::new("/opt/my programs/ppa's");
        let of = |submission: &Submission| Scripts::new(&folder, submission, program).unwrap();
        let [poses, trainings] = [of(&submission()), of(&trainings())];
        for script in [poses.task, poses.last, trainings.task, trainings.last] {
            // As far as the program is named, then what was read.
            let head = script.split("module load").next().unwrap();
            let script_file = folder.slurm().join("test.sh");
            fs::write(&script_file, &script).unwrap();
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
