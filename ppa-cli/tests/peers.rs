//! Datasets read by third-party programs.
//!
//! With a Python that has the packages of the test, PPA_PYTHON or else `python3`:
//! `cargo test -p ppa-cli --features peers --test peers`. Those of the first test are packages of Debian and Ubuntu
//! (python3-pandas, -pil, -opencv, -pydicom), those of the second come with pip: pyarrow, mlcroissant, rocrate, bagit and
//! webdataset.

use std::collections::BTreeMap;
use std::path::Path;
use std::process::Command;
use std::sync::OnceLock;

use ppa_dataset::published::GrayImage16;

fn ppa(folder: &Path, arguments: &str) {
    let mut command = Command::new(env!("CARGO_BIN_EXE_ppa"));
    let arguments = arguments.split_whitespace();
    let out = command.current_dir(folder).args(arguments).output();
    report(out.unwrap());
}

/// Runs a Python script with `folder` as the current folder and returns its output.
fn python(folder: &Path, script: &str) -> String {
    let program = std::env::var_os("PPA_PYTHON").unwrap_or_else(|| "python3".into());
    let mut command = Command::new(program);
    let out = command.current_dir(folder).args(["-c", script]).output();
    report(out.unwrap())
}

fn report(out: std::process::Output) -> String {
    let stderr = String::from_utf8_lossy(&out.stderr);
    assert!(out.status.success(), "{stderr}");
    String::from_utf8(out.stdout).unwrap()
}

/// A folder with the labelled, split and exported dataset `data` of one limb in three poses and two body shapes, and the
/// radiograph `x.png`, `x.dcm`.
fn exported() -> &'static Path {
    static FOLDER: OnceLock<tempfile::TempDir> = OnceLock::new();
    let folder = FOLDER.get_or_init(|| {
        let folder = tempfile::tempdir().unwrap();
        let here = folder.path();
        ppa(here, "ct phantom --out p01.nii --spacing-mm 2 --table");
        ppa(here, "prepare p01.nii --side r --out p01.toml");
        let plan = "version = 1\n[[case]]\nfile = \"p01.toml\"\npatient = 3\n\
                    [rotation]\nfrom_deg = 0.0\nto_deg = 5.0\nstep_deg = 2.5\n\
                    [shapes]\nvariants = [\"orig\", \"big\"]\n\
                    [xray]\nhalf_length_mm = 20.0\ndetector = { columns = 30, rows = 20, pixel_mm = 8.0 }\n\
                    engine = { scatter_histories = 100, scatter_pixel_mm = 200.0 }\n";
        std::fs::write(here.join("plan.toml"), plan).unwrap();
        ppa(here, "generate plan.toml --out data");
        let grades = "image,reader,grade\npatient_3/xray/r/xray_image_5.png,a,1.5\n";
        std::fs::write(here.join("grades.csv"), grades).unwrap();
        ppa(here, "label import data grades.csv");
        ppa(here, "dataset split data --part all=1 --name mine");
        ppa(here, "export table data --out table.parquet --split mine");
        ppa(
            here,
            "export metadata data --split mine --name ankle --date 2026-11-21 \
             --license https://creativecommons.org/licenses/by/4.0/",
        );
        ppa(here, "export bagit data --out bag");
        ppa(here, "export webdataset data --out shards --per-shard 4");
        ppa(
            here,
            "xray simulate p01.toml --angle 18 --engine analog --histories 20000 --out x.png --dicom x.dcm",
        );
        folder
    });
    folder.path()
}

/// Compares every row and every pixel: pandas, Pillow, OpenCV, pydicom.
#[test]
fn pandas_pillow_opencv_and_pydicom_read_tables_and_images() {
    let here = exported();
    let script = r#"
import json
import cv2, numpy, pandas, pydicom
from PIL import Image

# f64 does not hold all seeds.
table = pandas.read_csv("data/manifest.csv", dtype={"seed": "UInt64"})
rows = [json.loads(line) for line in open("data/manifest.jsonl")]
assert len(table) == len(rows) == 3 * (2 * 2 + 2)
for column, of in {"file": str, "sha256": str, "step": int, "angle_deg": float}.items():
    assert [of(value) for value in table[column]] == [row[column] for row in rows], column
for row, seed, pose in zip(rows, table.seed, table.room_from_patient):
    assert row.get("seed") == (None if pandas.isna(seed) else int(seed))
    assert row["room_from_patient"] == json.loads(pose)
labelled = table[table.label.notna()]
assert set(labelled.step) == {5} and set(labelled.label) == {1.5} and set(labelled.label_source) == {"readers"}
assert set(table.split) == {"all"}

def pixels(path):
    by_pillow = numpy.asarray(Image.open(path)).astype(numpy.int64)
    by_opencv = cv2.imread(path, cv2.IMREAD_UNCHANGED)
    assert by_opencv.dtype == numpy.uint16 and by_opencv.ndim == 2, path
    assert (by_pillow == by_opencv).all(), path
    return by_pillow

sums = {}
for path in table.file[table.kind != "radiograph_tallies"]:
    image = pixels("data/" + path)
    weights = numpy.arange(1, image.size + 1).reshape(image.shape) % 251
    sums[path] = [*image.shape, int((image * weights).sum())]

read = pydicom.dcmread("x.dcm")
assert read.SOPClassUID.name.startswith("Digital X-Ray Image Storage"), read.SOPClassUID.name
assert read.Modality == "DX" and read.BitsAllocated == 16 and read.SamplesPerPixel == 1
stored = read.pixel_array.astype(numpy.int64)
radiograph = pixels("x.png")
assert stored.shape == radiograph.shape
# What viewers show as bright is bright in the picture as well.
bright = stored if read.PhotometricInterpretation == "MONOCHROME2" else stored.max() - stored
agreement = numpy.corrcoef(bright.ravel(), radiograph.ravel())[0, 1]
assert agreement > 0.99, agreement
print(json.dumps(sums))
"#;
    let sums = python(here, script);
    let sums: BTreeMap<String, [u64; 3]> = serde_json::from_str(&sums).unwrap();
    assert_eq!(sums.len(), 3 * (2 * 2 + 1));
    for (file, sum) in sums {
        let image = GrayImage16::read(&here.join("data").join(&file)).unwrap();
        let weights = (1..).map(|i| i % 251);
        let of_pixels = image.pixels.iter().zip(weights);
        let found: u64 = of_pixels.map(|(z, w)| u64::from(*z) * w).sum();
        let expected = [image.height.into(), image.width.into(), found];
        assert_eq!(sum, expected, "{file}");
    }
}

/// Uses the validators and readers of the formats themselves.
#[test]
fn pyarrow_mlcroissant_and_others_read_the_exports() {
    let script = r#"
import glob, json, os
import bagit, mlcroissant, pandas, rocrate.rocrate, webdataset

table = pandas.read_csv("data/manifest.csv", dtype={"seed": "UInt64"}, dtype_backend="numpy_nullable")
parquet = pandas.read_parquet("table.parquet", dtype_backend="numpy_nullable")
assert list(table.columns) == list(parquet.columns) and len(table) == len(parquet)
for column in table.columns:
    same = (table[column] == parquet[column]) | (table[column].isna() & parquet[column].isna())
    assert same.all(), column

croissant = mlcroissant.Dataset(jsonld="data/croissant.json")
issues = croissant.metadata.ctx.issues
assert not issues.errors and not issues.warnings, issues.report()
records = list(croissant.records("files"))
assert len(records) == len(table)
assert [record["files/file"].decode() for record in records] == list(table.file)

crate = rocrate.rocrate.ROCrate("data")
hashed = [entity for entity in crate.get_entities() if "sha256" in entity.properties()]
assert len(hashed) == len(table)
assert all(os.path.isfile("data/" + entity.id) for entity in hashed)

bag = bagit.Bag("bag")
bag.validate()
assert not [name for name in bag.entries if "grades.csv" in name]

samples = list(webdataset.WebDataset(sorted(glob.glob("shards/*.tar")), shardshuffle=False))
assert len(samples) == 3 * 2
assert all({"left.png", "right.png", "xray.png", "json"} <= set(sample) for sample in samples)
report = [json.loads(sample["json"]) for sample in samples]
assert sorted({row["step"] for row in report}) == [0, 5, 10]
"#;
    python(exported(), script);
}
