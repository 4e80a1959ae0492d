//! Shared code of the fuzz targets: turns bytes into a file for a reader of ppa.

mod dicom;

use std::fs;
use std::path::{Path, PathBuf};
use std::sync::LazyLock;

use dicom::dicom_file;
use ppa_ct::ReadOptions;
use ppa_dataset::labels::LabelFile;
use ppa_dataset::layout::{LimbId, Side};
use ppa_dataset::published::Published;
use ppa_dataset::{Manifest, Split};
use ppa_label::{import_grades, read_key};

/// One folder per process; its files are overwritten in every run.
static FOLDER: LazyLock<PathBuf> =
    LazyLock::new(|| tempfile::tempdir().expect("a folder for files").keep());

/// Calls a reader with the path of a file that holds `bytes`.
pub fn with_file(name: &str, bytes: &[u8], read: impl FnOnce(&Path)) {
    let path = FOLDER.join(name);
    fs::write(&path, bytes).expect("room for a file");
    read(&path);
}

/// Options that read everything that can be read.
pub fn forced() -> ReadOptions {
    ReadOptions {
        series: None,
        fill_gaps: true,
        force: true,
    }
}

/// Reads a DICOM file with one compressed frame. `data` is a byte each of columns, rows and bits, then the frame.
pub fn read_frame(syntax: &str, data: &[u8]) {
    let [columns, rows, bits, frame @ ..] = data else {
        return;
    };
    let file = dicom_file(syntax, [*columns, *rows], *bits, frame);
    with_file("frame.dcm", &file, |path| {
        let _ = ppa_ct::read(path);
    });
}

/// Reads a table as grades and as a key, for a dataset without a radiograph.
pub fn read_grades(data: &[u8]) {
    let root = FOLDER.join("graded");
    fs::create_dir_all(&root).expect("room for a folder");
    let manifest = Manifest {
        root,
        files: Vec::new(),
    };
    with_file("grades.csv", data, |path| {
        let _ = read_key(path);
        let _ = import_grades(&manifest, &[], &[path.to_owned()]);
    });
}

/// Reads the lists of a dataset, one of which contains `data`.
pub fn read_dataset(kind: u8, data: &[u8]) {
    let limb = LimbId {
        patient: 0,
        side: Side::Right,
    };
    let names = [
        "manifest.jsonl",
        "patient_0/labels/r/labels.json",
        "patient_0/labels/r/roi_depth.json",
        "splits/default.json",
    ];
    let root = FOLDER.join("dataset");
    let name = names[usize::from(kind) % names.len()];
    let path = root.join(name);
    let folder = path.parent().expect("a file lies in a folder");
    fs::create_dir_all(folder).expect("room for a folder");
    fs::write(&path, data).expect("room for a file");
    if let Ok(manifest) = Manifest::read(&root) {
        let _ = manifest.rois(limb);
    }
    let _ = LabelFile::read(&root, limb);
    let _ = Split::read(&path);
    let _ = Published::read(&root);
    fs::remove_file(&path).expect("the file is there");
}
