//! Plans and experiments as jobs of Slurm: scripts without Slurm, and submissions to programs that answer as Slurm does.
//! `.ci/slurm` runs jobs on a real one.
#![cfg(unix)]

use std::fs;
use std::os::unix::fs::PermissionsExt;
use std::path::Path;
use std::process::Command;

use serde_json::Value;

use crate::{contains, ppa, write_plan};

/// A folder with the quick plan of five poses, and a folder `bin` for programs of Slurm.
fn folder() -> tempfile::TempDir {
    let folder = tempfile::tempdir().unwrap();
    write_plan(folder.path(), "");
    fs::create_dir(folder.path().join("bin")).unwrap();
    folder
}

/// Programs that answer as those of Slurm: arrays of two tasks, the queue in the file `queue`, and the arguments of each
/// sbatch and scancel as a line of the file `calls`.
fn with_slurm() -> tempfile::TempDir {
    let folder = folder();
    let log = "echo \"${0##*/} $*\" >>calls";
    for (name, text) in [
        ("scontrol", "echo 'MaxArraySize            = 3'".to_owned()),
        ("squeue", "[ ! -e queue ] || cat queue".to_owned()),
        ("scancel", log.to_owned()),
        (
            "sbatch",
            format!(
                "if [ \"$1\" = --test-only ]; then [ ! -e refuse ] || {{ cat refuse >&2; exit 1; }}; exit; fi\n\
                 {log}\nwc -l <calls"
            ),
        ),
    ] {
        let path = folder.path().join("bin").join(name);
        fs::write(&path, format!("#!/bin/sh\nPATH=/usr/bin:/bin\n{text}\n")).unwrap();
        fs::set_permissions(&path, fs::Permissions::from_mode(0o755)).unwrap();
    }
    folder
}

/// `ppa` with no other programs than those of the folder `bin`.
fn isolated(folder: &Path, arguments: &str) -> Command {
    let mut command = ppa(folder, arguments);
    command.env("PATH", folder.join("bin"));
    command
}

fn succeed(folder: &Path, arguments: &str) -> Value {
    let output = isolated(folder, &format!("{arguments} --json")).output();
    let output = output.unwrap();
    let stderr = String::from_utf8_lossy(&output.stderr);
    assert!(output.status.success(), "ppa {arguments}: {stderr}");
    serde_json::from_slice(&output.stdout).unwrap()
}

fn fail(folder: &Path, arguments: &str) -> String {
    let output = isolated(folder, arguments).output().unwrap();
    let stderr = String::from_utf8(output.stderr).unwrap();
    assert!(!output.status.success(), "ppa {arguments} succeeded");
    assert_eq!(stderr.trim_end().lines().count(), 1, "{stderr}");
    stderr
}

fn calls(folder: &Path) -> Vec<String> {
    let text = fs::read_to_string(folder.join("calls")).unwrap_or_default();
    text.lines().map(str::to_owned).collect()
}

/// Times of a pose and limits that give three shards.
const THREE: &str = "submit slurm plan.toml --out jobs --pose-seconds 1200";

#[test]
fn a_dry_run_writes_scripts_without_slurm() {
    let folder = folder();
    let here = folder.path();
    let said = succeed(
        here,
        "submit slurm plan.toml --out jobs --partition main --cpus 2 --dry-run",
    );
    assert_eq!((&said["shards"], &said["units"]), (&1.into(), &5.into()));
    assert_eq!(said["cost_source"], "measured");
    assert_eq!(said["commands"].as_array().unwrap().len(), 2);
    let script = fs::read_to_string(here.join("jobs/slurm/shard.sh")).unwrap();
    contains(
        &script,
        &[
            "#SBATCH --partition=main",
            "--signal=B:TERM@",
            "--threads 2 generate",
        ],
    );
    // The plan may still be edited, and options changed.
    fs::write(
        here.join("plan.toml"),
        fs::read_to_string(here.join("plan.toml"))
            .unwrap()
            .replace("to_deg = 10.0", "to_deg = 7.5"),
    )
    .unwrap();
    let said = succeed(here, &format!("{THREE} --cpus 1 --dry-run"));
    assert_eq!((&said["shards"], &said["units"]), (&2.into(), &4.into()));
    let report = succeed(here, "status jobs");
    assert_eq!(report["states"]["missing"], 2);
    assert_eq!(report["merge"]["state"], "missing");
}

#[test]
fn what_cannot_work_is_refused_before_anything_is_queued() {
    let folder = with_slurm();
    let here = folder.path();
    for (arguments, words) in [
        ("--out nowhere/jobs", "nowhere does not exist"),
        ("--out bin", "neither empty nor a folder"),
        ("--out jobs --pose-seconds 1200 --time 5", "too short"),
        ("--out jobs --pose-seconds 0", "--pose-seconds is 0"),
        ("--out jobs --pose-seconds 1 --account a;b", "--account is"),
    ] {
        let said = fail(here, &format!("submit slurm plan.toml {arguments}"));
        assert!(said.contains(words), "{said}");
    }
    fs::write(
        here.join("refuse"),
        "invalid partition specified: nowhere\n",
    )
    .unwrap();
    let said = fail(here, THREE);
    assert!(said.contains("invalid partition"), "{said}");
    assert!(calls(here).is_empty());
    fs::remove_file(here.join("bin/scontrol")).unwrap();
    let said = fail(here, "submit slurm plan.toml --out other");
    contains(&said, &["Slurm is not on this machine", "--dry-run"]);
    assert!(!here.join("other").exists());
}

#[test]
fn only_missing_shards_are_submitted_again() {
    let folder = with_slurm();
    let here = folder.path();
    let said = succeed(here, &format!("{THREE} --setup true"));
    assert_eq!(said["jobs"], serde_json::json!(["1", "2", "3"]));
    let first = calls(here);
    assert!(first[0].contains("--array=1-2 "), "{first:?}");
    assert!(first[1].ends_with("shard.sh 2"), "{first:?}");
    assert!(first[2].contains("--dependency=afterany:1:2 --kill-on-invalid-dep=yes"));

    // One shard is made, one runs, one is lost; the merge waits.
    crate::succeed(
        here,
        "generate jobs/slurm/plan.toml --shard 1/3 --out jobs/shards/1",
    );
    let log = "begun\nkilled\njob 1_2 ended after 1800 s with 1 cores\n";
    fs::write(here.join("jobs/slurm/logs/shard_2.log"), log).unwrap();
    fs::write(
        here.join("queue"),
        "2_1|RUNNING|n1|None|shards 2\n3|PENDING||Dependency|merge\n",
    )
    .unwrap();
    let report = succeed(here, "status jobs");
    let shard = |shard: usize| &report["shards"][shard - 1];
    assert_eq!(shard(1)["state"], "done");
    assert_eq!(
        (&shard(2)["state"], &shard(2)["last_line"]),
        (&"failed".into(), &"killed".into())
    );
    assert_eq!(
        (&shard(3)["state"], &shard(3)["node"]),
        (&"running".into(), &"n1".into())
    );
    assert_eq!(report["merge"]["reason"], "Dependency");
    // Five poses of 1200 s, one of them made, on one core.
    let hours = &report["core_hours"];
    for (key, expected_s) in [
        ("estimated", 6000.0),
        ("used", 1800.0),
        ("left", 4800.0),
        ("left_hours", 4800.0),
    ] {
        assert_eq!(
            hours[key].as_f64(),
            Some(expected_s / 3600.0),
            "{key}: {hours}"
        );
    }

    let said = succeed(here, "submit slurm plan.toml --out jobs");
    assert_eq!(said["submitted"], serde_json::json!([2]));
    let again = &calls(here)[first.len()..];
    assert!(again[0].contains("--array=2 "), "{again:?}");
    assert_eq!(again[1], "scancel 3");
    assert!(again[2].contains("--dependency=afterany:2:4 "), "{again:?}");
    let script = fs::read_to_string(here.join("jobs/slurm/shard.sh")).unwrap();
    assert!(script.lines().any(|line| line == "true"), "{script}");

    let text = fs::read_to_string(here.join("plan.toml")).unwrap();
    fs::write(here.join("plan.toml"), text.replace("10.0", "7.5")).unwrap();
    let said = fail(here, "submit slurm plan.toml --out jobs");
    assert!(
        said.contains("differs from the plan that was submitted"),
        "{said}"
    );

    let said = succeed(here, "cancel jobs");
    assert_eq!(said["cancelled"], serde_json::json!(["2", "3"]));
}

#[test]
fn arrays_follow_each_other_where_tasks_are_limited() {
    let folder = with_slurm();
    succeed(folder.path(), &format!("{THREE} --max-tasks 1"));
    let calls = calls(folder.path());
    assert!(calls[0].contains("--array=1-2%1 "), "{calls:?}");
    assert!(calls[1].contains("--dependency=afterany:1 "), "{calls:?}");
}

#[test]
fn a_damaged_shard_is_submitted_again_after_a_check() {
    let folder = with_slurm();
    let here = folder.path();
    succeed(here, THREE);
    for shard in 1..=3 {
        let made =
            format!("generate jobs/slurm/plan.toml --shard {shard}/3 --out jobs/shards/{shard}");
        crate::succeed(here, &made);
    }
    let submitted = |arguments: &str| {
        succeed(
            here,
            &format!("submit slurm plan.toml --out jobs{arguments}"),
        )["submitted"]
            .clone()
    };
    assert_eq!(submitted(" --check"), serde_json::json!([]));
    let whole = crate::contents(&here.join("jobs/shards/2"));
    let (image, bytes) = whole
        .iter()
        .find(|(file, _)| file.extension().is_some_and(|of| of == "png"))
        .unwrap();
    let mut flipped = bytes.clone();
    *flipped.last_mut().unwrap() ^= 1;
    fs::write(here.join("jobs/shards/2").join(image), flipped).unwrap();
    assert_eq!(submitted(""), serde_json::json!([]));
    assert_eq!(submitted(" --check"), serde_json::json!([2]));
    // What the task runs makes the image again.
    crate::succeed(
        here,
        "generate jobs/slurm/plan.toml --shard 2/3 --out jobs/shards/2",
    );
    assert_eq!(submitted(" --check"), serde_json::json!([]));
}

/// A plan of experiments on two persons, with all body shapes.
fn write_experiments(folder: &Path) {
    crate::training::write_data(folder);
    for patient in 0..2 {
        let depth = folder.join(format!("data/patient_{patient}/depth/l"));
        for shape in ["big", "small", "bumps_a", "bumps_b"] {
            fs::create_dir(depth.join(shape)).unwrap();
            for image in fs::read_dir(depth.join("orig")).unwrap() {
                let image = image.unwrap();
                fs::copy(image.path(), depth.join(shape).join(image.file_name())).unwrap();
            }
        }
    }
    let plan = "seeds = 1\n[training]\npreset = \"quick\"\nside = 32\nsteps = 1\nbatch_size = 4\n\
        [synthetic]\ndataset = \"data\"\nfolds = 2\ntest_limbs = 1\n";
    fs::write(folder.join("experiments.toml"), plan).unwrap();
}

#[test]
fn each_training_of_an_experiment_is_a_task() {
    let folder = with_slurm();
    let here = folder.path();
    write_experiments(here);
    for (arguments, words) in [
        (
            "experiments.toml --pose-seconds 1",
            "--pose-seconds does not apply to",
        ),
        ("experiments.toml --check", "a plan of experiments"),
        ("experiments.toml --experiments 2a", "needs [preparations]"),
        ("plan.toml --experiments 1", "a plan of poses"),
    ] {
        let said = fail(here, &format!("submit slurm {arguments} --out other"));
        assert!(said.contains(words), "{said}");
    }
    let submit = "submit slurm experiments.toml --out jobs";
    let said = succeed(here, &format!("{submit} --experiments 1 --gres gpu:1"));
    // Four columns, two folds and two cameras, in arrays of two tasks.
    assert_eq!(said["shards"], 16);
    let first = calls(here);
    assert_eq!(first.len(), 8 + 1);
    assert!(first[7].ends_with("training.sh 14"), "{first:?}");
    assert!(
        first[8].contains("--dependency=afterany:1:2:3:4:5:6:7:8 "),
        "{first:?}"
    );
    assert!(first[8].ends_with("tables.sh"), "{first:?}");
    let script = fs::read_to_string(here.join("jobs/slurm/training.sh")).unwrap();
    assert!(script.contains("#SBATCH --gres=gpu:1\n"), "{script}");

    // What tasks 2 and 3 run; task 3 is killed before its end.
    let train = |part: &str| {
        let arguments =
            format!("experiment 1 jobs/slurm/plan.toml --out jobs/runs --shard {part}/16");
        crate::succeed(here, &arguments)
    };
    train("2");
    let report = succeed(here, "status jobs");
    let begun = report["shards"][2]["training"].as_str().unwrap().to_owned();
    fs::create_dir_all(here.join("jobs/runs").join(begun)).unwrap();
    let report = succeed(here, "status jobs");
    assert_eq!((&report["made"], &report["units"]), (&1.into(), &16.into()));
    let states: Vec<&str> = report["shards"].as_array().unwrap()[..3]
        .iter()
        .map(|shard| shard["state"].as_str().unwrap())
        .collect();
    assert_eq!(states, ["missing", "done", "failed"]);
    assert_eq!(report["core_hours"], serde_json::json!({"used": 0.0}));

    let said = succeed(here, submit);
    assert_eq!(said["submitted"].as_array().unwrap().len(), 15);
    assert!(!said["submitted"].as_array().unwrap().contains(&2.into()));
    let said = fail(here, &format!("{submit} --experiments ablations"));
    assert!(said.contains("--experiments differ"), "{said}");
    assert!(said.contains("choose another --out"), "{said}");
}

/// Runs the script of a task, or of the last job, as Slurm does.
fn run_script(folder: &Path, script: &str, task: Option<u64>) -> std::process::Output {
    let mut command = Command::new("bash");
    command.current_dir(folder).arg(script);
    if let Some(task) = task {
        command
            .arg("0")
            .env("SLURM_ARRAY_TASK_ID", task.to_string());
    }
    command
        .env("SLURM_ARRAY_JOB_ID", "7")
        .env("SLURM_JOB_ID", "8");
    command.output().unwrap()
}

#[test]
fn a_radiograph_in_tasks_has_the_bytes_of_one_run() {
    let folder = with_slurm();
    let here = folder.path();
    let case = crate::phantom().join("p01.toml");
    let command = |name: &str| {
        format!(
            "xray simulate {} --plan plan.toml --engine analog --histories 20000 --seed 5 --out {name}.png --exr={name}.exr \
             --dose-map {name}.nii --dicom {name}.dcm",
            case.display()
        )
    };
    crate::succeed(here, &command("one"));
    let submit = format!("submit slurm --out jobs --tasks 3 -- {}", command("parts"));
    let said = succeed_before(here, &submit);
    assert_eq!(
        (&said["shards"], &said["histories"]),
        (&3.into(), &20_000.into())
    );
    assert_eq!(said["cpu_s_per_million"], Value::Null);
    assert!(calls(here)[2].ends_with("merge.sh"), "{:?}", calls(here));

    let last = run_script(here, "jobs/slurm/merge.sh", None);
    assert!(!last.status.success());
    for task in [3, 1] {
        let output = run_script(here, "jobs/slurm/part.sh", Some(task));
        assert!(output.status.success(), "{output:?}");
    }
    let report = succeed(here, "status jobs");
    assert_eq!(
        report["states"],
        serde_json::json!({"done": 2, "missing": 1})
    );
    assert_eq!(report["units"], 20_000);
    assert!(
        (13_332..=13_334).contains(&report["made"].as_u64().unwrap()),
        "{report}"
    );
    let said = succeed_before(here, &submit.replace("--tasks 3 ", ""));
    assert_eq!(said["submitted"], serde_json::json!([2]));
    let output = run_script(here, "jobs/slurm/part.sh", Some(2));
    assert!(output.status.success(), "{output:?}");
    let output = run_script(here, "jobs/slurm/merge.sh", None);
    assert!(output.status.success(), "{output:?}");
    for ending in ["png", "exr", "nii", "dcm"] {
        let read = |name: &str| fs::read(here.join(format!("{name}.{ending}"))).unwrap();
        assert!(read("parts") == read("one"), "{ending}");
    }
    assert_eq!(succeed(here, "status jobs")["merge"]["state"], "done");

    let tally = here.join("jobs/parts/2/radiograph.tally");
    let mut flipped = fs::read(&tally).unwrap();
    *flipped.last_mut().unwrap() ^= 1;
    fs::write(&tally, flipped).unwrap();
    let check = submit.replace("--tasks 3 ", "--check ");
    succeed_before(here, &check.replace("--check", "--check --dry-run"));
    assert!(tally.exists());
    assert_eq!(
        succeed_before(here, &check)["submitted"],
        serde_json::json!([2])
    );
    assert!(tally.with_extension("tally.damaged1").exists() && !tally.exists());
    let output = run_script(here, "jobs/slurm/part.sh", Some(2));
    assert!(output.status.success(), "{output:?}");
    assert_eq!(
        succeed_before(here, &check)["submitted"],
        serde_json::json!([])
    );

    let said = fail(
        here,
        &submit
            .replace("--tasks 3 ", "")
            .replace("--seed 5", "--seed 6"),
    );
    assert!(said.contains("the command differs"), "{said}");
}

/// As [`succeed`], with `--json` before the command behind `--`.
fn succeed_before(folder: &Path, arguments: &str) -> Value {
    let arguments = arguments.replacen("submit slurm", "--json submit slurm", 1);
    let output = isolated(folder, &arguments).output().unwrap();
    let stderr = String::from_utf8_lossy(&output.stderr);
    assert!(output.status.success(), "ppa {arguments}: {stderr}");
    serde_json::from_slice(&output.stdout).unwrap()
}

#[test]
fn a_scan_in_tasks_has_the_bytes_of_one_run() {
    let folder = with_slurm();
    let here = folder.path();
    crate::mcgpu::write_input(here);
    let command = |out: &str| format!("xray mcgpu box.in --histories 20000 --seed 3 --out {out}");
    crate::succeed(here, &command("one"));
    let submit = format!("submit slurm --out jobs -- {}", command("parts"));
    let said = succeed_before(here, &submit);
    assert_eq!(
        (&said["shards"], &said["histories"]),
        (&1.into(), &40_000.into())
    );
    assert!(said["cpu_s_per_million"].as_f64().unwrap() > 0.0);

    let submit = submit.replace("jobs", "two --tasks 2");
    succeed_before(here, &submit);
    for task in [1, 2] {
        let output = run_script(here, "two/slurm/part.sh", Some(task));
        assert!(output.status.success(), "{output:?}");
    }
    let output = run_script(here, "two/slurm/merge.sh", None);
    assert!(output.status.success(), "{output:?}");
    assert!(crate::contents(&here.join("parts")) == crate::contents(&here.join("one")));

    // A tally of another seed is found by the merge.
    let other = command("two/parts/2").replace("--seed 3", "--seed 4 --replace --part 2/2");
    crate::succeed(here, &other);
    let said = crate::fail(
        here,
        &format!("{} --merge two/parts/1 two/parts/2", command("again")),
    );
    assert!(said.contains("is of another simulation"), "{said}");
    assert!(!here.join("again").exists());
}

#[test]
fn commands_that_cannot_be_divided_are_refused() {
    let folder = with_slurm();
    let here = folder.path();
    crate::mcgpu::write_input(here);
    let case = crate::phantom().join("p01.toml");
    let analog = format!(
        "xray simulate {} --engine analog --out x.png",
        case.display()
    );
    let fast = analog.replace("analog", "fast");
    for (arguments, words) in [
        (format!("-- {fast}"), "give --engine analog"),
        (
            format!("-- {analog} --time 3"),
            "--time cannot be given for",
        ),
        (
            format!("-- {analog} --tally t"),
            "--tally cannot be given for",
        ),
        (format!("-- {analog} -- x"), "contains another --"),
        (
            format!("-- {analog} --seeed 3"),
            "unexpected argument '--seeed'",
        ),
        (
            format!("--pose-seconds 3 -- {analog}"),
            "--pose-seconds does not apply to a command",
        ),
        (
            format!("--tasks 9 -- {analog} --histories 3"),
            "9 tasks are more than 3 histories",
        ),
        (format!("--time 1 -- {analog}"), "too short"),
        (
            format!("--tasks 2 -- {analog} --dicom nowhere/x.dcm"),
            "nowhere",
        ),
        (
            "--tasks 2 -- xray mcgpu box.in --out x --engine fast".to_owned(),
            "needs --engine analog",
        ),
        (
            "--tasks 2 -- xray spectrum".to_owned(),
            "expected xray simulate or xray mcgpu",
        ),
        (
            "--tasks 2 -- ct info x.nii".to_owned(),
            "expected xray simulate or xray mcgpu",
        ),
        (
            "plan.toml --tasks 2".to_owned(),
            "--tasks does not apply to a plan of poses",
        ),
    ] {
        let said = fail(here, &format!("submit slurm --out jobs {arguments}"));
        assert!(said.contains(words), "{arguments}: {said}");
    }
    assert!(calls(here).is_empty());
}
