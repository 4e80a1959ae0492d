//! Ctrl-C and TERM: the current step is finished, one line says how to resume, and the exit status is that of the signal.
#![cfg(target_os = "linux")] // which signals a run handles is read from /proc

use std::fs;
use std::path::Path;
use std::process::{Child, Command, Stdio};
use std::time::{Duration, Instant};

use crate::resume::records;
use crate::shards::write_quick_plan;
use crate::{contains, contents, names, phantom, ppa, succeed, write_plan};

fn start(folder: &Path, arguments: &str) -> Child {
    spawn(ppa(folder, arguments))
}

fn spawn(mut command: Command) -> Child {
    let command = command.stdout(Stdio::piped()).stderr(Stdio::piped());
    command.spawn().unwrap()
}

fn send(run: &Child, signal: &str) {
    let sent = Command::new("kill")
        .args([&format!("-{signal}"), &run.id().to_string()])
        .status();
    assert!(sent.unwrap().success());
}

/// Waits for the end of a run and returns its exit status and stderr. It must have printed no result.
fn ended(run: Child) -> (Option<i32>, String) {
    let output = run.wait_with_output().unwrap();
    assert!(output.stdout.is_empty(), "{output:?}");
    let said = String::from_utf8(output.stderr).unwrap();
    (output.status.code(), said)
}

fn wait_for(run: &mut Child, mut what: impl FnMut() -> bool) {
    let began = Instant::now();
    while !what() {
        assert!(run.try_wait().unwrap().is_none(), "the run ended before");
        assert!(began.elapsed() < Duration::from_secs(120));
        std::thread::sleep(Duration::from_millis(5));
    }
}

/// Writes a plan and returns the command that simulates its radiograph with the analog engine.
fn analog_run(folder: &Path) -> String {
    write_plan(folder, "");
    let case = phantom().join("p01.toml");
    format!(
        "xray simulate {} --plan plan.toml --engine analog --seed 5",
        case.display()
    )
}

/// Whether the program already handles a signal.
fn handles_signal(run: u32, signal: &str) -> bool {
    let status = fs::read_to_string(format!("/proc/{run}/status")).unwrap();
    let caught = status.split("SigCgt:").nth(1).unwrap();
    let caught = u64::from_str_radix(caught.split_whitespace().next().unwrap(), 16).unwrap();
    let number = if signal == "INT" { 2 } else { 15 };
    caught >> (number - 1) & 1 == 1
}

/// Sends a signal a second after the program handles it; returns exit status and stderr.
fn interrupted(folder: &Path, arguments: &str, signal: &str) -> (Option<i32>, String) {
    let mut run = start(folder, arguments);
    let id = run.id();
    wait_for(&mut run, || handles_signal(id, signal));
    std::thread::sleep(Duration::from_secs(1));
    assert!(run.try_wait().unwrap().is_none(), "ppa {arguments} ended");
    send(&run, signal);
    ended(run)
}

#[test]
fn a_stopped_dataset_resumes_to_the_same_bytes() {
    let folder = tempfile::tempdir().unwrap();
    let here = folder.path();
    write_quick_plan(here);
    let run = "generate plan.toml --threads 1 --progress quiet --out";
    for (signal, code, name) in [("INT", 130, "int"), ("TERM", 143, "term")] {
        let root = here.join(name);
        let mut stopped = start(here, &format!("{run} {name}"));
        wait_for(&mut stopped, || records(&root) > 0);
        send(&stopped, signal);
        let (ended, said) = ended(stopped);
        assert_eq!(ended, Some(code), "{said}");
        assert_eq!(said.trim_end().lines().count(), 1, "{said}");
        let made = records(&root);
        let how = format!("stopped after {made} of 5 poses; repeat the command to resume");
        contains(&said, &[&how]);
        succeed(here, &format!("{run} {name}"));
    }
    assert!(contents(&here.join("int")) == contents(&here.join("term")));
}

/// A radiograph of many analog histories is stopped within a pose.
#[test]
fn a_stopped_pose_resumes_from_its_histories() {
    let folder = tempfile::tempdir().unwrap();
    let here = folder.path();
    let plan = write_plan(here, "[xray.analog]\nhistories = 8000000\n");
    let text = fs::read_to_string(&plan).unwrap();
    fs::write(&plan, text.replace("to_deg = 10.0", "to_deg = 0.0")).unwrap();
    let run = "generate plan.toml --progress quiet --out";
    succeed(here, &format!("{run} whole"));
    for (out, histories) in [
        ("data", "data/.ppa/histories"),
        ("data.tar", "data.tar.histories"),
    ] {
        let kept = here.join(histories);
        let mut command = ppa(here, &format!("{run} {out}"));
        command.env("TMPDIR", here);
        let mut stopped = spawn(command);
        // The radiograph follows the depth images, which a run into an archive makes in a folder of TMPDIR.
        let image = ".ppa/new/patient_3/depth/r/orig/depth_cam_right_0.0.png";
        let is_made = |name: &String| here.join(name).join(image).exists();
        wait_for(&mut stopped, || names(here).iter().any(is_made));
        send(&stopped, "TERM");
        let (code, said) = ended(stopped);
        assert_eq!(code, Some(143), "{said}");
        let tallies = names(&kept);
        assert!(
            tallies.len() == 1 && tallies[0].starts_with("patient_3_r_000_"),
            "{said}"
        );
        let resumed = succeed(here, &format!("{run} {out}"));
        contains(&resumed, &["1 of them made now"]);
        assert!(!kept.exists());
    }
    assert!(contents(&here.join("data")) == contents(&here.join("whole")));
    succeed(here, &format!("{run} whole.tar"));
    let read = |name: &str| fs::read(here.join(name)).unwrap();
    assert!(read("data.tar") == read("whole.tar"));
}

#[test]
fn a_second_ctrl_c_ends_at_once() {
    let folder = tempfile::tempdir().unwrap();
    let here = folder.path();
    let plan = write_plan(here, "");
    let text = fs::read_to_string(&plan).unwrap();
    let endless = text.replace("scatter_histories = 100", "scatter_histories = 100000000");
    assert_ne!(endless, text);
    fs::write(&plan, endless).unwrap();
    let mut run = start(here, "generate plan.toml --out data --progress quiet");
    // The folder of its images shows that a pose has started; before that the first Ctrl-C would end the run.
    wait_for(&mut run, || here.join("data/.ppa/new/patient_3").exists());
    send(&run, "INT");
    std::thread::sleep(Duration::from_millis(500));
    assert!(run.try_wait().unwrap().is_none(), "the pose is under way");
    send(&run, "INT");
    let began = Instant::now();
    let (code, said) = ended(run);
    assert_eq!((code, said.as_str()), (Some(130), ""));
    // The pose would take minutes.
    assert!(began.elapsed() < Duration::from_secs(20));
}

#[test]
fn histories_of_a_stopped_run_are_kept_without_tally() {
    let folder = tempfile::tempdir().unwrap();
    let here = folder.path();
    let run = analog_run(here);
    let endless = format!("{run} --histories 5e11 --out x.png");
    let (code, said) = interrupted(here, &endless, "TERM");
    assert_eq!(code, Some(143), "{said}");
    let more = "repeat the command with --tally x.png.tally --resume to resume";
    contains(&said, &["histories, which are kept in x.png.tally", more]);
    assert_eq!(names(here), ["plan.toml", "x.png.tally"]);

    // Starting again would lose them.
    let again = ppa(here, &endless).output().unwrap();
    let again = String::from_utf8(again.stderr).unwrap();
    contains(&again, &["x.png.tally", "--resume", "--replace"]);
    let number = said.split("after ").nth(1).unwrap();
    let counted: u64 = number.split(' ').next().unwrap().parse().unwrap();
    let histories = counted + 10_000;
    succeed(
        here,
        &format!("{run} --histories {histories} --out x.png --tally x.png.tally --resume"),
    );
    succeed(here, &format!("{run} --histories {histories} --out y.png"));
    let read = |name: &str| fs::read(here.join(name)).unwrap();
    assert!(read("x.png") == read("y.png"));
    assert!(!here.join("y.png.tally").exists());
}

#[test]
fn a_named_tally_holds_what_was_counted() {
    let folder = tempfile::tempdir().unwrap();
    let here = folder.path();
    let run = analog_run(here) + " --histories 5e11 --out x.png --tally x.tally --resume";
    let (code, said) = interrupted(here, &run, "INT");
    assert_eq!(code, Some(130), "{said}");
    contains(&said, &["kept in x.tally; repeat the command to resume"]);
    assert_eq!(names(here), ["plan.toml", "x.tally"]);
}

#[test]
fn a_stopped_scan_of_mcgpu_resumes_to_the_same_bytes() {
    let folder = tempfile::tempdir().unwrap();
    let here = folder.path();
    crate::mcgpu::write_input(here);
    let run = "xray mcgpu box.in --histories 4e6 --out";
    let mut stopped = start(here, &format!("{run} stopped"));
    let second = here.join("stopped/image.dat_0000.raw");
    wait_for(&mut stopped, || second.exists());
    send(&stopped, "INT");
    let (code, said) = ended(stopped);
    assert_eq!(code, Some(130), "{said}");
    let tally = "stopped/image.dat.tally";
    let how = format!("after 1 of 2 projections; repeat the command to resume from {tally}");
    contains(&said, &[&how]);
    let kept = ["image.dat.tally", "image.dat_0000", "image.dat_0000.raw"];
    assert_eq!(names(&here.join("stopped")), kept);

    let time = || fs::metadata(&second).unwrap().modified().unwrap();
    let before = time();
    succeed(here, &format!("{run} stopped"));
    assert_eq!(time(), before, "a complete image is not written again");
    succeed(here, &format!("{run} whole"));
    assert!(contents(&here.join("stopped")) == contents(&here.join("whole")));
}

#[test]
fn work_that_writes_at_its_end_stops_at_once() {
    let folder = tempfile::tempdir().unwrap();
    let here = folder.path();
    let case = phantom().join("p01.toml");
    let run = format!(
        "depth coverage {} --step-deg 2 --distances-mm 700 --csv places.csv",
        case.display()
    );
    let (code, said) = interrupted(here, &run, "TERM");
    assert_eq!(code, Some(143), "{said}");
    contains(&said, &["stopped before anything was written"]);
    assert!(contents(here).is_empty());
}

#[test]
fn a_stopped_verification_leaves_nothing_behind() {
    let folder = tempfile::tempdir().unwrap();
    let here = folder.path();
    write_quick_plan(here);
    succeed(here, "generate plan.toml --out data --progress quiet");
    let before = contents(&here.join("data"));
    let scratch = here.join("scratch");
    fs::create_dir(&scratch).unwrap();
    let mut command = ppa(
        here,
        "verify data --plan plan.toml --fraction 1 --threads 1 --progress quiet",
    );
    command.env("TMPDIR", &scratch);
    let mut run = spawn(command);
    wait_for(&mut run, || fs::read_dir(&scratch).unwrap().count() > 0);
    send(&run, "INT");
    let (code, said) = ended(run);
    assert_eq!(code, Some(130), "{said}");
    contains(&said, &["stopped", "repeat the command to start over"]);
    assert_eq!(fs::read_dir(&scratch).unwrap().count(), 0);
    assert!(contents(&here.join("data")) == before);
}
