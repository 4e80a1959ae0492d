//! A killed run resumes where it stopped, with the same bytes.

use std::fs;
use std::path::Path;
use std::time::Duration;

use crate::shards::{whole, write_quick_plan};
use crate::{contents, ppa, succeed};

/// Number of poses finished so far.
pub fn records(root: &Path) -> usize {
    fs::read_dir(root.join(".ppa")).map_or(0, |entries| {
        let names = entries.map(|entry| entry.unwrap().file_name());
        names
            .filter(|name| name.to_string_lossy().starts_with("patient"))
            .count()
    })
}

#[test]
fn a_killed_run_resumes_to_the_same_dataset() {
    let folder = tempfile::tempdir().unwrap();
    write_quick_plan(folder.path());

    let killed = folder.path().join("killed");
    let mut run = ppa(folder.path(), "generate plan.toml --out killed --threads 1");
    let mut run = run.stderr(std::process::Stdio::null()).spawn().unwrap();
    while records(&killed) == 0 {
        assert!(
            run.try_wait().unwrap().is_none(),
            "the run ended before its first pose"
        );
        std::thread::sleep(Duration::from_millis(5));
    }
    run.kill().unwrap(); // SIGKILL: the program cannot clean up
    run.wait().unwrap();
    let before = records(&killed);
    assert!(!killed.join("manifest.jsonl").exists());

    let said = succeed(
        folder.path(),
        "generate plan.toml --out killed --threads 2 --json",
    );
    let summary: serde_json::Value = serde_json::from_str(&said).unwrap();
    assert_eq!(summary["units"], 5);
    assert_eq!(summary["made"], 5 - before);
    assert!(contents(&killed) == contents(&whole().join("whole")));
}
