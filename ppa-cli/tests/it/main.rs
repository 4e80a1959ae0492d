//! Tests of the program as a user runs it.

mod archives;
mod auto_labels;
mod bad_geometry;
mod bad_input;
mod case_files;
mod cluster;
mod cluster_experiments;
mod cluster_histories;
mod constants;
mod conversion;
mod coverage;
mod damaged;
mod datasets;
mod depth;
mod faults;
mod gates;
mod gates_carried;
mod grading;
mod hostile;
mod identity;
mod interrupts;
mod json;
mod labels;
mod mcgpu;
mod network_files;
mod outputs;
mod phantoms;
mod planted_series;
mod positioning;
mod prediction;
mod reading;
mod replacing;
mod resume;
mod room_file;
mod shards;
mod soft_tissue;
#[cfg(feature = "studio")]
mod studio;
mod tallies;
mod terminal;
mod training;
mod views;

use std::collections::BTreeMap;
use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;
use std::sync::OnceLock;

/// `ppa` with arguments, in a folder.
fn ppa(folder: &Path, arguments: &str) -> Command {
    let mut command = Command::new(env!("CARGO_BIN_EXE_ppa"));
    command
        .current_dir(folder)
        .args(arguments.split_whitespace())
        // Nothing is stored outside the folder: no folder can be made there.
        .env("XDG_STATE_HOME", "/dev/null");
    command
}

/// Runs `ppa`, expects success, and returns stdout.
fn succeed(folder: &Path, arguments: &str) -> String {
    let output = ppa(folder, arguments).output().unwrap();
    let stderr = String::from_utf8_lossy(&output.stderr);
    assert!(output.status.success(), "ppa {arguments}: {stderr}");
    String::from_utf8(output.stdout).unwrap()
}

/// Runs `ppa`, expects a failure reported in one sentence, and returns the sentence.
fn fail(folder: &Path, arguments: &str) -> String {
    let output = ppa(folder, arguments).output().unwrap();
    let stderr = String::from_utf8(output.stderr).unwrap();
    assert!(!output.status.success(), "ppa {arguments} succeeded");
    assert!(output.stdout.is_empty(), "ppa {arguments} printed a result");
    assert!(!stderr.contains("panicked"), "{stderr}");
    assert_eq!(stderr.trim_end().lines().count(), 1, "{stderr}");
    assert!(!shows_debug(&stderr), "a message for programmers: {stderr}");
    stderr
}

/// Whether a message shows a value in Rust's `{:?}` form: an option, a struct, or a list of numbers with decimals.
fn shows_debug(message: &str) -> bool {
    let is_type = |word: &str| {
        word.starts_with(|c: char| c.is_ascii_uppercase())
            && word.contains(|c: char| c.is_ascii_lowercase())
            && word.chars().all(char::is_alphanumeric)
    };
    let words: Vec<&str> = message.split(' ').collect();
    let is_struct = |pair: &[&str]| is_type(pair[0]) && pair[1] == "{";
    message.contains("Some(")
        || words
            .iter()
            .any(|word| word.trim_end_matches([',', ';', ':', '\n']) == "None")
        || words.windows(2).any(is_struct)
}

#[test]
fn debug_values_are_told_from_text() {
    for message in [
        "found Some(3)",
        "side is None, expected",
        "crop Box { low: 3 }",
    ] {
        assert!(shows_debug(message), "{message}");
    }
    for message in ["material \"Nonesuch\"", "expected {\"a\": 1}", "CT { and }"] {
        assert!(!shows_debug(message), "{message}");
    }
}

/// Asserts that a text contains all parts.
fn contains(text: &str, parts: &[&str]) {
    for part in parts {
        assert!(text.contains(part), "{part:?} is missing in: {text}");
    }
}

/// Names of the files in a folder.
fn names(folder: &Path) -> Vec<String> {
    let entries = fs::read_dir(folder).unwrap();
    let mut names: Vec<_> = entries
        .map(|entry| entry.unwrap().file_name().into_string().unwrap())
        .collect();
    names.sort();
    names
}

/// All files below a folder, with their bytes.
fn contents(root: &Path) -> BTreeMap<PathBuf, Vec<u8>> {
    let mut files = BTreeMap::new();
    let mut folders = vec![root.to_owned()];
    while let Some(folder) = folders.pop() {
        for entry in fs::read_dir(folder).unwrap() {
            let path = entry.unwrap().path();
            if path.is_dir() {
                folders.push(path);
            } else {
                let name = path.strip_prefix(root).unwrap().to_owned();
                files.insert(name, fs::read(&path).unwrap());
            }
        }
    }
    files
}

/// A folder with a coarse phantom `p01.nii` and its case `p01.toml`, made by the program itself.
fn phantom() -> &'static Path {
    static FOLDER: OnceLock<tempfile::TempDir> = OnceLock::new();
    let folder = FOLDER.get_or_init(|| {
        let folder = tempfile::tempdir().unwrap();
        succeed(
            folder.path(),
            "ct phantom --out p01.nii --spacing-mm 2 --table",
        );
        succeed(
            folder.path(),
            "prepare p01.nii --side r --out p01.toml --ply p01.ply",
        );
        folder
    });
    folder.path()
}

/// Fast radiographs: few pixels and few voxels.
const QUICK_XRAY: &str = "[xray]\nhalf_length_mm = 20.0\nmax_voxel_mm = 5.0\n\
    detector = { columns = 8, rows = 8, pixel_mm = 25.0 }\n\
    engine = { scatter_histories = 100, scatter_pixel_mm = 200.0, samples_per_side = 1, \
    compton_model = \"incoherent_function\" }\n";

/// Fast depth images: few pixels, with cameras at the built-in positions. A run renders the empty room once, which with the
/// built-in cameras takes longer than everything else in a run over finished poses.
const QUICK_DEPTH: &str = "[depth.cameras.left]\n\
    camera = { model = \"pinhole\", width = 80, height = 72, fx = 63.0, fy = 63.0, cx = 39.5, cy = 35.5 }\n\
    device_from_camera = [[0.9757162520935707, 0.0, 0.2190383423066972, -220.0], [0.0, 1.0, 0.0, 0.0], \
    [-0.2190383423066972, 0.0, 0.9757162520935707, 60.0], [0.0, 0.0, 0.0, 1.0]]\n\
    [depth.cameras.right]\n\
    camera = { model = \"pinhole\", width = 80, height = 72, fx = 63.0, fy = 63.0, cx = 39.5, cy = 35.5 }\n\
    device_from_camera = [[0.9757162520935707, 0.0, -0.2190383423066972, 220.0], [0.0, 1.0, 0.0, 0.0], \
    [0.2190383423066972, 0.0, 0.9757162520935707, 60.0], [0.0, 0.0, 0.0, 1.0]]\n";

/// Writes a plan of five quick poses of the phantom's case and returns its path; `more` begins among the keys of `[xray]`.
fn write_plan(folder: &Path, more: &str) -> PathBuf {
    let case = phantom().join("p01.toml");
    let plan = format!(
        "version = 1\n[[case]]\nfile = {case:?}\npatient = 3\n\
         [rotation]\nfrom_deg = 0.0\nto_deg = 10.0\nstep_deg = 2.5\n\
         {QUICK_XRAY}{more}"
    );
    let path = folder.join("plan.toml");
    fs::write(&path, plan).unwrap();
    path
}

/// The folder of shared test data next to the project.
fn shared() -> PathBuf {
    match std::env::var_os("PPA_SHARED") {
        Some(folder) => folder.into(),
        None => Path::new(env!("CARGO_MANIFEST_DIR")).join("../../shared"),
    }
}
