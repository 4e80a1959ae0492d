//! A finished dataset with another plan, or with a user who has only read access.

use std::fs;
use std::path::Path;
use std::process::Stdio;
use std::time::{Duration, Instant};

use serde_json::Value;

use crate::shards::{whole, write_quick_plan};
use crate::{contents, fail, ppa, succeed};

/// A folder with the quick plan, one with another tube voltage, and the dataset `data` of the first.
fn two_plans() -> tempfile::TempDir {
    let folder = tempfile::tempdir().unwrap();
    write_quick_plan(folder.path());
    let plan = fs::read_to_string(folder.path().join("plan.toml")).unwrap();
    let other = plan.replace("[xray]\n", "[xray]\nkvp = 70.0\n");
    fs::write(folder.path().join("other.toml"), other).unwrap();
    copy(&whole().join("whole"), &folder.path().join("data"));
    folder
}

fn copy(from: &Path, to: &Path) {
    for (name, bytes) in contents(from) {
        fs::create_dir_all(to.join(&name).parent().unwrap()).unwrap();
        fs::write(to.join(name), bytes).unwrap();
    }
}

#[test]
fn another_plan_changes_a_dataset_only_when_asked_to() {
    let folder = two_plans();
    let here = folder.path();
    let before = contents(&here.join("data"));
    let said = fail(here, "generate other.toml --out data --progress quiet");
    for words in [
        "5 of its 5 poses",
        "settings.xray.kvp is 60.0 in the dataset and 70.0 in this run",
        "--replace",
        "--out",
    ] {
        assert!(said.contains(words), "{said}");
    }
    assert!(contents(&here.join("data")) == before);
    let said = succeed(
        here,
        "generate other.toml --out data --replace --json --progress quiet",
    );
    let summary: Value = serde_json::from_str(&said).unwrap();
    assert_eq!(
        (&summary["made"], &summary["replaced"]),
        (&5.into(), &5.into())
    );
    succeed(here, "dataset check data");
    succeed(here, "generate other.toml --out fresh --progress quiet");
    assert!(contents(&here.join("data")) == contents(&here.join("fresh")));

    // The same for a merge that is killed repeatedly.
    succeed(
        here,
        "generate plan.toml --shard 1/1 --out data --replace --progress quiet",
    );
    let said = fail(here, "merge data --out fresh");
    assert!(
        said.contains("settings.xray.kvp is 70.0 in the dataset and 60.0 in this run"),
        "{said}"
    );
    killed_while_replacing(here);
}

/// Merges `data` over `fresh` and back, with kills in between; each pose belongs to one of the two, or is half replaced and marked as such.
fn killed_while_replacing(here: &Path) {
    copy(&here.join("fresh"), &here.join("other"));
    let whole = ["data", "other"].map(|name| contents(&here.join(name)));
    let merged = here.join("fresh");
    let began = Instant::now();
    succeed(here, "merge data --out fresh --replace");
    let took = began.elapsed().as_micros() as u64;
    let mut kills = 0;
    for moment in 0..24_u64 {
        let from = ["other", "data"][moment as usize % 2];
        let arguments = format!("merge {from} --out fresh --replace");
        let mut run = ppa(here, &arguments);
        let mut run = run
            .stdout(Stdio::null())
            .stderr(Stdio::null())
            .spawn()
            .unwrap();
        std::thread::sleep(Duration::from_micros(took * (1 + moment * 7 % 24) / 25));
        kills += u32::from(run.try_wait().unwrap().is_none());
        run.kill().unwrap();
        run.wait().unwrap();
        let found = contents(&merged);
        for step in [0, 5, 10, 15, 20] {
            if found.contains_key(Path::new(&format!(".ppa/new/patient_3_r_{step:03}.json"))) {
                continue; // the next run completes it
            }
            let angle = format!("_{}.{}.png", step / 2, step % 2 * 5);
            let ends = [
                angle,
                format!("_image_{step}.png"),
                format!("_image_{step}.exr"),
                format!("_r_{step:03}.json"),
            ];
            let of_pose = |name: &&std::path::PathBuf| {
                let name = name.to_str().unwrap();
                !name.starts_with(".ppa/new") && ends.iter().any(|end| name.ends_with(end))
            };
            let is_of = |dataset: &std::collections::BTreeMap<_, _>| {
                found
                    .keys()
                    .filter(of_pose)
                    .all(|name| found.get(name) == dataset.get(name))
                    && dataset
                        .keys()
                        .filter(of_pose)
                        .all(|name| found.contains_key(name))
            };
            assert!(whole.iter().any(is_of), "step {step} is neither whole");
        }
    }
    assert!(kills > 5, "{kills} of 24 merges were at work");
    succeed(here, "merge data --out fresh --replace --verify");
    assert!(contents(&merged) == whole[0]);
}

#[test]
fn flipped_bits_are_found_by_the_program() {
    let folder = two_plans();
    let here = folder.path();
    let root = here.join("data");
    let files: Vec<_> = contents(&root)
        .into_iter()
        .filter(|(_, bytes)| !bytes.is_empty())
        .collect();
    succeed(here, "dataset check data");
    let lists = files.iter().filter(|(name, _)| {
        let name = name.to_str().unwrap();
        name.ends_with("json")
            || name.ends_with("jsonl")
            || name.ends_with("sha256")
            || name.ends_with("_10.exr")
    });
    for (i, (name, bytes)) in lists.enumerate() {
        let mut flipped = bytes.clone();
        let bit = (7919 * (i + 1)) % (8 * bytes.len());
        flipped[bit / 8] ^= 1 << (bit % 8);
        fs::write(root.join(name), flipped).unwrap();
        let output = ppa(here, "dataset check data").output().unwrap();
        assert!(!output.status.success(), "{} bit {bit}", name.display());
        fs::write(root.join(name), bytes).unwrap();
    }
    succeed(here, "dataset check data");
}

/// Runs as another user with read access only, since root may write everywhere.
#[test]
#[cfg(unix)]
fn a_dataset_that_may_only_be_read_is_looked_at() {
    use std::os::unix::fs::{MetadataExt, PermissionsExt};
    use std::os::unix::process::CommandExt;

    let folder = two_plans();
    let here = folder.path();
    let program = here.join("ppa");
    fs::copy(env!("CARGO_BIN_EXE_ppa"), &program).unwrap();
    let allow =
        |path: &Path, mode| fs::set_permissions(path, fs::Permissions::from_mode(mode)).unwrap();
    fs::remove_file(here.join("data/.ppa/lock")).unwrap();
    let all_below = |root: &Path| {
        let mut paths = vec![root.to_owned()];
        let mut at = 0;
        while at < paths.len() {
            if paths[at].is_dir() {
                let entries = fs::read_dir(&paths[at]).unwrap();
                paths.extend(entries.map(|entry| entry.unwrap().path()));
            }
            at += 1;
        }
        paths
    };
    for path in all_below(here) {
        allow(
            &path,
            if path.is_dir() || path == program {
                0o555
            } else {
                0o444
            },
        );
    }
    // Its scan is shared with other tests.
    for path in all_below(crate::phantom()) {
        allow(&path, if path.is_dir() { 0o755 } else { 0o644 });
    }
    let before = contents(&here.join("data"));
    for arguments in [
        "status data",
        "dataset check data",
        "verify data --plan plan.toml --progress quiet",
    ] {
        let mut command = std::process::Command::new(&program);
        command.current_dir(here).args(arguments.split(' '));
        if fs::metadata(here).unwrap().uid() == 0 {
            command.uid(65534).gid(65534);
        }
        let output = command.output().unwrap();
        let said = String::from_utf8_lossy(&output.stderr);
        assert!(output.status.success(), "{arguments}: {said}");
    }
    assert!(contents(&here.join("data")) == before);
    for path in all_below(here).iter().filter(|path| path.is_dir()) {
        allow(path, 0o755);
    }
}
