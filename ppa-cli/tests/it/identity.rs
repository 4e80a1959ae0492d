//! No output reveals a person, a place, a date or an instance of a source.

use std::fs;
use std::io::Read;
use std::path::{Path, PathBuf};

use base64::Engine;
use base64::engine::general_purpose::STANDARD;

use crate::planted_series::{self, DATES, UID_ROOT, WORD};
use crate::{QUICK_XRAY, succeed};

/// Planted words in all text encodings, in lower case.
fn planted() -> Vec<Vec<u8>> {
    let words = [WORD, UID_ROOT].into_iter().chain(DATES);
    let in_encodings = |word: &str| {
        let word = word.to_lowercase();
        let wide = |bytes: fn(u16) -> [u8; 2]| word.encode_utf16().flat_map(bytes).collect();
        [
            word.clone().into_bytes(),
            wide(u16::to_le_bytes),
            wide(u16::to_be_bytes),
        ]
    };
    words.flat_map(in_encodings).collect()
}

/// The first planted word in some bytes.
fn leak(bytes: &[u8]) -> Option<String> {
    let bytes = bytes.to_ascii_lowercase();
    let found = planted()
        .into_iter()
        .find(|word| bytes.windows(word.len()).any(|window| window == word));
    found.map(|word| String::from_utf8_lossy(&word).into_owned())
}

/// All layers of a file: as stored, unpacked, and the pictures inside a page.
fn layers(bytes: Vec<u8>) -> Vec<Vec<u8>> {
    let mut layers = Vec::new();
    if bytes.starts_with(&[0x1f, 0x8b]) {
        let mut unpacked = Vec::new();
        let mut reader = flate2::read::MultiGzDecoder::new(&bytes[..]);
        reader.read_to_end(&mut unpacked).unwrap();
        layers.push(unpacked);
    }
    if bytes.starts_with(b"\x89PNG") {
        assert_plain_png(&bytes);
    }
    if bytes.starts_with(b"<!DOCTYPE html>") {
        let page = String::from_utf8(bytes.clone()).unwrap();
        for picture in page.split("base64,").skip(1) {
            let picture = STANDARD.decode(picture.split('"').next().unwrap()).unwrap();
            assert_plain_png(&picture);
            layers.push(picture);
        }
    }
    layers.push(bytes);
    layers
}

/// Asserts that a PNG contains only pixels: a text chunk could hide its content by compression.
fn assert_plain_png(bytes: &[u8]) {
    let mut at = 8;
    while at < bytes.len() {
        let length = u32::from_be_bytes(bytes[at..at + 4].try_into().unwrap()) as usize;
        let kind = &bytes[at + 4..at + 8];
        assert!(
            [b"IHDR", b"IDAT", b"IEND", b"pHYs"]
                .iter()
                .any(|k| *k == kind),
            "a PNG with a chunk {}",
            String::from_utf8_lossy(kind)
        );
        at += length + 12;
    }
}

/// All files below a folder, including hidden ones.
fn files(folder: &Path) -> Vec<PathBuf> {
    let entries = fs::read_dir(folder).unwrap();
    let paths = entries.map(|entry| entry.unwrap().path());
    paths
        .flat_map(|path| {
            if path.is_dir() {
                files(&path)
            } else {
                vec![path]
            }
        })
        .collect()
}

fn assert_clean(folder: &Path) -> usize {
    let files = files(folder);
    for path in &files {
        let name = path.strip_prefix(folder).unwrap();
        assert_eq!(leak(name.to_str().unwrap().as_bytes()), None, "in a name");
        for layer in layers(fs::read(path).unwrap()) {
            assert_eq!(leak(&layer), None, "in {}", name.display());
        }
    }
    files.len()
}

#[test]
fn no_output_identifies_the_source() {
    let root = tempfile::tempdir().unwrap();
    // Private files of a user, whose names reveal as much as the headers.
    let private = root.path().join(format!("{WORD}-{}", DATES[1]));
    let (scan, out) = (private.join("scan"), root.path().join("out"));
    fs::create_dir_all(&scan).unwrap();
    fs::create_dir(&out).unwrap();
    planted_series::write(&scan);
    let slice = fs::read(scan.join(format!("{WORD}000.dcm"))).unwrap();
    assert!(
        leak(&slice).is_some(),
        "the search must find what was planted"
    );

    let (scan, case, plan) = (
        scan.display().to_string(),
        private.join("case.toml").display().to_string(),
        private.join("plan.toml"),
    );
    let mut said = String::new();
    let mut run = |command: &str| said += &succeed(&out, command);
    run(&format!("ct info {scan} --json --report audit.html"));
    run(&format!("ct info {scan}"));
    for name in [
        "scan.nii",
        "scan.nii.gz",
        "scan.nrrd",
        "scan.mha",
        "scan.mhd",
        "slices",
    ] {
        run(&format!("ct convert {scan} {name} --json"));
    }
    run(&format!(
        "mesh extract {scan} --iso -500 --out iso.ply --json"
    ));
    run(&format!(
        "prepare {scan} --series {UID_ROOT}.1 --side r --limb other --out {case} --ply skin.ply"
    ));
    run(&format!(
        "xray simulate {case} --angle 18 --engine analog --histories 20000 --out x.png --exr x.exr \
         --dicom x.dcm --protocol ankle_mortise --tally x.tally --json"
    ));
    run(&format!("xray audit {case} --json"));
    let settings = format!(
        "version = 1\n[[case]]\nfile = {case:?}\npatient = 3\n\
         [rotation]\nfrom_deg = 0.0\nto_deg = 18.0\nstep_deg = 18.0\n\
         {QUICK_XRAY}"
    );
    fs::write(&plan, settings).unwrap();
    run(&format!("generate {} --out dataset --json", plan.display()));

    #[cfg(feature = "studio")]
    {
        assert_page_clean(&out, &case, &scan);
        assert_page_of_plan_clean(&out, &plan, &scan);
        assert_page_of_dataset_clean(&out, &scan);
    }

    // The output of a command may name the file it writes, but no other.
    for path in [&case, &plan.display().to_string()] {
        said = said.replace(path.as_str(), "");
    }
    assert_eq!(leak(said.as_bytes()), None, "in: {said}");
    let images = assert_clean(&out.join("dataset"));
    assert!(images > 2 * (2 * 5 + 2), "{images} files in the dataset");
    assert!(assert_clean(&out) > images + 8);

    // The case is a working file: it may contain the path of the scan, and nothing else.
    let case = fs::read_to_string(case).unwrap();
    assert_eq!(leak(case.replace(&scan, "").as_bytes()), None, "in: {case}");
}

/// Everything that the program sends to the page of a case; it may name only the files that were opened.
#[cfg(feature = "studio")]
fn assert_page_clean(folder: &Path, case: &str, scan: &str) {
    let served = crate::studio::Served::start(folder, case);
    let what_if = r#"{"angle_deg": 18.0}"#;
    let answers = [
        served.get("/"),
        served.get("/api/state"),
        served.get("/api/skin"),
        served.get("/api/slice/2/3"),
        served.post("/api/room", what_if),
        served.post("/api/depth", what_if),
        served.post("/api/radiograph/first", what_if),
        served.post("/api/commands", what_if),
    ];
    let private = Path::new(case).parent().unwrap().display().to_string();
    assert_answers_clean(&answers, &[scan, &private]);
}

/// The answers name nothing except the files that were opened.
#[cfg(feature = "studio")]
fn assert_answers_clean(answers: &[Vec<u8>], opened: &[&str]) {
    for answer in answers {
        let mut text = String::from_utf8_lossy(answer).into_owned();
        assert!(text.starts_with("HTTP/1.1 200"), "{text}");
        for path in opened {
            text = text.replace(path, "");
        }
        assert_eq!(leak(text.as_bytes()), None, "in: {text}");
    }
}

/// The same for a plan, whose dataset is made and shown.
#[cfg(feature = "studio")]
fn assert_page_of_plan_clean(folder: &Path, plan: &Path, scan: &str) {
    let served = crate::studio::Served::start(folder, &plan.display().to_string());
    let dataset = r#"{"folder": "from_page"}"#;
    let mut answers = vec![
        served.get("/api/plan/form"),
        served.post("/api/plan/key", r#"{"key": "seed", "value": "5"}"#),
        served.post("/api/forecast", dataset),
        served.post("/api/generation", dataset),
    ];
    let running = |answer: &[u8]| String::from_utf8_lossy(answer).contains("\"running\"");
    while answers.last().is_some_and(|answer| running(answer)) {
        std::thread::sleep(std::time::Duration::from_millis(200));
        answers.push(served.get("/api/generation?folder=from_page"));
    }
    answers.push(served.get("/api/contact_sheet/3/r?folder=from_page"));
    answers.push(served.get("/api/generation/shards?folder=from_page"));
    let private = plan.parent().unwrap().display().to_string();
    assert_answers_clean(&answers, &[scan, &private]);
}

/// The same for a dataset.
#[cfg(feature = "studio")]
fn assert_page_of_dataset_clean(folder: &Path, scan: &str) {
    let served = crate::studio::Served::start(folder, "dataset");
    let answers = [
        served.get("/api/opened"),
        served.get("/api/dataset?folder=dataset"),
        served.post("/api/dataset/check", r#"{"folder": "dataset"}"#),
        served.get("/api/dataset/depth/3/r/orig/0?folder=dataset"),
        served.get("/api/dataset/radiograph/3/r/0?folder=dataset"),
    ];
    assert_answers_clean(&answers, &[scan]);
}

/// The search finds words in every wrapping that an output might use.
#[test]
fn the_search_finds_what_is_hidden() {
    let wide = WORD
        .encode_utf16()
        .flat_map(u16::to_le_bytes)
        .collect::<Vec<_>>();
    let mut packed = flate2::write::GzEncoder::new(Vec::new(), flate2::Compression::best());
    std::io::Write::write_all(
        &mut packed,
        format!("a {} b", WORD.to_uppercase()).as_bytes(),
    )
    .unwrap();
    for bytes in [
        wide,
        packed.finish().unwrap(),
        format!("x{UID_ROOT}.5").into_bytes(),
    ] {
        assert!(layers(bytes).iter().any(|layer| leak(layer).is_some()));
    }
    assert_eq!(leak(b"harmless 19370518"), None);
}
