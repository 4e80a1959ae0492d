//! Plans as Slurm jobs: scripts without Slurm, and submissions to programs that imitate Slurm. `.ci/slurm` runs jobs on a real one.
#![cfg(unix)]

use std::fs;
use std::os::unix::fs::PermissionsExt;
use std::path::Path;
use std::process::Command;

use serde_json::Value;

use crate::shards::write_quick_plan;
use crate::{contains, ppa};

/// A folder with the quick plan of five poses, and a folder `bin` for Slurm programs.
fn folder() -> tempfile::TempDir {
    let folder = tempfile::tempdir().unwrap();
    write_quick_plan(folder.path());
    fs::create_dir(folder.path().join("bin")).unwrap();
    folder
}

/// Adds programs that imitate Slurm: arrays of two tasks, the queue in the file `queue`, and the arguments of each sbatch
/// and scancel as a line of the file `calls`.
pub fn with_slurm() -> tempfile::TempDir {
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

/// `ppa` with only the programs of the folder `bin`.
pub fn isolated(folder: &Path, arguments: &str) -> Command {
    let mut command = ppa(folder, arguments);
    command.env("PATH", folder.join("bin"));
    command
}

pub fn succeed(folder: &Path, arguments: &str) -> Value {
    let output = isolated(folder, &format!("{arguments} --json")).output();
    let output = output.unwrap();
    let stderr = String::from_utf8_lossy(&output.stderr);
    assert!(output.status.success(), "ppa {arguments}: {stderr}");
    serde_json::from_slice(&output.stdout).unwrap()
}

pub fn fail(folder: &Path, arguments: &str) -> String {
    let output = isolated(folder, arguments).output().unwrap();
    let stderr = String::from_utf8(output.stderr).unwrap();
    assert!(!output.status.success(), "ppa {arguments} succeeded");
    assert_eq!(stderr.trim_end().lines().count(), 1, "{stderr}");
    stderr
}

pub fn calls(folder: &Path) -> Vec<String> {
    let text = fs::read_to_string(folder.join("calls")).unwrap_or_default();
    text.lines().map(str::to_owned).collect()
}

/// A time per pose and limits that give three shards.
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
    // The plan and the options can still be changed.
    fs::write(
        here.join("plan.toml"),
        fs::read_to_string(here.join("plan.toml"))
            .unwrap()
            .replace("to_deg = 10.0", "to_deg = 7.5"),
    )
    .unwrap();
    let said = succeed(here, &format!("{THREE} --cpus 1 --dry-run"));
    assert_eq!((&said["shards"], &said["units"]), (&2.into(), &4.into()));
    // The scripts of the first dry run are replaced, not taken for edited ones.
    let changed = fs::read_to_string(here.join("jobs/slurm/shard.sh")).unwrap();
    assert_ne!(changed, script);
    contains(&changed, &["--threads 1 generate"]);
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
    contains(
        &said,
        &["Slurm is not installed on this machine", "--dry-run"],
    );
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

    // One shard is done, one is running, one was killed; the merge waits.
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
    // Five poses of 1200 s, one of them finished, on one core.
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
    // The command of the task makes the image again.
    crate::succeed(
        here,
        "generate jobs/slurm/plan.toml --shard 2/3 --out jobs/shards/2",
    );
    assert_eq!(submitted(" --check"), serde_json::json!([]));
}

#[test]
fn a_submission_of_archives_is_few_files() {
    let folder = with_slurm();
    let here = folder.path();
    let archive = format!("{THREE} --archive");
    succeed(here, &archive);
    let merge = fs::read_to_string(here.join("jobs/slurm/merge.sh")).unwrap();
    contains(
        &merge,
        &[
            "--out dataset.tar",
            "verify dataset.tar",
            "shards/$shard.tar",
        ],
    );
    for shard in 1..=3 {
        let out = format!("jobs/shards/{shard}.tar");
        let plan = format!("generate jobs/slurm/plan.toml --shard {shard}/3 --out {out}");
        crate::succeed(here, &plan);
    }
    let report = succeed(here, "status jobs");
    assert_eq!(report["states"]["done"], 3);
    assert_eq!(crate::contents(&here.join("jobs/shards")).len(), 3);
    let submitted = |arguments: &str| succeed(here, arguments)["submitted"].clone();
    let again = "submit slurm plan.toml --out jobs";
    assert_eq!(submitted(again), serde_json::json!([]));
    let path = here.join("jobs/shards/2.tar");
    let mut bytes = fs::read(&path).unwrap();
    let image = bytes.windows(4).position(|four| four == b"\x89PNG");
    bytes[image.unwrap() + 50] ^= 1;
    fs::write(&path, bytes).unwrap();
    assert_eq!(submitted(again), serde_json::json!([]));
    assert_eq!(
        submitted(&format!("{again} --check")),
        serde_json::json!([2])
    );

    succeed(here, &THREE.replace("jobs", "folders"));
    let said = fail(here, "submit slurm plan.toml --out folders --archive");
    assert!(said.contains("which --archive cannot change"), "{said}");
}
