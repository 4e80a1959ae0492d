//! Shards of a plan, merged to the bytes of a single run; and the cost of a plan.

use std::fs;
use std::path::Path;
use std::sync::OnceLock;

use serde_json::Value;

use crate::{QUICK_DEPTH, QUICK_XRAY, contents, fail, phantom, ppa, succeed, write_plan};

/// Writes a plan of five quick poses and two body shapes.
pub fn write_quick_plan(folder: &Path) {
    let shapes = "[shapes]\nvariants = [\"orig\", \"bumps_a\"]\n";
    write_plan(folder, &format!("{shapes}{QUICK_DEPTH}"));
}

/// A folder with the quick plan and its dataset `whole`, made by one run with two threads.
pub fn whole() -> &'static Path {
    static FOLDER: OnceLock<tempfile::TempDir> = OnceLock::new();
    let folder = FOLDER.get_or_init(|| {
        let folder = tempfile::tempdir().unwrap();
        write_quick_plan(folder.path());
        succeed(folder.path(), "generate plan.toml --out whole --threads 2");
        folder
    });
    folder.path()
}

fn make_shards(out: &Path, count: u32, threads: u32) -> String {
    let plan = whole().join("plan.toml");
    let mut folders = String::new();
    for k in 1..=count {
        let arguments = format!(
            "generate {} --shard {k}/{count} --out s{k} --threads {threads}",
            plan.display()
        );
        succeed(out, &arguments);
        folders += &format!(" s{k}");
    }
    folders
}

#[test]
fn shards_merge_to_the_bytes_of_one_run() {
    merged_shards_are_one_run(&[(3, 1), (7, 2)]);
}

#[test]
#[ignore = "67 runs take half a minute"]
fn one_to_sixty_four_shards_merge_to_the_bytes_of_one_run() {
    merged_shards_are_one_run(&[(1, 1), (2, 2), (64, 1)]);
}

/// Checks each pair of numbers of shards and threads.
fn merged_shards_are_one_run(cases: &[(u32, u32)]) {
    let expected = contents(&whole().join("whole"));
    for &(count, threads) in cases {
        let folder = tempfile::tempdir().unwrap();
        let shards = make_shards(folder.path(), count, threads);
        let said = succeed(
            folder.path(),
            &format!("merge{shards} --out merged --verify --threads {threads}"),
        );
        assert!(said.contains("5 poses"), "{said}");
        let merged = contents(&folder.path().join("merged"));
        assert_eq!(
            merged.keys().collect::<Vec<_>>(),
            expected.keys().collect::<Vec<_>>()
        );
        for (file, bytes) in &expected {
            assert!(
                bytes == &merged[file],
                "{count}: {} differs",
                file.display()
            );
        }
    }
}

#[test]
fn overlaps_holes_and_strangers_are_refused() {
    let folder = tempfile::tempdir().unwrap();
    let here = folder.path();
    make_shards(here, 2, 2);
    let plan = whole().join("plan.toml");
    let refused = |arguments: &str, words: &[&str]| {
        let said = fail(here, arguments);
        for word in words {
            assert!(said.contains(word), "{said}");
        }
        assert!(!here.join("merged").exists(), "{arguments} wrote something");
    };
    refused("merge s1 --out merged", &["no shard holds", " of 5 poses"]);
    refused("merge s1 s1 s2 --out merged", &["both s1 and s1 hold"]);
    refused("merge s1 s2 --out s1", &["s1 is one of the shards"]);
    refused("merge s1 nowhere --out merged", &["nowhere"]);
    let whole = whole().join("whole").display().to_string();
    refused(
        &format!("merge s1 {whole} --out merged"),
        &["both s1 and", "at 0.0 degrees"],
    );
    let other = format!(
        "generate {} --seed 5 --shard 2/2 --out other",
        plan.display()
    );
    succeed(here, &other);
    refused(
        "merge s1 other --out merged",
        &["different datasets", "settings.seed"],
    );
    let second = format!("generate {} --shard 2/2 --out s1", plan.display());
    refused(&second, &["s1 holds shard 1/2", "shard 2/2", "--shard 1/2"]);
    refused(
        &format!("generate {} --replace --out s1", plan.display()),
        &["s1 holds shard 1/2", "the whole plan"],
    );

    // A damaged image stops the merge, which continues once the shard is repaired.
    let image = "patient_3/depth/r/orig/depth_cam_left_10.0.png";
    let bytes = fs::read(here.join("s2").join(image)).unwrap();
    fs::write(here.join("s2").join(image), &bytes[..bytes.len() / 2]).unwrap();
    let said = fail(here, "merge s1 s2 --out merged");
    assert!(
        said.contains("depth_cam_left_10.0.png is altered"),
        "{said}"
    );
    succeed(here, &second.replace("s1", "s2"));
    succeed(here, "merge s1 s2 --out merged --verify");
    assert!(contents(&here.join("merged")) == contents(Path::new(&whole)));
}

#[test]
fn the_shard_is_taken_from_the_environment_and_must_agree() {
    let folder = tempfile::tempdir().unwrap();
    let plan = whole().join("plan.toml");
    let run = |arguments: &str| {
        let mut command = ppa(
            folder.path(),
            &format!("generate {} --json --out part {arguments}", plan.display()),
        );
        command.env("OMPI_COMM_WORLD_RANK", "2");
        command.env("OMPI_COMM_WORLD_SIZE", "3");
        command.output().unwrap()
    };
    let refused = run("--shard 1/3");
    let said = String::from_utf8(refused.stderr).unwrap();
    assert!(!refused.status.success());
    assert!(
        said.contains("--shard means shard 1/3, but OMPI_COMM_WORLD_RANK means 3/3"),
        "{said}"
    );
    assert!(!folder.path().join("part").exists());
    let made = run("");
    assert!(made.status.success());
    let summary: Value = serde_json::from_slice(&made.stdout).unwrap();
    assert_eq!(summary["units"], 2);
    let status: Value =
        serde_json::from_str(&succeed(folder.path(), "status part --json")).unwrap();
    assert_eq!(
        (&status["part"], &status["made"]),
        (&"3/3".into(), &2.into())
    );
}

/// `sbatch --array=2` after one of seven tasks was lost.
#[test]
fn a_task_of_an_array_that_runs_again_keeps_its_shard() {
    let folder = tempfile::tempdir().unwrap();
    let plan = whole().join("plan.toml");
    let run = |out: &str| {
        let arguments = format!(
            "generate {} --json --progress quiet --out {out}",
            plan.display()
        );
        let mut command = ppa(folder.path(), &arguments);
        for (name, value) in [
            ("ID", "2"),
            ("COUNT", "1"),
            ("MIN", "2"),
            ("MAX", "2"),
            ("STEP", "1"),
        ] {
            command.env(format!("SLURM_ARRAY_TASK_{name}"), value);
        }
        command.output().unwrap()
    };
    let refused = run("shard_2");
    let said = String::from_utf8(refused.stderr).unwrap();
    assert!(
        !refused.status.success() && said.contains("does not determine the shard; give --shard"),
        "{said}"
    );
    assert!(!folder.path().join("shard_2").exists());
    succeed(
        folder.path(),
        &format!("generate {} --shard 2/7 --out shard_2", plan.display()),
    );
    let before = contents(&folder.path().join("shard_2"));
    fs::remove_file(folder.path().join("shard_2/manifest.jsonl")).unwrap();
    let again = run("shard_2");
    assert!(
        again.status.success(),
        "{}",
        String::from_utf8_lossy(&again.stderr)
    );
    assert!(contents(&folder.path().join("shard_2")) == before);
}

#[test]
fn limbs_made_at_once_have_the_bytes_of_one_after_another() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    succeed(
        folder,
        "ct phantom --name P02 --out p02.nii --spacing-mm 2 --table",
    );
    succeed(folder, "prepare p02.nii --side r --out p02.toml");
    let first = phantom().join("p01.toml");
    let plan = format!(
        "version = 1\n[[case]]\nfile = {first:?}\npatient = 0\n[[case]]\nfile = \"p02.toml\"\npatient = 1\n\
         [rotation]\nfrom_deg = 0.0\nto_deg = 10.0\nstep_deg = 10.0\n{QUICK_XRAY}{QUICK_DEPTH}"
    );
    fs::write(folder.join("plan.toml"), plan).unwrap();
    // Limbs are made one at a time for every four threads.
    for threads in [1, 8] {
        succeed(
            folder,
            &format!("generate plan.toml --out of_{threads} --threads {threads}"),
        );
    }
    let one_after_another = contents(&folder.join("of_1"));
    assert!(one_after_another.len() > 40, "{}", one_after_another.len());
    assert!(contents(&folder.join("of_8")) == one_after_another);
    succeed(
        folder,
        "verify of_8 --plan plan.toml --fraction 1 --threads 8",
    );
}

#[test]
fn images_stay_below_the_disk_limit() {
    let folder = tempfile::tempdir().unwrap();
    let plan = whole().join("plan.toml").display().to_string();
    let said = fail(
        folder.path(),
        &format!("generate {plan} --out data --disk-limit 13kB --threads 2 --progress quiet"),
    );
    assert!(said.contains("more than 13000 bytes"), "{said}");
    let said = succeed(folder.path(), "status data --json");
    let status: Value = serde_json::from_str(&said).unwrap();
    let bytes = status["bytes"].as_u64().unwrap();
    assert!(0 < bytes && bytes <= 13_000, "{status}");
    let images = contents(&folder.path().join("data"));
    let images = images
        .iter()
        .filter(|(name, _)| name.starts_with("patient_3"));
    assert_eq!(
        images.map(|(_, image)| image.len() as u64).sum::<u64>(),
        bytes
    );
    succeed(folder.path(), &format!("generate {plan} --out data"));
    assert!(contents(&folder.path().join("data")) == contents(&whole().join("whole")));
}

#[test]
fn a_plan_tells_what_it_takes_or_why_it_cannot_work() {
    let folder = tempfile::tempdir().unwrap();
    write_quick_plan(folder.path());
    let said = succeed(
        folder.path(),
        "plan plan.toml --fraction 0.4 --cluster nodes=2,cores=4,cpus=2 --json",
    );
    let report: Value = serde_json::from_str(&said).unwrap();
    let counts = ["limbs", "units", "depth_images", "radiographs", "measured"];
    assert_eq!(
        counts.map(|key| report[key].as_u64().unwrap()),
        [1, 5, 20, 5, 2]
    );
    let number = |key: &str| report[key].as_f64().unwrap();
    let expected = (number("cpu_s_per_limb") + 5.0 * number("cpu_s_per_unit")) / 3600.0;
    assert!(
        (number("cpu_hours") / expected - 1.0).abs() < 1e-9,
        "{report}"
    );
    // A short plan is one task with two cores.
    let cluster = |key: &str| report["cluster"][key].as_f64().unwrap();
    assert_eq!((cluster("shards"), cluster("at_once")), (1.0, 1.0));
    let task_s = number("cpu_s_per_limb") + 2.5 * number("cpu_s_per_unit");
    assert!((cluster("task_s") / task_s - 1.0).abs() < 1e-6, "{report}");
    assert!(cluster("core_hours") >= 2.0 * task_s / 3600.0, "{report}");
    assert_eq!(
        crate::names(folder.path()),
        ["plan.toml"],
        "nothing was made"
    );
    let made: usize = contents(&whole().join("whole"))
        .iter()
        .filter(|(name, _)| name.extension().is_some_and(|e| e == "png" || e == "exr"))
        .map(|(_, bytes)| bytes.len())
        .sum();
    let ratio = number("bytes") / made as f64;
    assert!((0.95..1.05).contains(&ratio), "forecast over made: {ratio}");

    let text = fs::read_to_string(folder.path().join("plan.toml")).unwrap();
    for (from, to, words) in [
        ("p01.toml", "p02.toml", ["cannot read", "p02.toml"]),
        ("half_length_mm = 20.0", "kvp = 500.0", ["500", "kV"]),
        (
            "to_deg = 10.0",
            "to_deg = 10.2",
            ["to_deg is 10.2", "multiple of 0.5"],
        ),
        ("columns = 8", "columns = 0", ["detector", "0"]),
    ] {
        assert!(text.contains(from));
        fs::write(folder.path().join("bad.toml"), text.replace(from, to)).unwrap();
        let said = fail(folder.path(), "plan bad.toml");
        for word in words {
            assert!(said.contains(word), "{said}");
        }
    }
}

#[test]
fn one_scan_under_two_numbers_is_refused() {
    let folder = tempfile::tempdir().unwrap();
    write_quick_plan(folder.path());
    let text = fs::read_to_string(folder.path().join("plan.toml")).unwrap();
    let case = &text[text.find("[[case]]").unwrap()..text.find("[rotation]").unwrap()];
    for (patient, words) in [
        ("4", "same scan, but are patients 3 and 4"),
        ("3", "both the r limb of patient 3"),
    ] {
        let again = case.replace("patient = 3", &format!("patient = {patient}"));
        let twice = text.replace("[rotation]", &format!("{again}[rotation]"));
        fs::write(folder.path().join("twice.toml"), twice).unwrap();
        let said = fail(
            folder.path(),
            "generate twice.toml --out data --progress quiet",
        );
        assert!(said.contains(words), "{said}");
        assert!(!folder.path().join("data").exists());
    }
}
