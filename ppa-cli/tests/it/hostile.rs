//! Input that could hang the program or kill it without a message: pipes, devices, and less memory than a scan needs.
#![cfg(unix)]

use std::fs;
use std::os::unix::fs::symlink;
use std::path::Path;
use std::process::{Command, Output, Stdio};
use std::thread::sleep;
use std::time::{Duration, Instant};

use crate::{contains, fail, names, phantom, ppa, shared};

/// Output of a command that must end by itself; after a minute it is killed and the test fails.
fn ended(mut command: Command) -> Output {
    let mut child = command
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()
        .unwrap();
    let start = Instant::now();
    while child.try_wait().unwrap().is_none() {
        if start.elapsed() > Duration::from_secs(60) {
            child.kill().unwrap();
            panic!("still running: {command:?}");
        }
        sleep(Duration::from_millis(5));
    }
    child.wait_with_output().unwrap()
}

/// Returns the one-sentence message of a failure.
fn sentence(output: &Output) -> String {
    let said = String::from_utf8(output.stderr.clone()).unwrap();
    assert_eq!(output.status.code(), Some(1), "{said}");
    assert_eq!(said.trim_end().lines().count(), 1, "{said}");
    said
}

fn make_pipe(path: &Path) {
    assert!(Command::new("mkfifo").arg(path).status().unwrap().success());
}

#[test]
fn named_pipes_are_refused_wherever_a_file_is_named() {
    let folder = tempfile::tempdir().unwrap();
    let here = folder.path();
    make_pipe(&here.join("pipe"));
    let pipes = [
        "s.nii",
        "s.nii.gz",
        "s.nrrd",
        "s.mha",
        "s.dcm",
        "v.raw",
        "m.ply",
        "m.obj",
        "m.stl",
        "t.toml",
        "c.csv",
        "i.in",
        "t.tally",
        "w.safetensors",
        "w.pth",
    ];
    for name in pipes {
        symlink("pipe", here.join(name)).unwrap();
    }
    let nrrd = "NRRD0004\ntype: short\ndimension: 3\nsizes: 2 2 2\nspace: left-posterior-superior\n\
        space directions: (1,0,0) (0,1,0) (0,0,1)\nspace origin: (0,0,0)\nendian: little\nencoding: raw\ndata file: v.raw\n";
    fs::write(here.join("h.nhdr"), nrrd).unwrap();
    let meta = "ObjectType = Image\nNDims = 3\nDimSize = 2 2 2\nElementSpacing = 1 1 1\nElementType = MET_SHORT\n\
        ElementDataFile = v.raw\n";
    fs::write(here.join("h.mhd"), meta).unwrap();
    let before = names(here);
    for command in [
        "ct info pipe",
        "ct info s.nii",
        "ct info s.nii.gz",
        "ct info s.nrrd",
        "ct info s.mha",
        "ct info s.dcm",
        "ct convert s.nii out.nrrd",
        "prepare s.nii --side r --out case.toml",
        "xray audit t.toml",
        "xray mcgpu i.in --out out",
        "xray merge t.tally --out x.png",
        "plan t.toml",
        "generate t.toml --out data",
        "scene plane m.ply",
        "depth render m.obj --out depth.png",
        "depth render m.stl --out depth.png",
        "depth project c.csv",
        "metrics c.csv",
        "label agree c.csv",
        "train t.toml --out run",
        "experiment 2a t.toml --out runs",
        "learn export w.safetensors --out n.onnx",
        "learn export w.pth --out n.onnx",
    ] {
        let said = sentence(&ended(ppa(here, command)));
        contains(&said, &["found a named pipe, expected a regular file"]);
    }
    for (command, pipe) in [("ct info h.nhdr", "v.raw"), ("ct info h.mhd", "v.raw")] {
        // A link that remains next to the header points to the pipe.
        contains(
            &sentence(&ended(ppa(here, command))),
            &[pipe, "a named pipe"],
        );
    }
    contains(&fail(here, "ct info /dev/zero"), &["/dev/zero", "a device"]);
    assert_eq!(names(here), before, "nothing was written");
}

/// Runs `ppa` with an address space of `megabytes`, which also replaces LIMIT in its arguments. Returns whether it
/// succeeded; a failure must be reported in one sentence.
fn with_memory(folder: &Path, megabytes: usize, arguments: &str) -> bool {
    let arguments = arguments.replace("LIMIT", &megabytes.to_string());
    let script = format!("ulimit -v {}; exec \"$0\" {arguments}", 1024 * megabytes);
    let mut command = Command::new("sh");
    command
        .current_dir(folder)
        .args(["-c", &script, env!("CARGO_BIN_EXE_ppa")])
        // glibc reserves address space for every thread that allocates.
        .env("MALLOC_ARENA_MAX", "1");
    let output = ended(command);
    if !output.status.success() {
        sentence(&output);
    }
    output.status.success()
}

/// Number of successes and failures at limits from barely more than the program itself needs to enough.
fn over_limits(folder: &Path, arguments: &str) -> (usize, usize) {
    let (enough, short): (Vec<_>, Vec<_>) = [100, 200, 300, 500, 900]
        .into_iter()
        .partition(|&megabytes| with_memory(folder, megabytes, arguments));
    (enough.len(), short.len())
}

#[test]
fn too_little_memory_is_reported() {
    let folder = tempfile::tempdir().unwrap();
    let here = folder.path();
    // 384^3 voxels of 4 bytes behind a phantom's header: 226 MB of zeros that take no disk space.
    let side = 384_u16;
    let mut bytes = fs::read(phantom().join("p01.nii")).unwrap();
    bytes.truncate(352);
    for at in [42, 44, 46] {
        bytes[at..at + 2].copy_from_slice(&side.to_le_bytes());
    }
    let path = here.join("zeros.nii");
    fs::write(&path, bytes).unwrap();
    let file = fs::File::options().write(true).open(&path).unwrap();
    file.set_len(352 + 4 * u64::from(side).pow(3)).unwrap();
    for command in ["ct info zeros.nii", "ct convert zeros.nii LIMIT.nrrd"] {
        let (enough, short) = over_limits(here, &format!("--threads 2 {command}"));
        assert!(enough > 0 && short > 0, "{command}: {enough}, {short}");
    }
}

#[test]
#[ignore = "needs ../shared/data"]
fn a_real_limb_in_too_little_memory_is_refused() {
    let folder = tempfile::tempdir().unwrap();
    let scan = shared().join("data/lower-leg-ankle-sts049/dicom");
    let scan = scan.canonicalize().unwrap();
    for command in ["ct info", "prepare"] {
        let rest = match command {
            "prepare" => "--side r --out LIMIT.toml",
            _ => "",
        };
        let arguments = format!("--threads 2 {command} {} {rest}", scan.display());
        let (enough, _) = over_limits(folder.path(), &arguments);
        assert!(enough > 0, "{command}");
    }
}

/// Spreadsheets execute such cells when they open `grades.csv`.
#[test]
fn readers_whose_names_are_formulas_are_refused() {
    let folder = tempfile::tempdir().unwrap();
    let here = folder.path();
    for reader in ["=cmd|calc!A1", "+1", "-1", "@SUM(A1)"] {
        fs::write(
            here.join("g.csv"),
            format!("image,reader,grade\nx.png,{reader},1.5\n"),
        )
        .unwrap();
        contains(
            &fail(here, "label agree g.csv"),
            &["g.csv", reader, "formula"],
        );
    }
}
