//! Prediction on streams of depth images as a user meets it.

use std::collections::BTreeMap;
use std::fs;
use std::io::{BufRead, BufReader, Write};
use std::path::Path;
use std::process::{Command, Stdio};
use std::sync::OnceLock;

use serde_json::Value;

use crate::training::{write_data, write_person};
use crate::{contains, fail, ppa, succeed};

const REGIONS: &str = "--roi-left 1,2,45 --roi-right 1,2,45";

/// A folder with data and networks of the left camera, the right camera, both as single views, and pairs, each after one step; those
/// named `mirrored_` see left limbs mirrored to right ones.
pub fn trained() -> &'static Path {
    static FOLDER: OnceLock<tempfile::TempDir> = OnceLock::new();
    let folder = FOLDER.get_or_init(|| {
        let folder = tempfile::tempdir().unwrap();
        write_data(folder.path());
        let config = fs::read_to_string(folder.path().join("train.toml")).unwrap();
        let config = config.replace("steps = 8", "steps = 1");
        for views in ["left", "right", "unified", "pairs"] {
            for (run, mirror) in [
                (views.to_owned(), false),
                (format!("mirrored_{views}"), true),
            ] {
                // With the initial values of torchvision and statistics of the training images, outputs depend on the images
                // after one step.
                let text = format!("views = {views:?}\nmirror = {mirror}\nrecompute_statistics = 4\nnetwork.last_layer = \"torchvision\"\n{config}");
                fs::write(folder.path().join(format!("{run}.toml")), text).unwrap();
                succeed(folder.path(), &format!("train {run}.toml --out {run}"));
            }
        }
        folder
    });
    folder.path()
}

/// Runs a command with `input`; returns its lines of JSON and its stderr.
fn answers(mut command: Command, input: impl AsRef<[u8]>) -> (Vec<Value>, String) {
    let pipes = command.stdin(Stdio::piped()).stdout(Stdio::piped());
    let mut run = pipes.stderr(Stdio::piped()).spawn().unwrap();
    run.stdin.take().unwrap().write_all(input.as_ref()).unwrap();
    let output = run.wait_with_output().unwrap();
    let stderr = String::from_utf8(output.stderr).unwrap();
    assert!(output.status.success(), "{stderr}");
    let lines = std::str::from_utf8(&output.stdout).unwrap().lines();
    let lines = lines.map(|line| serde_json::from_str(line).unwrap());
    (lines.collect(), stderr)
}

/// Output of `ppa eval` for each image of person 1.
fn evaluated(folder: &Path, run: &str) -> BTreeMap<String, f64> {
    succeed(folder, &format!("eval {run}"));
    let table = folder.join(run).join("evaluation/predictions.csv");
    let mut rows = csv::Reader::from_path(table).unwrap();
    let rows = rows.deserialize::<BTreeMap<String, String>>();
    rows.map(|row| row.unwrap())
        .map(|row| (row["id"].clone(), row["prediction"].parse().unwrap()))
        .collect()
}

#[test]
fn pairs_on_stdin_get_the_predictions_of_evaluation() {
    let folder = trained();
    let image =
        |view: &str, angle: &str| format!("patient_1/depth/l/orig/depth_cam_{view}_{angle}.png");
    let mut input = String::new();
    for angle in ["0.0", "45.0", "90.0"] {
        let [left, right] = ["left", "right"].map(|view| image(view, angle));
        input += &format!("data/{left}\tdata/{right}\n");
    }
    let (lines, _) = answers(
        ppa(folder, &format!("predict left right {REGIONS} --stdin")),
        &input,
    );
    let [left, right] = ["left", "right"].map(|run| evaluated(folder, run));
    assert_eq!(lines.len(), 3);
    for (line, angle) in lines.iter().zip(["0.0", "45.0", "90.0"]) {
        let expected = [left[&image("left", angle)], right[&image("right", angle)]];
        let close = |key: &str, expected: f64| {
            let found = line[key].as_f64().unwrap();
            assert!(
                (found - expected).abs() < 1e-5 * expected.abs(),
                "{key} {line}"
            );
        };
        close("left", expected[0]);
        close("right", expected[1]);
        close("quality", (expected[0] + expected[1]) / 2.0);
        assert!(line["latency_ms"].as_f64().unwrap() > 0.0);
    }
    // One network for both images.
    let (lines, _) = answers(
        ppa(folder, &format!("predict pairs {REGIONS} --stdin")),
        &input,
    );
    let pairs = evaluated(folder, "pairs");
    assert_eq!((lines.len(), pairs.len()), (3, 3));
    for (line, angle) in lines.iter().zip(["0.0", "45.0", "90.0"]) {
        let (found, expected) = (
            line["quality"].as_f64().unwrap(),
            pairs[&image("left", angle)],
        );
        assert!((found - expected).abs() < 1e-5 * expected.abs(), "{line}");
        assert!(line.get("left").is_none());
    }
    // A network for either view, with any number of threads.
    let both = ["1", "2"].map(|threads| {
        let command = format!("predict unified {REGIONS} --stdin --threads {threads}");
        let (lines, _) = answers(ppa(folder, &command), &input);
        let bits =
            |line: &Value| ["left", "right"].map(|key| line[key].as_f64().unwrap().to_bits());
        lines.iter().map(bits).collect::<Vec<_>>()
    });
    assert_eq!(both[0], both[1]);
}

/// The frames show a left limb: the left camera's network sees the mirrored frame of the right camera, and vice versa.
#[test]
fn a_left_limb_is_mirrored_in_prediction_as_in_training() {
    let folder = trained();
    let image = |view: &str| format!("patient_1/depth/l/orig/depth_cam_{view}_45.0.png");
    let [left, right] = ["left", "right"].map(image);
    let input = format!("data/{left}\tdata/{right}\n");
    let predict = |runs: &str| {
        let command = format!("predict {runs} {REGIONS} --stdin");
        answers(ppa(folder, &command), &input).0.remove(0)
    };
    let [by_left, by_right, joint] =
        ["mirrored_left", "mirrored_right", "mirrored_pairs"].map(|run| evaluated(folder, run));
    let near = |found: &Value, expected: f64| {
        let found = found.as_f64().unwrap();
        assert!(
            (found - expected).abs() < 1e-5 * expected.abs(),
            "{found}, {expected}"
        );
    };
    let line = predict("mirrored_left mirrored_right --side l");
    near(&line["left"], by_right[&left]);
    near(&line["right"], by_left[&right]);
    let spread = (by_right[&left] - by_left[&right]).abs();
    assert!(spread > 1e-3 * by_right[&left].abs(), "{line}");
    let line = predict("mirrored_pairs --side l");
    near(&line["quality"], joint[&right]);
    // Frames of a right limb are not mirrored.
    let other = predict("mirrored_pairs --side r")["quality"].as_f64();
    let spread = (other.unwrap() - joint[&right]).abs();
    assert!(spread > 1e-3 * joint[&right].abs(), "{line}");
    // Networks trained without mirroring ignore the side.
    assert_eq!(
        predict("pairs --side l")["quality"],
        predict("pairs")["quality"]
    );

    contains(
        &fail(folder, &format!("predict mirrored_pairs {REGIONS} --stdin")),
        &[
            "--side l or --side r",
            "mirrored_pairs was trained with mirror = true",
        ],
    );
    contains(
        &fail(
            folder,
            &format!("predict left mirrored_right {REGIONS} --side l --stdin"),
        ),
        &[
            "left was trained with mirror = false",
            "mirrored_right with mirror = true",
        ],
    );
    contains(
        &fail(folder, "learn export left mirrored_right --out mixed.onnx"),
        &["was trained with mirror = true, the other was not"],
    );
    // An exported file contains all that its network needs to know.
    for name in ["mirrored.onnx", "mirrored.safetensors"] {
        succeed(folder, &format!("learn export mirrored_left --out {name}"));
        let bytes = fs::read(folder.join(name)).unwrap();
        assert!(bytes.windows(6).any(|bytes| bytes == b"mirror"), "{name}");
    }
}

#[test]
fn frames_that_cannot_be_used_are_named_and_skipped() {
    let folder = trained();
    let good = "data/patient_1/depth/l/orig/depth_cam_left_0.0.png";
    let whole = fs::read(folder.join(good)).unwrap();
    fs::write(folder.join("half.png"), &whole[..whole.len() / 2]).unwrap();
    image::GrayImage::new(50, 50)
        .save(folder.join("bits.png"))
        .unwrap();
    let wide = image::ImageBuffer::<image::Luma<u16>, Vec<u16>>::new(60, 50);
    wide.save(folder.join("wide.png")).unwrap();
    let bad = ["half.png", "bits.png", "wide.png", "nowhere.png"];
    let mut input = format!("{good}\t{good}\nno tab here\n");
    for bad in bad {
        input += &format!("{bad}\t{good}\n");
    }
    let mut input = input.into_bytes();
    input.extend(b"K\xf6ln\tbonn\n"); // Not UTF-8.
    input.extend(format!("{good}\t{good}\r\n").bytes());
    let command = format!("predict unified {REGIONS} --stdin --json");
    let (lines, stderr) = answers(ppa(folder, &command), &input);
    let [first, last, summary] = &lines[..] else {
        panic!("{lines:?}")
    };
    assert_eq!(first["quality"], last["quality"]);
    assert_eq!(
        (&summary["pairs"], &summary["skipped"]),
        (&2.into(), &6.into())
    );
    assert!(summary["pairs_per_s"].as_f64().unwrap() > 0.0);
    assert!(summary["latency_95_ms"].as_f64() >= summary["median_latency_ms"].as_f64());
    assert_eq!(stderr.lines().count(), 6, "{stderr}");
    contains(&stderr, &bad);
    contains(&stderr, &["line 2", "line 7", "60x50", "expected 50x50"]);

    contains(
        &fail(folder, &format!("predict right left {REGIONS} --stdin")),
        &["right was trained with views = \"right\"", "left camera's"],
    );
    contains(
        &fail(folder, &format!("predict data {REGIONS} --stdin")),
        &["config.toml"],
    );
    let nowhere = format!("predict unified {REGIONS} --watch nowhere");
    contains(&fail(folder, &nowhere), &["nowhere"]);
}

/// A slow recorder; Ctrl-C ends with a summary.
#[cfg(unix)]
#[test]
fn a_folder_is_watched_until_ctrl_c() {
    let folder = trained();
    let stream = folder.join("stream");
    fs::create_dir(&stream).unwrap();
    let frame = |view: &str| {
        let name = format!("data/patient_1/depth/l/orig/depth_cam_{view}_0.0.png");
        fs::read(folder.join(name)).unwrap()
    };
    let put = |view: &str, name: &str, bytes: &[u8]| {
        fs::write(stream.join(format!("depth_cam_{view}_{name}.png")), bytes).unwrap();
    };
    let (left, right) = (frame("left"), frame("right"));
    put("left", "1", &left);
    put("right", "1", &right);
    put("left", "alone", &left);
    let command = format!("predict unified {REGIONS} --watch stream --json");
    let mut run = ppa(folder, &command);
    let mut run = run.stdout(Stdio::piped()).spawn().unwrap();
    let mut lines = BufReader::new(run.stdout.take().unwrap()).lines();
    let mut next = || -> Value { serde_json::from_str(&lines.next().unwrap().unwrap()).unwrap() };
    let first = next();
    assert_eq!(first["name"], "1");
    put("left", "2", &left[..left.len() - 5]);
    put("right", "2", &right);
    put("right", "3", &right);
    put("left", "3", &left);
    assert_eq!(next()["name"], "3");
    put("left", "2", &left);
    let second = next();
    assert_eq!(
        (&second["name"], &second["quality"]),
        (&"2".into(), &first["quality"])
    );
    let interrupt = Command::new("kill")
        .args(["-INT", &run.id().to_string()])
        .status();
    assert!(interrupt.unwrap().success());
    let summary = next();
    assert_eq!(
        (&summary["pairs"], &summary["skipped"], &summary["alone"]),
        (&3.into(), &0.into(), &1.into())
    );
    assert!(run.wait().unwrap().success());
}

#[test]
fn calibration_adds_intervals_and_refuses_odd_frames() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    let steps: Vec<u32> = (0..=180).step_by(9).collect();
    for patient in 0..6 {
        write_person(&folder.join("data"), patient, &steps);
    }
    let config = "preset = \"quick\"\nviews = \"unified\"\nside = 32\nsteps = 1\nbatch_size = 4\nevaluation = []\n\
        [[training]]\ndataset = \"data\"\npatients = [0]\n";
    for (run, seed) in [("run", 1), ("other", 2)] {
        let text = format!("seed = {seed}\n{config}");
        fs::write(folder.join(format!("{run}.toml")), text).unwrap();
        succeed(folder, &format!("train {run}.toml --out {run}"));
    }
    let calibrate = |patients: &str| {
        format!("calibrate run --dataset data --patients {patients} --out trust.safetensors")
    };
    contains(&fail(folder, &calibrate("0,1")), &["patient 0"]);
    contains(
        &fail(folder, &calibrate("1")),
        &["21 calibration images, expected at least 5 and 99"],
    );
    let said = succeed(folder, &calibrate("1,2,3,4,5"));
    contains(&said, &["105 pairs of 5 persons", "90.0 %"]);
    contains(&fail(folder, &calibrate("1,2,3,4,5")), &["--replace"]);

    let good = |view| format!("data/patient_2/depth/l/orig/depth_cam_{view}_45.0.png");
    let black = image::ImageBuffer::<image::Luma<u16>, Vec<u16>>::new(50, 50);
    black.save(folder.join("black.png")).unwrap();
    let (left, right) = (good("left"), good("right"));
    let input = format!("{left}\t{right}\n{left}\tblack.png\n");
    let predict = |run: &str| {
        format!("predict {run} {REGIONS} --side l --confidence trust.safetensors --stdin")
    };
    let (lines, stderr) = answers(ppa(folder, &predict("run")), &input);
    let [line] = &lines[..] else {
        panic!("{lines:?}")
    };
    let [low, high] = [0, 1].map(|end| line["interval"][end].as_f64().unwrap());
    assert!(1.0 <= low && low <= high && high <= 3.0, "{line}");
    let diagnostic = line["diagnostic"].as_str().unwrap();
    assert!(["yes", "no", "not_sure"].contains(&diagnostic), "{line}");
    contains(&stderr, &["black.png is unlike the training images: "]);
    let other = fail(folder, &predict("other"));
    contains(&other, &["trust.safetensors", "other networks"]);
}
