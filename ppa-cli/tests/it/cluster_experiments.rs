//! Experiments as Slurm jobs, one training run per task.
#![cfg(unix)]

use std::fs;
use std::path::Path;

use crate::cluster::{calls, fail, succeed, with_slurm};

/// A plan of experiments on two persons, with all body shapes.
fn write_experiments(folder: &Path) {
    crate::training::write_data(folder);
    for patient in 0..2 {
        let depth = folder.join(format!("data/patient_{patient}/depth/l"));
        for shape in ["big", "small", "bumps_a", "bumps_b"] {
            fs::create_dir(depth.join(shape)).unwrap();
            for image in fs::read_dir(depth.join("orig")).unwrap() {
                let image = image.unwrap();
                fs::copy(image.path(), depth.join(shape).join(image.file_name())).unwrap();
            }
        }
    }
    let plan = "seeds = 1\n[training]\npreset = \"quick\"\nside = 32\nsteps = 1\nbatch_size = 4\n\
        [synthetic]\ndataset = \"data\"\nfolds = 2\ntest_limbs = 1\n";
    fs::write(folder.join("experiments.toml"), plan).unwrap();
}

#[test]
fn each_training_of_an_experiment_is_a_task() {
    let folder = with_slurm();
    let here = folder.path();
    write_experiments(here);
    for (arguments, words) in [
        (
            "experiments.toml --pose-seconds 1",
            "--pose-seconds does not apply to",
        ),
        ("experiments.toml --check", "a plan of experiments"),
        ("experiments.toml --experiments 2a", "needs [preparations]"),
        ("plan.toml --experiments 1", "a plan of poses"),
    ] {
        let said = fail(here, &format!("submit slurm {arguments} --out other"));
        assert!(said.contains(words), "{said}");
    }
    let submit = "submit slurm experiments.toml --out jobs";
    let said = succeed(here, &format!("{submit} --experiments 1 --gres gpu:1"));
    // Four columns, two folds and two cameras, in arrays of two tasks.
    assert_eq!(said["shards"], 16);
    let first = calls(here);
    assert_eq!(first.len(), 8 + 1);
    assert!(first[7].ends_with("training.sh 14"), "{first:?}");
    assert!(
        first[8].contains("--dependency=afterany:1:2:3:4:5:6:7:8 "),
        "{first:?}"
    );
    assert!(first[8].ends_with("tables.sh 1,2,3,4,5,6,7,8"), "{first:?}");
    let script = fs::read_to_string(here.join("jobs/slurm/training.sh")).unwrap();
    assert!(script.contains("#SBATCH --gres=gpu:1\n"), "{script}");

    // The commands of tasks 2 and 3; task 3 is killed before its end.
    let train = |part: &str| {
        let arguments =
            format!("experiment 1 jobs/slurm/plan.toml --out jobs/runs --shard {part}/16");
        crate::succeed(here, &arguments)
    };
    train("2");
    let report = succeed(here, "status jobs");
    let begun = report["shards"][2]["training"].as_str().unwrap().to_owned();
    fs::create_dir_all(here.join("jobs/runs").join(begun)).unwrap();
    let report = succeed(here, "status jobs");
    assert_eq!((&report["made"], &report["units"]), (&1.into(), &16.into()));
    let states: Vec<&str> = report["shards"].as_array().unwrap()[..3]
        .iter()
        .map(|shard| shard["state"].as_str().unwrap())
        .collect();
    assert_eq!(states, ["missing", "done", "failed"]);
    assert_eq!(report["core_hours"], serde_json::json!({"used": 0.0}));

    let said = succeed(here, submit);
    assert_eq!(said["submitted"].as_array().unwrap().len(), 15);
    assert!(!said["submitted"].as_array().unwrap().contains(&2.into()));
    let said = fail(here, &format!("{submit} --experiments ablations"));
    assert!(said.contains("--experiments differ"), "{said}");
    assert!(said.contains("choose another --out"), "{said}");
}
