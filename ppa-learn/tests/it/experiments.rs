//! Experiments on toy data, run in shards and collected into tables.

use std::fs;
use std::path::Path;
use std::sync::atomic::{AtomicBool, Ordering};

use ppa_learn::evaluate::BaselineKind;
use ppa_learn::experiment::{
    Event, Experiment, ExperimentError, ExperimentPlan, Metric, Results, Runner, Table, Training,
};
use tempfile::TempDir;

use crate::toy::dataset;

/// A plan with a few small steps: synthetic images of four persons, preparations of two.
fn plan(folder: &Path, synthetic: &TempDir, preparations: &TempDir, steps: u64) -> ExperimentPlan {
    let [synthetic, preparations] = [synthetic, preparations].map(|folder| folder.path().display());
    let text = format!(
        "seeds = 1\n[training]\npreset = \"quick\"\nside = 32\nsteps = {steps}\nbatch_size = 4\n\
         [synthetic]\ndataset = \"{synthetic}\"\nfolds = 2\ntest_limbs = 1\n\
         [preparations]\ndataset = \"{preparations}\"\nfolds = 2\n"
    );
    let path = folder.join("plan.toml");
    fs::write(&path, text).unwrap();
    ExperimentPlan::read(&path).unwrap()
}

/// Adds the other body shapes to a dataset, with the images of `orig`.
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

/// The line with the headings of a table, which may follow a warning.
fn headings(table: &str) -> &str {
    let headings = |line: &&str| line.starts_with("| Metric |");
    table.lines().find(headings).unwrap()
}

fn go() -> AtomicBool {
    AtomicBool::new(false)
}

#[test]
fn a_run_that_waits_for_another_process_can_be_stopped() {
    let (synthetic, preparations) = (dataset(4, &[0, 90]), dataset(2, &[0, 90]));
    add_shapes(&synthetic);
    let folder = tempfile::tempdir().unwrap();
    let plan = plan(folder.path(), &synthetic, &preparations, 1);
    let root = folder.path().join("runs");
    let runner = Runner::new(&plan, Experiment::One, &root).unwrap();
    let first = root.join(runner.runs()[0].to_string());
    fs::create_dir_all(&first).unwrap();
    let held = fs::File::create(first.join("lock")).unwrap();
    held.lock().unwrap();
    let stop = AtomicBool::new(true);
    let finished = runner.run(|n| n == 0, &stop, |_| panic!("it is locked"));
    assert!(!finished.unwrap());
    drop(held);
    assert!(runner.run(|n| n == 0, &go(), |_| ()).unwrap());
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
                if let Event::Begins { training, .. } = event {
                    begun.push(training.to_string());
                }
            },
        );
        assert!(finished.unwrap());
    }
    // Twelve runs, and one pretraining run each for both views, the left and the right one.
    assert_eq!(begun.len(), 12 + 3, "{begun:?}");
    let again = runner.run(|_| true, &go(), |_| panic!("all is finished"));
    assert!(again.unwrap());

    let mut results = runner.results().unwrap();
    assert!(results.missing().is_empty());
    runner.add_baselines(&mut results).unwrap();
    let table = Table::complete(&results).unwrap().to_markdown();
    assert!(!table.contains("INCOMPLETE"), "{table}");
    let note = "Left out: the column pretrained on ImageNet, because the plan does not specify such weights.";
    assert!(table.contains(note), "{table}");
    let columns = headings(&table);
    assert!(!columns.contains("ImageNet"), "{columns}");
    assert!(
        columns.ends_with(" | constant | mean by true angle | kernel ridge |"),
        "{columns}"
    );
    assert!(
        table.contains("\n\nfrom scratch: The network's MAE, "),
        "{table}"
    );
    // Read from the files written the first time.
    let first = results.comparisons();
    let mut results = runner.results().unwrap();
    runner.add_baselines(&mut results).unwrap();
    assert_eq!(results.comparisons(), first);

    // Other folds may test other persons: those results are refused too.
    let refused = (1..20).filter(|&seed| {
        let mut other = plan.clone();
        other.fold_seed = seed;
        let runner = Runner::new(&other, Experiment::TwoC, &root).unwrap();
        matches!(runner.results(), Err(ExperimentError::OtherSettings(_)))
    });
    assert!((1..19).contains(&refused.count()));

    // Another number of steps would be another experiment.
    let other = self::plan(folder.path(), &synthetic, &preparations, 4);
    let other = Runner::new(&other, Experiment::TwoC, &root).unwrap();
    let refused = other.run(|_| true, &go(), |_| ());
    assert!(matches!(refused, Err(ExperimentError::OtherSettings(_))));
    let refused = other.results();
    assert!(matches!(refused, Err(ExperimentError::OtherSettings(_))));
    let refused = other.add_baselines(&mut results);
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

/// The plan with columns for numbers of persons and poses.
fn with_learning_curves(folder: &Path, data: &TempDir, persons: &str) -> ExperimentPlan {
    plan(folder, data, data, 2);
    let path = folder.join("plan.toml");
    let text = fs::read_to_string(&path).unwrap();
    let curves =
        format!("[learning_curves]\npersons = {persons}\nevery_pose = [2, 1]\nseeds = 2\n");
    fs::write(&path, text + &curves).unwrap();
    ExperimentPlan::read(&path).unwrap()
}

#[test]
fn learning_curves_have_a_column_for_each_amount() {
    let data = dataset(4, &[0, 90, 180]);
    let folder = tempfile::tempdir().unwrap();
    let plan = with_learning_curves(folder.path(), &data, "[1, 3]");
    let root = folder.path().join("runs");
    let mut ridges = Vec::new();
    for (experiment, columns) in [
        (
            Experiment::Persons,
            "| Metric | 1 person | 3 persons | constant ",
        ),
        (
            Experiment::Poses,
            "| Metric | every pose of 2 | every pose | constant ",
        ),
    ] {
        let runner = Runner::new(&plan, experiment, &root).unwrap();
        assert!(runner.run(|_| true, &go(), |_| ()).unwrap());
        let mut results = runner.results().unwrap();
        runner.add_baselines(&mut results).unwrap();
        let table = Table::complete(&results).unwrap().to_markdown();
        assert!(headings(&table).starts_with(columns), "{table}");
        assert_eq!(results.planned_seeds(), 2, "those of learning curves");
        ridges.push(results.of_baseline(BaselineKind::KernelRidge, Metric::Mae));
    }
    assert!(ridges[0].is_some());
    assert_eq!(ridges[0], ridges[1], "baselines of all data");
    let data_of = |unit: &str| {
        let path = root.join(unit).join("fold_0/cam_left/seed_1/finished.json");
        let record: serde_json::Value =
            serde_json::from_str(&fs::read_to_string(path).unwrap()).unwrap();
        record["data_sha256"].clone()
    };
    let [one, three] =
        ["1-person", "3-persons"].map(|n| data_of(&format!("experiment_persons/{n}")));
    let [half, all] =
        ["every-pose-of-2", "every-pose"].map(|n| data_of(&format!("experiment_poses/{n}")));
    assert_eq!(three, all);
    assert!(one != three && half != all && one != half);

    let plan = with_learning_curves(folder.path(), &data, "[4]");
    let refused = Runner::new(&plan, Experiment::Persons, &root)
        .unwrap_err()
        .to_string();
    assert!(
        refused.ends_with("asks for 4, but one fold has only 3 persons to train with"),
        "{refused}"
    );
    let plan = self::plan(folder.path(), &data, &data, 2);
    let refused = Runner::new(&plan, Experiment::Poses, &root)
        .unwrap_err()
        .to_string();
    assert_eq!(
        refused,
        "experiment poses needs [learning_curves] in the plan"
    );
}

#[test]
fn shapes_and_ablations_test_networks_of_experiment_1() {
    let data = dataset(4, &[0, 90, 180]);
    // All shapes have the images of the scan's skin, so altered shapes have the errors of experiment 1.
    add_shapes(&data);
    let folder = tempfile::tempdir().unwrap();
    let plan = plan(folder.path(), &data, &data, 2);
    let root = folder.path().join("runs");
    let mut steps = 0;
    let mut results_of = |experiment| {
        let runner = Runner::new(&plan, experiment, &root).unwrap();
        let before = steps;
        let count = |event: Event| steps += u64::from(matches!(event, Event::Step(_)));
        assert!(runner.run(|_| true, &go(), count).unwrap());
        let mut results = runner.results().unwrap();
        runner.add_baselines(&mut results).unwrap();
        (results, steps - before)
    };
    // Two networks of each view without variants of the skin, and the same number for limbs that are not mirrored.
    let (ablations, steps) = results_of(Experiment::Ablations);
    assert_eq!(steps, 2 * 2 * 2 * 2);
    // The networks with variants of the skin, three columns.
    let (shapes, steps) = results_of(Experiment::Shapes);
    assert_eq!(steps, 3 * 2 * 2 * 2);
    let (one, steps) = results_of(Experiment::One);
    assert_eq!(steps, 0);

    let mae = |results: &Results, column: usize| {
        let summary = results.summary(results.columns()[column], Metric::Mae);
        summary.unwrap().mean
    };
    for column in 0..4 {
        assert!((mae(&shapes, column) - mae(&one, column)).abs() < 1e-9);
    }
    let moments = |results: &Results| results.mean_predictions(results.columns()[0]).len();
    assert_eq!(moments(&shapes), 4 * moments(&one), "four altered shapes");
    assert_eq!(mae(&ablations, 0), mae(&one, 0));
    let config = "experiment_ablations/sides-not-mirrored/fold_0/cam_left/seed_1/config.toml";
    let config = fs::read_to_string(root.join(config)).unwrap();
    assert!(config.contains("mirror = false"), "{config}");
    // All limbs are right ones: none is mirrored.
    assert_eq!(mae(&ablations, 1), mae(&ablations, 0));
    let predictions = |column: usize| ablations.mean_predictions(ablations.columns()[column]);
    for ((both, left), right) in predictions(0)
        .iter()
        .zip(predictions(2))
        .zip(predictions(3))
    {
        assert_eq!(both.prediction, 0.5 * (left.prediction + right.prediction));
    }
    let table = Table::complete(&ablations).unwrap().to_markdown();
    let columns =
        "| Metric | experiment 1 | sides not mirrored | left camera only | right camera only | ";
    assert!(headings(&table).starts_with(columns), "{table}");
    let difference =
        "sides not mirrored compared with experiment 1: MAE +0.000, two-sided p = 1.000";
    assert!(table.contains(difference), "{table}");
}

#[test]
fn finetuning_has_settings_of_its_own() {
    let (synthetic, preparations) = (dataset(3, &[0, 90, 180]), dataset(2, &[0, 90, 180]));
    let folder = tempfile::tempdir().unwrap();
    plan(folder.path(), &synthetic, &preparations, 3);
    let path = folder.path().join("plan.toml");
    let text = fs::read_to_string(&path).unwrap();
    fs::write(&path, text.clone() + "[finetuning]\nsteps = 2\n").unwrap();
    let plan = ExperimentPlan::read(&path).unwrap();
    let runner = Runner::new(&plan, Experiment::TwoA, folder.path()).unwrap();
    let number = |column: &str| {
        let is_of = |run: &Training| run.to_string().contains(column);
        runner.runs().iter().position(is_of).unwrap()
    };
    let steps = |number: usize| {
        let mut steps = 0;
        let count = |event: Event| steps += u64::from(matches!(event, Event::Step(_)));
        assert!(runner.run(|n| n == number, &go(), count).unwrap());
        steps
    };
    assert_eq!(steps(number("/scratch/")), 2);
    assert_eq!(steps(number("/specific-original/")), 3 + 2);

    fs::write(&path, text + "[finetuning]\nstep = 2\n").unwrap();
    let refused = ExperimentPlan::read(&path).unwrap_err().to_string();
    assert!(refused.contains("unknown field `step`"), "{refused}");
}

#[test]
fn nobody_is_tested_whose_images_were_pretrained_with() {
    let data = dataset(4, &[0, 90, 180]);
    add_shapes(&data);
    let folder = tempfile::tempdir().unwrap();
    // The synthetic images also serve as preparations.
    let plan = plan(folder.path(), &data, &data, 3);
    let runner = Runner::new(&plan, Experiment::TwoA, folder.path()).unwrap();
    let pretrained = runner.runs().iter().position(|run| run.needs().is_some());
    let refused = runner.run(|n| Some(n) == pretrained, &go(), |_| ());
    let refused = format!("{:#}", anyhow::Error::from(refused.unwrap_err()));
    assert!(refused.contains("would be in both training"), "{refused}");
    let clinical = Runner::new(&plan, Experiment::TwoB, folder.path()).unwrap_err();
    assert_eq!(
        clinical.to_string(),
        "experiment 2b needs [clinical] in the plan"
    );
}
