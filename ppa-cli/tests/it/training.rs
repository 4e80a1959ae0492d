//! Training and evaluation as a user runs them.

use std::fs;
use std::path::Path;
use std::time::Duration;

use crate::{contains, fail, names, ppa, succeed};

/// Two persons with three poses each, seen by both cameras, and a configuration of few and small steps.
pub fn write_data(folder: &Path) {
    for patient in 0..2 {
        write_person(&folder.join("data"), patient, &[0, 90, 180]);
    }
    let config = "preset = \"quick\"\nside = 32\nsteps = 8\nbatch_size = 4\nlog_every = 1\ncheckpoint_every = 2\n\
        [[training]]\ndataset = \"data\"\npatients = [0]\n[[evaluation]]\ndataset = \"data\"\npatients = [1]\n";
    fs::write(folder.join("train.toml"), config).unwrap();
}

/// Writes one person into a dataset; `steps` are rotations in units of half a degree.
pub fn write_person(dataset: &Path, patient: u32, steps: &[u32]) {
    let root = dataset.join(format!("patient_{patient}"));
    let (depth, labels) = (root.join("depth/l/orig"), root.join("labels/l"));
    fs::create_dir_all(&depth).unwrap();
    fs::create_dir_all(&labels).unwrap();
    let mut grades = serde_json::Map::new();
    let mut rois = serde_json::Map::new();
    for &step in steps {
        for (view, nearer) in [("cam_left", 0), ("cam_right", 90)] {
            let name = format!("depth_{view}_{:.1}.png", f64::from(step) / 2.0);
            let value =
                |x, y| image::Luma([(700 - nearer + step + (x * y + 20 * patient) % 300) as u16]);
            image::ImageBuffer::from_fn(50, 50, value)
                .save(depth.join(&name))
                .unwrap();
            let roi = serde_json::json!({"camera": view, "image_number": step, "x_start": 1, "y_start": 2, "size": 45});
            rois.insert(name, roi);
        }
        let label = 1.0 + f64::from(step) / 90.0;
        let grade = serde_json::json!({"label": label, "std": 0.0, "step": step});
        grades.insert(format!("xray_image_{step}.png"), grade);
    }
    for (name, entries) in [("labels.json", grades), ("roi_depth.json", rois)] {
        fs::write(labels.join(name), serde_json::to_string(&entries).unwrap()).unwrap();
    }
}

#[test]
fn a_killed_training_resumes_to_the_same_weights() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    write_data(folder);
    succeed(folder, "train train.toml --out whole");

    let mut run = ppa(folder, "train train.toml --out killed");
    let mut run = run.stderr(std::process::Stdio::null()).spawn().unwrap();
    while !folder.join("killed/checkpoint.safetensors").exists() {
        assert!(
            run.try_wait().unwrap().is_none(),
            "it ended before its first checkpoint"
        );
        std::thread::sleep(Duration::from_millis(5));
    }
    run.kill().unwrap(); // SIGKILL: the program gets no chance to tidy up
    run.wait().unwrap();
    assert!(!folder.join("killed/weights.safetensors").exists());
    let refused = fail(folder, "eval killed");
    assert!(
        refused.contains("is not finished: ") && refused.contains(" of 8 steps are done"),
        "{refused}"
    );
    let said = ppa(folder, "train train.toml --out killed --threads 2 --json")
        .output()
        .unwrap();
    let notes = String::from_utf8(said.stderr).unwrap();
    assert!(
        notes.contains("{\"note\":\"resuming after ") && notes.contains(" of 8 steps\"}"),
        "{notes}"
    );
    let said: serde_json::Value = serde_json::from_slice(&said.stdout).unwrap();
    assert_eq!(
        (&said["finished"], &said["step"]),
        (&true.into(), &8.into())
    );
    for file in [
        "weights.safetensors",
        "checkpoint.safetensors",
        "config.toml",
    ] {
        let read = |run: &str| fs::read(folder.join(run).join(file)).unwrap();
        assert!(read("whole") == read("killed"), "{file}");
    }

    let said = succeed(folder, "eval whole --json");
    let said: serde_json::Value = serde_json::from_str(&said).unwrap();
    assert_eq!(
        (&said["images"]["n"], &said["persons"][0]["patient"]),
        (&3.into(), &1.into())
    );
    let files = names(&folder.join("whole/evaluation"));
    assert_eq!(files.len(), 15, "{files:?}");
    let table = fs::read_to_string(folder.join("whole/evaluation/predictions.csv")).unwrap();
    let header = "id,dataset,camera,patient,side,pose,frame,angle_deg,label,prediction,\
        correction_deg,predicted_correction_deg";
    assert_eq!(table.lines().next(), Some(header));
    assert_eq!(table.lines().count(), 4);
    let refused = fail(folder, "eval whole");
    assert!(refused.contains("--replace"), "{refused}");
    fs::write(folder.join("whole/evaluation/predictions.csv"), "old").unwrap();
    succeed(folder, "eval whole --replace");
    let again = fs::read_to_string(folder.join("whole/evaluation/predictions.csv")).unwrap();
    assert_eq!(again, table);
}

#[test]
fn an_experiment_names_all_missing_data_before_it_trains() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    write_data(folder);
    let plan = "seeds = 2\n[training]\npreset = \"quick\"\n[synthetic]\ndataset = \"data\"\nfolds = 2\ntest_limbs = 1\n";
    fs::write(folder.join("plan.toml"), plan).unwrap();
    let said = fail(folder, "experiment 1 plan.toml --out runs");
    // Without variants of the skin, one of four columns can be made for each fold and view.
    assert!(
        said.contains("12 of 16 training runs of each seed"),
        "{said}"
    );
    for shape in ["big", "small", "bumps_a", "bumps_b"] {
        let missing = format!("there is no image of body shape {shape}");
        assert!(said.contains(&missing), "{said}");
    }
    let said = fail(folder, "experiment 1 plan.toml --out runs --columns bumps");
    assert!(!said.contains("body shape big"), "{said}");
    assert!(said.contains("body shape bumps_a"), "{said}");
    assert!(!folder.join("runs").exists());
}

#[test]
fn an_experiment_makes_the_chosen_columns_only() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    write_data(folder);
    let plan = "seeds = 1\n[training]\npreset = \"quick\"\nsteps = 1\n[synthetic]\ndataset = \"data\"\nfolds = 2\ntest_limbs = 1\n";
    fs::write(folder.join("plan.toml"), plan).unwrap();
    let columns = |names| format!("experiment 1 plan.toml --out runs --columns {names}");
    let said = fail(folder, &columns("original,skin"));
    let expected = "--columns: found skin, expected some of original, size, bumps, all";
    assert!(said.contains(expected), "{said}");
    let said = succeed(folder, &columns("original"));
    let expected = "the requested training runs are finished; 6 test sets are missing from the whole experiment";
    assert!(said.contains(expected), "{said}");
    assert_eq!(names(&folder.join("runs/experiment_1")), ["original"]);
    assert!(!folder.join("runs/experiment_1.md").exists());
    succeed(folder, "experiment 1 plan.toml --out runs --so-far");
    let table = fs::read_to_string(folder.join("runs/experiment_1.md")).unwrap();
    assert!(
        table.contains("INCOMPLETE: 6 test sets are missing"),
        "{table}"
    );
    // Everything for which the plan has data: experiment 1 and its variations.
    let all = "experiment all plan.toml --out runs --so-far --replace";
    let said = succeed(folder, &format!("{all} --json"));
    let said: serde_json::Value = serde_json::from_str(&said).unwrap();
    let experiments = said["experiments"].as_array().unwrap().iter();
    let experiments: Vec<_> = experiments.map(|one| &one["experiment"]).collect();
    assert_eq!(experiments, ["1", "shapes", "ablations"]);
    assert!(folder.join("runs/experiment_ablations.md").exists());
    let refused = fail(folder, "experiment all plan.toml --out runs --columns all");
    assert!(
        refused.contains("--columns names columns of one experiment"),
        "{refused}"
    );
}

#[test]
fn bad_trainings_are_reported_in_one_sentence() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    write_data(folder);
    let config = fs::read_to_string(folder.join("train.toml")).unwrap();
    fs::write(folder.join("leak.toml"), config.replace("[1]", "[0]")).unwrap();
    let said = fail(folder, "train leak.toml --out run");
    assert!(
        said.contains("a person must be in only one of them"),
        "{said}"
    );
    fs::write(folder.join("nobody.toml"), config.replace("[1]", "[5]")).unwrap();
    assert!(fail(folder, "train nobody.toml --out run").contains("patient 5"));
    fs::write(folder.join("typo.toml"), config.replace("steps", "stepz")).unwrap();
    assert!(fail(folder, "train typo.toml --out run").contains("stepz"));
    fs::create_dir(folder.join("own")).unwrap();
    fs::write(folder.join("own/config.toml"), "# mine").unwrap();
    let said = fail(folder, "train train.toml --out own");
    assert!(
        said.contains("own/config.toml holds another configuration"),
        "{said}"
    );
    assert_eq!(names(&folder.join("own")), ["config.toml"]);
    assert_eq!(fs::read(folder.join("own/config.toml")).unwrap(), b"# mine");
    assert!(!folder.join("run").exists());
    assert!(fail(folder, "eval run").contains("config.toml"));
}

/// Ctrl-C saves the current step, so no step is repeated.
#[cfg(unix)]
#[test]
fn an_interrupted_training_saves_its_step() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    write_data(folder);
    let config = fs::read_to_string(folder.join("train.toml")).unwrap();
    let config = config
        .replace("steps = 8", "steps = 5000")
        .replace("checkpoint_every = 2", "checkpoint_every = 5000");
    fs::write(folder.join("train.toml"), config).unwrap();
    let mut run = ppa(folder, "train train.toml --out run --json");
    let mut run = run
        .stderr(std::process::Stdio::piped())
        .stdout(std::process::Stdio::piped())
        .spawn()
        .unwrap();
    let log = folder.join("run/log.jsonl");
    while fs::metadata(&log).map_or(0, |log| log.len()) == 0 {
        assert!(
            run.try_wait().unwrap().is_none(),
            "it ended before its first step"
        );
        std::thread::sleep(Duration::from_millis(5));
    }
    let interrupt = std::process::Command::new("kill")
        .args(["-INT", &run.id().to_string()])
        .status();
    assert!(interrupt.unwrap().success());
    let said = run.wait_with_output().unwrap();
    assert_eq!(said.status.code(), Some(130));
    contains(
        &String::from_utf8_lossy(&said.stderr),
        &[
            "of 5000 steps; repeat the command to resume",
            "\"exit_code\":130",
        ],
    );
    let said: serde_json::Value = serde_json::from_slice(&said.stdout).unwrap();
    assert_eq!(said["finished"], false);
    let text = fs::read_to_string(log).unwrap();
    assert_eq!(said["step"], text.lines().count());
    assert!(folder.join("run/checkpoint.safetensors").exists());
}

#[test]
fn tables_are_marked_while_results_are_missing() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    write_data(folder);
    let plan = "seeds = 2\n[training]\npreset = \"quick\"\n[synthetic]\ndataset = \"data\"\nfolds = 1\ntest_limbs = 1\n\
        [preparations]\ndataset = \"data\"\nfolds = 2\n";
    fs::write(folder.join("plan.toml"), plan).unwrap();
    let said = succeed(folder, "experiment 2a plan.toml --out runs --so-far --json");
    let said: serde_json::Value = serde_json::from_str(&said).unwrap();
    // Without the ImageNet column, for which the plan has no weights.
    assert_eq!(said["missing"], 9 * 2 * 2);
    assert_eq!(said["finished"], false);
    assert_eq!(said["permutation_test"], serde_json::Value::Null);
    let table = fs::read_to_string(folder.join("runs/experiment_2a.md")).unwrap();
    assert!(table.contains("INCOMPLETE: 36 test sets"), "{table}");
    // A different table is kept; writing the same one again is allowed.
    succeed(folder, "experiment 2a plan.toml --out runs --so-far");
    fs::write(folder.join("runs/experiment_2a.md"), "notes").unwrap();
    for so_far in ["--so-far", ""] {
        let command = format!("experiment 2a plan.toml --out runs {so_far}");
        let refused = ppa(folder, &command).output().unwrap();
        assert!(!refused.status.success());
        let said = String::from_utf8(refused.stderr).unwrap();
        contains(
            &said,
            &[
                "does not specify imagenet_weights",
                "experiment_2a.md exists",
            ],
        );
    }
    succeed(
        folder,
        "experiment 2a plan.toml --out runs --so-far --replace",
    );
    let again = fs::read_to_string(folder.join("runs/experiment_2a.md")).unwrap();
    assert_eq!(again, table);
    let report = "experiment report plan.toml --runs runs --out page.html";
    let said = succeed(folder, report);
    let expected = [
        "Experiment 2a: finetuning on preparations",
        "36 test sets are missing",
    ];
    contains(&said, &expected);
    let page = fs::read_to_string(folder.join("page.html")).unwrap();
    contains(&page, &expected);
    contains(&page, &["paper 0.22±0.06"]);
    let refused = fail(folder, report);
    assert!(refused.contains("page.html exists"), "{refused}");
    let refused = fail(folder, "experiment 2b plan.toml --out runs --so-far");
    assert!(refused.contains("2b needs [clinical]"), "{refused}");
    fs::write(
        folder.join("plan.toml"),
        plan.replace("seeds = 2", "seeds = 41"),
    )
    .unwrap();
    let refused = fail(folder, "experiment 2a plan.toml --out runs --so-far");
    assert!(
        refused.contains("seeds is 41, expected 1 to 40"),
        "{refused}"
    );
    fs::write(folder.join("plan.toml"), plan.replace("quick", "fast")).unwrap();
    let refused = fail(folder, "experiment 2a plan.toml --out runs --so-far");
    assert!(
        refused.contains("plan.toml: unknown preset \"fast\""),
        "{refused}"
    );
}
