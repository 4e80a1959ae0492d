//! Histories of a command divided into Slurm jobs, whose scripts run here.
#![cfg(unix)]

use std::fs;
use std::path::Path;
use std::process::Command;

use serde_json::Value;

use crate::cluster::{calls, fail, isolated, succeed, with_slurm};

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
    assert!(
        calls(here)[2].ends_with("merge.sh 1,2"),
        "{:?}",
        calls(here)
    );

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
    // A file created there in the meantime is kept.
    let exr = here.join("parts.exr");
    fs::write(&exr, "of somebody").unwrap();
    let output = run_script(here, "jobs/slurm/merge.sh", None);
    assert!(!output.status.success(), "{output:?}");
    let said = String::from_utf8_lossy(&output.stdout);
    assert!(said.contains("parts.exr was created since"), "{said}");
    assert_eq!(fs::read(&exr).unwrap(), b"of somebody");
    assert!(!here.join("jobs/slurm/verified").exists());
    fs::remove_file(&exr).unwrap();
    let output = run_script(here, "jobs/slurm/merge.sh", None);
    assert!(output.status.success(), "{output:?}");
    assert!(!here.join("jobs/slurm/results").exists());
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

/// Like [`succeed`], with `--json` before the command behind `--`.
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
    // As if the merge had been killed before its last line.
    let output = run_script(here, "two/slurm/merge.sh", None);
    assert!(output.status.success(), "{output:?}");
    assert!(crate::contents(&here.join("parts")) == crate::contents(&here.join("one")));

    // The merge detects a tally of another seed.
    let other = command("two/parts/2").replace("--seed 3", "--seed 4 --replace --part 2/2");
    crate::succeed(here, &other);
    let said = crate::fail(
        here,
        &format!("{} --merge two/parts/1 two/parts/2", command("again")),
    );
    assert!(said.contains("belongs to another simulation"), "{said}");
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
