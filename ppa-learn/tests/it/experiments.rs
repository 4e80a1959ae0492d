//! Experiments on toy data, carried out by shards and gathered into tables.

use std::fs;
use std::path::Path;
use std::sync::atomic::{AtomicBool, Ordering};

use ppa_learn::experiment::{Event, Experiment, ExperimentError, ExperimentPlan, Runner, Table};
use tempfile::TempDir;

use crate::toy::dataset;

/// A plan of a few small steps: synthetic images of four persons, preparations of two.
fn plan(folder: &Path, synthetic: &TempDir, preparations: &TempDir, steps: u64) -> ExperimentPlan {
    let [synthetic, preparations] = [synthetic, preparations].map(|folder| folder.path().display());
    let text = format!(
        "seeds = 1\n[training]\npreset = \"quick\"\nside = 32\nsteps = {steps}\nbatch_size = 4\n\
         [synthetic]\ndataset = \"{synthetic}\"\nfolds = 3\ntest_limbs = 1\n\
         [preparations]\ndataset = \"{preparations}\"\nfolds = 2\n"
    );
    let path = folder.join("plan.toml");
    fs::write(&path, text).unwrap();
    ExperimentPlan::read(&path).unwrap()
}

/// Gives the feet of a dataset the other body shapes as well, with the images of `orig`.
fn add_shapes(folder: &TempDir) {
    for patient in fs::read_dir(folder.path()).unwrap() {
        let depth = patient.unwrap().path().join("depth/r");
        for shape in ["big", "small", "bumps_a", "bumps_b"] {
            fs::create_dir(depth.join(shape)).unwrap();
            for image in fs::read_dir(depth.join("orig")).unwrap() {
                let image = image.unwrap();
                fs::copy(image.path(), depth.join(shape).join(image.file_name())).unwrap();
            }
        }
    }
}

fn go() -> AtomicBool {
    AtomicBool::new(false)
}

#[test]
fn probing_is_gathered_from_shards_and_left_as_it_is() {
    let (synthetic, preparations) = (dataset(4, &[0, 90, 180]), dataset(2, &[0, 60, 120, 180]));
    add_shapes(&synthetic);
    let folder = tempfile::tempdir().unwrap();
    let plan = plan(folder.path(), &synthetic, &preparations, 3);
    let root = folder.path().join("runs");
    let runner = Runner::new(&plan, Experiment::TwoC, &root).unwrap();
    // From scratch and two pretrained columns, without ImageNet; two folds, two views.
    assert_eq!(runner.runs().len(), 3 * 2 * 2);
    let mut begun = vec![];
    for shard in 0..3 {
        let finished = runner.run(
            |n| n % 3 == shard,
            &go(),
            |event| {
                if let Event::Begins { unit, .. } = event {
                    begun.push(unit.to_string());
                }
            },
        );
        assert!(finished.unwrap());
    }
    // Twelve runs, and the pretrainings of both views, of the left and of the right one, each once.
    assert_eq!(begun.len(), 12 + 3, "{begun:?}");
    let again = runner.run(|_| true, &go(), |_| panic!("all is finished"));
    assert!(again.unwrap());

    let results = runner.results().unwrap();
    assert!(results.missing().is_empty());
    let table = Table::complete(&results).unwrap().to_markdown();
    assert!(!table.contains("INCOMPLETE"), "{table}");
    let note = "Left out: the column pretrained on ImageNet, since the plan names no such weights.";
    assert!(table.contains(note), "{table}");
    let columns = table.lines().next().unwrap();
    assert!(!columns.contains("ImageNet"), "{columns}");

    // Another number of steps would be another experiment.
    let other = self::plan(folder.path(), &synthetic, &preparations, 4);
    let other = Runner::new(&other, Experiment::TwoC, &root).unwrap();
    let refused = other.run(|_| true, &go(), |_| ());
    assert!(matches!(refused, Err(ExperimentError::OtherSettings(_))));
    let refused = other.results();
    assert!(matches!(refused, Err(ExperimentError::OtherSettings(_))));
}

#[test]
fn an_experiment_resumes_where_it_was_stopped() {
    let data = dataset(4, &[0, 90, 180]);
    add_shapes(&data);
    let folder = tempfile::tempdir().unwrap();
    let plan = plan(folder.path(), &data, &data, 3);
    let root = folder.path().join("runs");
    let runner = Runner::new(&plan, Experiment::One, &root).unwrap();
    let stop = go();
    let ended = runner.run(
        |n| n == 0,
        &stop,
        |event| {
            if let Event::Step(_) = event {
                stop.store(true, Ordering::Relaxed);
            }
        },
    );
    assert!(!ended.unwrap());
    let mut steps = 0;
    let ended = runner.run(
        |n| n == 0,
        &go(),
        |event| {
            steps += u64::from(matches!(event, Event::Step(_)));
        },
    );
    assert!(ended.unwrap());
    assert_eq!(steps, 2, "one of three steps was made before");
}

#[test]
fn nobody_is_tested_whose_images_were_pretrained_with() {
    let data = dataset(4, &[0, 90, 180]);
    add_shapes(&data);
    let folder = tempfile::tempdir().unwrap();
    // The synthetic images stand for the preparations as well.
    let plan = plan(folder.path(), &data, &data, 3);
    let runner = Runner::new(&plan, Experiment::TwoA, folder.path()).unwrap();
    let pretrained = runner.runs().iter().position(|run| run.needs().is_some());
    let refused = runner.run(|n| Some(n) == pretrained, &go(), |_| ());
    let refused = format!("{:#}", anyhow::Error::from(refused.unwrap_err()));
    assert!(refused.contains("would be in training"), "{refused}");
    let clinical = Runner::new(&plan, Experiment::TwoB, folder.path()).unwrap_err();
    assert_eq!(
        clinical.to_string(),
        "experiment 2b needs [clinical] in the plan"
    );
}
