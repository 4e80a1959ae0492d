//! Bodies of the job scripts for each kind of work.

use std::fmt::Write;

use crate::error::FolderError;
use crate::folder::{DONE, FINISHED, PARTS, TALLY};
use crate::histories::{HistoryCommand, HistoryWork};
use crate::quote::{shell_quoted, unicode};
use crate::results::Results;
use crate::submission::{PoseWork, TrainingWork};

/// Parts that differ between scripts.
pub(crate) struct ScriptBody {
    /// What the script does, in a sentence.
    pub title: String,
    /// Shell variables: the number of the task, and Slurm's name of the job.
    pub number: &'static str,
    /// Shell code of the work.
    pub run: String,
}

/// Variables of a task of the array, and of the last job.
const OF_TASK: &str = "number=$(($1 + SLURM_ARRAY_TASK_ID))\n\
                       task=${SLURM_ARRAY_JOB_ID}_${SLURM_ARRAY_TASK_ID}\n";
const OF_LAST: &str = "task=$SLURM_JOB_ID\n";

/// Shell code of the last job, which starts after all tasks, failed ones included; `find_missing` is defined before it. NFS caches names, by default
/// for up to a minute. If all tasks succeeded, the job waits until it sees the files of the other nodes.
const FIND_MISSING: &str = "\
    # Files of other nodes may be seen late, since NFS caches names. If all tasks succeeded, none is missing.\n\
    succeeded() { [ \"$(squeue --noheader --states=all --jobs=\"$1\" --format=%T | sort -u)\" = COMPLETED ]; }\n\
    find_missing\n\
    while [ ${#missing[@]} -gt 0 ] && [ \"$SECONDS\" -lt 180 ] && succeeded \"$1\"; do\n    \
    sleep 5\n    \
    find_missing\n\
    done\n";

/// The scripts of the shards of a plan.
pub(crate) fn of_poses(work: &PoseWork, cpus: u32) -> (ScriptBody, ScriptBody) {
    let shards = work.bundle.shards;
    let ending = work.ending();
    let begun = if work.archive { "-s" } else { "-d" };
    let held = if work.archive { "" } else { "/.ppa" };
    let task = ScriptBody {
        title: format!("Makes one shard of {shards}: argument 1 plus the index of the task."),
        number: OF_TASK,
        run: format!(
            "# The shard is given: indices of the array are not those of the shards.\n\
             run env -u SLURM_ARRAY_TASK_ID \"$ppa\" --threads {cpus} generate slurm/plan.toml \\\n    \
             --shard \"$number/{shards}\" --out \"shards/$number{ending}\" --progress plain\n"
        ),
    };
    // Analog histories of a pose, which take hours, are not followed again.
    let (checks, read_back, verify) = match work.cost.resumes {
        true => ("reads back", " --verify", String::new()),
        false => {
            let plan = "--plan slurm/plan.toml --progress plain";
            let verify = format!("run \"$ppa\" --threads {cpus} verify dataset{ending} {plan}\n");
            ("verifies", "", verify)
        }
    };
    let last = ScriptBody {
        title: format!("Merges {shards} shards and {checks} the dataset."),
        number: OF_LAST,
        run: format!(
            "find_missing() {{\n    \
             missing=()\n    \
             shards=()\n    \
             for ((shard = 1; shard <= {shards}; shard++)); do\n        \
             [ {begun} \"shards/$shard{ending}{held}\" ] || missing+=(\"$shard\")\n        \
             shards+=(\"shards/$shard{ending}\")\n    \
             done\n\
             }}\n\
             {FIND_MISSING}\
             if [ ${{#missing[@]}} -gt 0 ]; then\n    \
             echo \"no dataset: these shards were never started: ${{missing[*]}}\"\n    \
             exit 1\n\
             fi\n\
             run \"$ppa\" --threads {cpus} merge \"${{shards[@]}}\" --out dataset{ending}{read_back} --progress plain\n\
             {verify}\
             : >{DONE}\n"
        ),
    };
    (task, last)
}

/// The scripts of the training runs of experiments.
pub(crate) fn of_trainings(work: &TrainingWork, cpus: u32) -> (ScriptBody, ScriptBody) {
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
    let task = ScriptBody {
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
    let last = ScriptBody {
        title: format!("Writes the tables of {all} training runs."),
        number: OF_LAST,
        run: format!(
            "find_missing() {{\n    \
             missing=()\n    \
             while read -r training; do\n        \
             [ -f \"runs/$training/{FINISHED}\" ] || missing+=(\"$training\")\n    \
             done <<'END'\n\
             {folders}END\n\
             }}\n\
             {FIND_MISSING}\
             # This job trains nothing itself.\n\
             if [ ${{#missing[@]}} -gt 0 ]; then\n    \
             echo \"no tables: ${{#missing[@]}} of {count} training runs are not finished, such as ${{missing[0]}}\"\n    \
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

/// The scripts of the parts of a command that follows histories.
pub(crate) fn of_histories(
    work: &HistoryWork,
    cpus: u32,
) -> Result<(ScriptBody, ScriptBody), FolderError> {
    let HistoryWork { divided, parts, .. } = work;
    let quoted = |words: &[String]| -> String {
        let words = words.iter().map(|word| shell_quoted(word));
        words.collect::<Vec<_>>().join(" ")
    };
    let words = quoted(&divided.words);
    let results = Results::of(divided);
    let enter = format!(
        "# Paths of the command start from the folder that it was submitted from.\n\
         jobs=$PWD\n\
         cd {} || exit 1\n",
        shell_quoted(unicode(&divided.folder)?)
    );
    let named = |option: &str| {
        let mut words = divided.outputs.iter();
        words.any(|word| word == option || word.starts_with(&format!("{option}=")))
    };
    // Voxels are counted if a dose map is requested; the map of a single part is not kept.
    let dose_map = match named("--dose-map") {
        true => [
            "--dose-map \"$part/dose_map.nii\"",
            "rm -f \"$part/dose_map.nii\"\n",
        ],
        false => ["", ""],
    };
    let followed = match divided.command {
        HistoryCommand::Simulate => {
            format!("--tally \"$part/{TALLY}\" --resume {}", dose_map[0])
        }
        HistoryCommand::Mcgpu => "--out \"$part\"".to_owned(),
    };
    let task = ScriptBody {
        title: format!("Follows one part of {parts}: argument 1 plus the index of the task."),
        number: OF_TASK,
        run: format!(
            "{enter}\
             part=$jobs/{PARTS}/$number\n\
             mkdir -p \"$part\" || exit 1\n\
             {}\
             run \"$ppa\" --threads {cpus} {words} \\\n    \
             --part \"$number/{parts}\" {}\n\
             {}",
            dose_map[1],
            followed.trim_end(),
            dose_map[1]
        ),
    };
    let merged = match divided.command {
        HistoryCommand::Simulate => format!(
            "run \"$ppa\" --threads {cpus} xray merge \"${{parts[@]/%//{TALLY}}}\" --tally \"$jobs/{TALLY}\" --replace\n\
             # All histories are in the tally: none is followed.\n\
             run \"$ppa\" --threads {cpus} {words} {} \\\n    \
             --tally \"$jobs/{TALLY}\" --resume\n",
            results.words
        ),
        HistoryCommand::Mcgpu => {
            let outputs = &results.words;
            format!("run \"$ppa\" --threads {cpus} {words} {outputs} --merge \"${{parts[@]}}\"\n")
        }
    };
    let last = ScriptBody {
        title: format!("Merges {parts} parts and writes the results."),
        number: OF_LAST,
        run: format!(
            "{enter}\
             find_missing() {{\n    \
             missing=()\n    \
             parts=()\n    \
             for ((part = 1; part <= {parts}; part++)); do\n        \
             [ -d \"$jobs/{PARTS}/$part\" ] || missing+=(\"$part\")\n        \
             parts+=(\"$jobs/{PARTS}/$part\")\n    \
             done\n\
             }}\n\
             {FIND_MISSING}\
             # The merge refuses parts that are missing.\n\
             {}\
             {merged}\
             {}\
             : >\"$jobs/{DONE}\"\n",
            results.before, results.after
        ),
    };
    Ok((task, last))
}

#[cfg(test)]
mod tests {
    use std::process::Command;

    use super::FIND_MISSING;

    /// What is missing in the end, given task states and one file that appears after a wait.
    fn missing_in_the_end(states: &str) -> String {
        let script = format!(
            "waited=0\n\
             sleep() {{ waited=1; }}\n\
             squeue() {{ case \"$*\" in *--jobs=7,9*) printf '{states}' ;; esac; }}\n\
             find_missing() {{ missing=(); [ $waited = 1 ] || missing+=(3); }}\n\
             {FIND_MISSING}\
             printf %s \"${{missing[*]}}\"\n"
        );
        let mut said = Command::new("bash");
        said.args(["-c", &script, "merge.sh", "7,9"]);
        String::from_utf8(said.output().unwrap().stdout).unwrap()
    }

    #[test]
    fn late_files_are_waited_for_if_all_tasks_succeeded() {
        assert_eq!(missing_in_the_end("COMPLETED\\nCOMPLETED\\n"), "");
        assert_eq!(missing_in_the_end("COMPLETED\\nFAILED\\n"), "3");
        // Jobs that ended long ago are unknown to squeue.
        assert_eq!(missing_in_the_end(""), "3");
    }
}
