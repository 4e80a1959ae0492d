//! Runs that are repeatedly killed or cannot write still end with the dataset of an undisturbed run.

use std::fs;
use std::path::Path;
use std::process::{Command, Stdio};
use std::time::{Duration, Instant};

use crate::shards::{whole, write_quick_plan};
use crate::{contents, ppa, succeed};

/// Marsaglia's xorshift, so that every run tries the same moments.
struct Moments(u64);

impl Moments {
    fn below(&mut self, limit: u64) -> u64 {
        self.0 ^= self.0 << 13;
        self.0 ^= self.0 >> 7;
        self.0 ^= self.0 << 17;
        self.0 % limit
    }
}

/// Kills a run (SIGKILL) after `wait` and returns whether it was still running.
fn kill_after(folder: &Path, arguments: &str, wait: Duration) -> bool {
    let mut command = ppa(folder, arguments);
    let mut run = command
        .stdout(Stdio::null())
        .stderr(Stdio::null())
        .spawn()
        .unwrap();
    std::thread::sleep(wait);
    let at_work = run.try_wait().unwrap().is_none();
    run.kill().unwrap();
    run.wait().unwrap();
    at_work
}

/// Runs `arguments` with file sizes limited to `kilobytes`, as on a disk that refuses writes.
fn run_with_small_files(folder: &Path, arguments: &str, kilobytes: u64) -> std::process::Output {
    // Since the signal is ignored, a write beyond the limit fails instead of killing the process.
    let script = format!("trap '' XFSZ; ulimit -f {kilobytes}; exec \"$0\" {arguments}");
    Command::new("bash")
        .args(["-c", &script, env!("CARGO_BIN_EXE_ppa")])
        .current_dir(folder)
        .output()
        .unwrap()
}

/// Removes one image so that the next run over a finished dataset has work to do.
fn lose_an_image(root: &Path, moments: &mut Moments) {
    if !root.exists() {
        return; // killed before it began
    }
    let images = contents(root);
    let images: Vec<_> = images
        .keys()
        .filter(|name| name.starts_with("patient_3"))
        .collect();
    if !images.is_empty() {
        let image = images[moments.below(images.len() as u64) as usize];
        fs::remove_file(root.join(image)).unwrap();
    }
}

/// Images listed in a record have the recorded hash, whenever the run was killed; missing ones are made again.
fn assert_records_are_true(root: &Path) {
    let Ok(records) = fs::read_dir(root.join(".ppa")) else {
        return;
    };
    for record in records.map(|entry| entry.unwrap().path()) {
        let name = record.file_name().unwrap().to_string_lossy().into_owned();
        if !name.starts_with("patient") {
            continue;
        }
        let record: serde_json::Value =
            serde_json::from_slice(&fs::read(&record).unwrap()).unwrap();
        for row in record["files"].as_array().unwrap() {
            let path = root.join(row["file"].as_str().unwrap());
            if path.exists() {
                let found = ppa_dataset::sha256_of_file(&path).unwrap();
                assert_eq!(found, row["sha256"].as_str().unwrap(), "{name}");
            }
        }
    }
}

#[test]
fn fifty_kills_and_refused_writes_change_no_byte() {
    let folder = tempfile::tempdir().unwrap();
    let here = folder.path();
    write_quick_plan(here);
    let expected = contents(&whole().join("whole"));
    let run = "generate plan.toml --out data --progress quiet";
    let root = here.join("data");

    let mut moments = Moments(0x9E37_79B9_7F4A_7C15);
    let (mut kills, mut refusals) = (0, 0);
    while kills < 50 {
        let wait = Duration::from_millis(moments.below(1000));
        if kill_after(here, run, wait) {
            kills += 1;
            assert_records_are_true(&root);
        } else {
            lose_an_image(&root, &mut moments);
        }
        if kills % 5 == 0 {
            lose_an_image(&root, &mut moments);
            let output = run_with_small_files(here, run, moments.below(8));
            let said = String::from_utf8(output.stderr).unwrap();
            if !output.status.success() {
                refusals += 1;
                assert!(
                    said.contains("cannot write") && said.contains("large"),
                    "{said}"
                );
                assert_eq!(said.trim_end().lines().count(), 1, "{said}");
            }
            assert_records_are_true(&root);
        }
    }
    assert!(refusals > 0, "some writes were refused");
    succeed(here, run);
    assert!(contents(&root) == expected);
}

/// Merging is almost only reading and writing, so a kill often hits it while it handles a file.
#[test]
fn a_merge_that_is_killed_resumes() {
    let folder = tempfile::tempdir().unwrap();
    let here = folder.path();
    write_quick_plan(here);
    succeed(
        here,
        "generate plan.toml --shard 1/1 --out shard --progress quiet",
    );
    let expected = contents(&here.join("shard"));
    let merged = here.join("merged");
    let began = Instant::now();
    succeed(here, "merge shard --out undisturbed");
    let took = began.elapsed().as_micros() as u64;
    let mut moments = Moments(7);
    let (mut kills, mut merges) = (0, 0);
    while kills < 20 {
        merges += 1;
        assert!(
            merges < 400,
            "{kills} of 400 merges were at work when they were killed"
        );
        let wait = Duration::from_micros(moments.below(took));
        if kill_after(here, "merge shard --out merged", wait) {
            kills += 1;
            assert_records_are_true(&merged);
        } else {
            assert!(contents(&merged) == expected);
            fs::remove_dir_all(&merged).unwrap();
        }
        if moments.below(3) == 0 {
            lose_an_image(&merged, &mut moments);
        }
    }
    succeed(here, "merge shard --out merged --verify");
    assert!(contents(&merged) == expected);
}
