//! Analog runs in parts, interrupted and resumed.

use std::fs;
use std::path::Path;

use serde_json::Value;

use crate::{fail, names, phantom, succeed, write_plan};

/// Runs 20000 analog histories on the phantom with a small detector and returns the printed object.
fn simulate(folder: &Path, more: &str) -> Value {
    serde_json::from_str(&succeed(folder, &command(more))).unwrap()
}

fn command(more: &str) -> String {
    let case = phantom().join("p01.toml");
    let case = case.display();
    format!("xray simulate {case} --plan plan.toml --engine analog --seed 5 --json {more}")
}

fn read(folder: &Path, name: &str) -> Vec<u8> {
    fs::read(folder.join(name)).unwrap()
}

#[test]
fn parts_and_resumed_runs_end_in_the_bytes_of_one_run() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    write_plan(folder, "");
    let report = simulate(
        folder,
        "--histories 20000 --dose --out one.png --tally one.tally",
    );
    assert_eq!(report["histories"], 20_000.0);
    let absolute = &report["projections"][0];
    let factor = absolute["histories_per_mas"].as_f64().unwrap();
    let primary = absolute["primary_ev_per_history"].as_f64().unwrap();
    let per_mas = absolute["ev_per_mas"]["primary"].as_f64().unwrap();
    assert!((per_mas / (primary * factor) - 1.0).abs() < 1e-12);
    let materials = report["materials"].as_array().unwrap().len();
    for key in [
        "material_dose_ev_per_history",
        "material_dose_ev_per_history_se",
        "material_mass_g",
    ] {
        assert_eq!(report[key].as_array().unwrap().len(), materials, "{key}");
    }
    assert!(
        report["entrance_air_kerma_ugy_per_mas"].as_f64()
            > report["detector_air_kerma_ugy_per_mas"].as_f64()
    );

    // The fast engine states the same kerma per mAs, and that of its tube load.
    let case = phantom().join("p01.toml");
    let fast = format!(
        "xray simulate {} --plan plan.toml --mas 2 --out fast.png --json",
        case.display()
    );
    let fast: Value = serde_json::from_str(&succeed(folder, &fast)).unwrap();
    let per_mas = &report["entrance_air_kerma_ugy_per_mas"];
    assert_eq!(&fast["entrance_air_kerma_ugy_per_mas"], per_mas);
    let (ugy, per_mas) = (fast["entrance_air_kerma_ugy"].as_f64(), per_mas.as_f64());
    assert!((ugy.unwrap() / (2.0 * per_mas.unwrap()) - 1.0).abs() < 1e-9);

    for part in ["2/3", "1/3", "3/3"] {
        let name = part.replace('/', "of");
        simulate(
            folder,
            &format!("--histories 20000 --dose --part {part} --tally {name}.tally"),
        );
    }
    succeed(
        folder,
        "xray merge 1of3.tally 2of3.tally 3of3.tally --plan plan.toml --out merged.png --tally merged.tally",
    );
    assert!(read(folder, "merged.tally") == read(folder, "one.tally"));
    assert!(read(folder, "merged.png") == read(folder, "one.png"));

    let said = fail(folder, "xray merge 1of3.tally 3of3.tally --out hole.png");
    assert!(
        said.contains("6666 to 13333") && said.contains("none of the tallies"),
        "{said}"
    );
    let said = fail(folder, "xray merge one.tally 3of3.tally --out overlap.png");
    assert!(
        said.contains("overlap") && said.contains("13333 to 20000"),
        "{said}"
    );

    // Five thousand histories, then the rest.
    simulate(folder, "--histories 5000 --dose --tally go_on.tally");
    let said = fail(
        folder,
        &command("--histories 20000 --dose --tally go_on.tally"),
    );
    assert!(
        said.contains("go_on.tally") && said.contains("--resume"),
        "{said}"
    );
    simulate(
        folder,
        "--histories 20000 --dose --tally go_on.tally --resume",
    );
    assert!(read(folder, "go_on.tally") == read(folder, "one.tally"));
    // Resuming a finished run does nothing and replaces its image by the same one.
    for _ in 0..2 {
        simulate(
            folder,
            "--histories 20000 --dose --tally go_on.tally --resume --out go_on.png",
        );
        assert!(read(folder, "go_on.png") == read(folder, "one.png"));
    }
    let said = fail(
        folder,
        &command("--histories 20000 --kvp 70 --dose --tally go_on.tally --resume"),
    );
    assert!(said.contains("another simulation"), "{said}");
    assert!(
        !names(folder)
            .iter()
            .any(|name| name == "hole.png" || name == "overlap.png")
    );
}

/// The dose is in the limb, and the mean over the map is about half of the air kerma at the skin: the beam is attenuated on
/// its way, and the air in the map receives as much as the tissue.
#[test]
fn a_dose_map_lies_on_the_limb_in_the_units_of_the_kerma() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    let plan = write_plan(folder, "");
    let text = fs::read_to_string(&plan).unwrap();
    fs::write(
        plan,
        text.replace("half_length_mm = 20.0\nmax_voxel_mm = 5.0\n", ""),
    )
    .unwrap();
    let report = simulate(
        folder,
        "--target-error 60 --dose-map dose.nii.gz --out x.png",
    );
    let map = ppa_ct::read(&folder.join("dose.nii.gz")).unwrap().volume;
    let scan = ppa_ct::read(&phantom().join("p01.nii")).unwrap().volume;
    let (grid, dose) = (map.grid(), map.hu());
    let hit: Vec<usize> = (0..grid.len()).filter(|&voxel| dose[voxel] > 0.0).collect();
    let in_limb = |voxel: &&usize| {
        let place = grid.centre(grid.voxel(**voxel).map(|index| index as f64));
        scan.sample(&place).is_some_and(|hu| hu > -500.0)
    };
    let share = hit.iter().filter(in_limb).count() as f64 / hit.len() as f64;
    assert!(
        hit.len() > 10_000 && share > 0.95,
        "{share} of {}",
        hit.len()
    );
    let mean_ugy = dose.iter().map(|&ugy| f64::from(ugy)).sum::<f64>() / grid.len() as f64;
    let skin_ugy = report["entrance_air_kerma_ugy_per_mas"].as_f64().unwrap();
    assert!(
        (0.3..0.9).contains(&(mean_ugy / skin_ugy)),
        "{mean_ugy} µGy/mAs, at the skin {skin_ugy} µGy/mAs"
    );
}

#[test]
fn options_that_make_no_sense_are_named() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    write_plan(folder, "");
    let case = phantom().join("p01.toml");
    let fast = format!(
        "xray simulate {} --plan plan.toml --out x.png --time 3",
        case.display()
    );
    assert!(fail(folder, &fast).contains("--time needs --engine analog"));
    for (options, word) in [
        ("--out x.png --time 0", "--time"),
        ("--out x.png --target-error 100", "--target-error"),
        ("--out x.png --histories 0", "--histories"),
        ("--out x.png --histories 1e12", "5e11"),
        ("--tally nowhere/x.tally --histories 1000", "nowhere"),
    ] {
        let said = fail(folder, &command(options));
        assert!(said.contains(word), "{options}: {said}");
    }
    assert_eq!(names(folder), ["plan.toml"]);
}
