//! The text of the job scripts.

use std::fmt::Write;
use std::path::Path;

use crate::error::FolderError;
use crate::folder::ClusterFolder;
use crate::quote::{shell_quoted, unicode};
use crate::script_body::{ScriptBody, of_histories, of_poses, of_trainings};
use crate::submission::{Submission, TaskSettings, Work};
use crate::usage::ended_line;

/// The `ppa` program that the jobs run.
#[derive(Debug, Clone, Copy)]
pub struct Program<'a> {
    /// Absolute path of the program.
    pub path: &'a Path,
    /// SHA-256 of the file, in hexadecimal; a node whose file differs refuses the work.
    pub sha256: &'a str,
}

/// The scripts of one folder.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Scripts {
    /// Script of the array: one shard, training run or part per task. Its argument is added to the index of the task.
    pub task: String,
    /// Script of the job that merges, or writes tables.
    pub last: String,
}

/// Why a script cannot be written.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum ScriptError {
    /// A setting is not a single word of an `#SBATCH` line.
    #[error(
        "--{option} is \"{found}\", expected a name without spaces, quotes or other special characters"
    )]
    Word {
        /// `partition`, `account`, `mem` or `gres`.
        option: &'static str,
        /// The given value.
        found: String,
    },
    /// A path cannot be used in a script.
    #[error(transparent)]
    Path(#[from] FolderError),
}

impl Scripts {
    /// Builds the scripts of a submission.
    ///
    /// # Errors
    /// [`ScriptError`] for settings and paths that a script cannot hold.
    pub fn new(
        folder: &ClusterFolder,
        submission: &Submission,
        program: &Program,
    ) -> Result<Self, ScriptError> {
        let head = head(folder, submission, program)?;
        let (task, last) = match &submission.work {
            Work::Poses(work) => of_poses(work, submission.settings.cpus),
            Work::Trainings(work) => of_trainings(work, submission.settings.cpus),
            Work::Histories(work) => of_histories(work, submission.settings.cpus)?,
        };
        let whole = |parts: ScriptBody, named: &str| {
            let ended = ended_line(submission.settings.cpus);
            let ScriptBody { title, number, run } = parts;
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
            task: whole(task, &format!("{} $number of {tasks}", work.task_name())),
            last: whole(last, work.last_name()),
        })
    }
}

/// Common head of both scripts: requests to Slurm, folder, program, setup, and the check of plan and program.
fn head(
    folder: &ClusterFolder,
    submission: &Submission,
    program: &Program,
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
    // Sent only to the script, which passes it on.
    request(format!("signal=B:TERM@{}", submission.work.warning_s()));
    request("requeue".to_owned());
    request("open-mode=append".to_owned());
    let root = shell_quoted(unicode(folder.root())?);
    let program_path = unicode(program.path)?;
    let quoted = shell_quoted(program_path);
    let _ = write!(text, "\ncd {root} || exit 1\nppa={quoted}\n");
    if let Some(setup) = setup {
        let _ = writeln!(text, "{}", setup.trim_end());
    }
    let guarded = match &submission.work {
        Work::Histories(_) => unicode(&submission.plan)?,
        Work::Poses(_) | Work::Trainings(_) => "slurm/plan.toml",
    };
    let guard = [
        format!("{}  {guarded}", submission.plan_sha256),
        format!("{}  {program_path}", program.sha256),
    ];
    let _ = write!(
        text,
        "\n# Results of an edited plan or of another program do not fit together.\n\
         if ! printf '%s\\n' {} {} | sha256sum --check --quiet; then\n    \
         echo \"on $SLURMD_NODENAME, one of these files is not the one that was submitted: run ppa submit again\"\n    \
         exit 1\n\
         fi\n",
        shell_quoted(&guard[0]),
        shell_quoted(&guard[1])
    );
    Ok(text)
}

/// Returns a value if Slurm reads it as one word.
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

/// Functions of both scripts. A job that repeatedly reaches its time limit, such as one that finishes no pose, ends after 20 restarts.
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
        echo "stopped before the time limit; the job is queued again and continues where it stopped"
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
    use crate::submission::tests::{histories, submission, trainings};

    fn folder(name: &str) -> (tempfile::TempDir, ClusterFolder) {
        let above = tempfile::tempdir().unwrap();
        let folder = ClusterFolder::create(&above.path().join(name)).unwrap();
        (above, folder)
    }

    fn program(path: &str) -> Program<'_> {
        let sha256 = "0123";
        let path = Path::new(path);
        Program { path, sha256 }
    }

    #[test]
    fn an_edited_plan_or_another_program_is_refused() {
        let (_above, folder) = folder("jobs");
        let path = folder.root().join("p p");
        for name in ["p p", "slurm/plan.toml"] {
            fs::write(folder.root().join(name), "a").unwrap();
        }
        let sha256 = "ca978112ca1bbdcafac231b39a23dc4da786eff8147c4e72b9807785afee48bb";
        let mut submission = submission();
        submission.plan_sha256 = sha256.to_owned();
        let path = path.as_path();
        let scripts = Scripts::new(&folder, &submission, &Program { path, sha256 }).unwrap();
        let head = scripts.last.split_once("\ntask=").unwrap().0;
        let head = head.replace("module load ppa", "");
        let accepts = || {
            let said = Command::new("bash").args(["-c", &head]).output().unwrap();
            said.status.success()
        };
        assert!(accepts(), "{head}");
        fs::write(path, "b").unwrap();
        assert!(!accepts());
        fs::write(path, "a").unwrap();
        fs::write(folder.plan(), "b").unwrap();
        assert!(!accepts());
    }

    #[test]
    fn settings_stand_as_requests_in_both_scripts() {
        let (_above, folder) = folder("jobs");
        let scripts = Scripts::new(&folder, &submission(), &program("/opt/ppa")).unwrap();
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
        let scripts = Scripts::new(&folder, &trainings(), &program("ppa")).unwrap();
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
        // The training run that they need counts as well.
        let last = &scripts.last;
        assert!(last.contains("<<'END'\np\na\nb\nc\nEND\n"), "{last}");
    }

    #[test]
    fn outputs_are_written_by_the_last_job_only() {
        let (_above, folder) = folder("jobs");
        let mut submission = histories();
        let scripts = Scripts::new(&folder, &submission, &program("ppa")).unwrap();
        assert!(!scripts.task.contains("leg.png"), "{}", scripts.task);
        let last = "xray simulate leg.toml --engine analog --out \"$results\"/out/leg.png \\\n";
        assert!(scripts.last.contains(last), "{}", scripts.last);
        let published = "publish \"$results\"/out/leg.png leg.png\n";
        assert!(scripts.last.contains(published), "{}", scripts.last);
        assert!(scripts.last.contains("cd '/home/a b' || exit 1\n"));
        let Work::Histories(work) = &mut submission.work else {
            panic!("histories")
        };
        // The voxels of a dose map are counted by the tasks.
        work.divided.outputs.push("--dose-map=dose.nii".to_owned());
        let scripts = Scripts::new(&folder, &submission, &program("ppa")).unwrap();
        assert!(scripts.task.contains("--dose-map \"$part/dose_map.nii\""));
    }

    #[test]
    fn bash_accepts_scripts_of_paths_with_spaces() {
        let (_above, folder) = folder("two words, it's $HOME");
        let path = Path::new("/opt/my programs/ppa's");
        let program = program("/opt/my programs/ppa's");
        let of = |submission: &Submission| Scripts::new(&folder, submission, &program).unwrap();
        let all = [submission(), trainings(), histories()];
        for script in all.iter().flat_map(|one| {
            let Scripts { task, last } = of(one);
            [task, last]
        }) {
            // The script up to the name of the program, then the values that it read.
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
                format!("{}|{}", folder.root().display(), path.display())
            );
        }
    }

    #[test]
    fn a_setting_of_two_words_is_refused() {
        let (_above, folder) = folder("jobs");
        for bad in ["two words", "a\nb", "", "x;y", "$x"] {
            let mut submission = submission();
            submission.settings.partition = Some(bad.to_owned());
            let refused = Scripts::new(&folder, &submission, &program("ppa")).unwrap_err();
            assert!(
                refused.to_string().starts_with("--partition is"),
                "{refused}"
            );
        }
    }
}
