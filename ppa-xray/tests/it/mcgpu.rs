//! Input files of MC-GPU v1.3, run unchanged.

use std::fmt::Write;
use std::fs;
use std::ops::ControlFlow;
use std::path::Path;

use nalgebra::{Isometry3, Vector3};
use ppa_xray::mcgpu::{McgpuError, RunLength, ScanDose, ScanDoseError, Simulation, Station};
use ppa_xray::{Category, Radiograph};
use serde_json::Value;

use crate::shared;

/// Parts of an input file that differ between tests, in file order.
pub struct Sections<'a> {
    length: &'a str,
    source: &'a str,
    detector: &'a str,
    scan: &'a str,
    dose: &'a str,
    files: &'a str,
}

impl Sections<'_> {
    fn text(&self) -> String {
        let Self {
            length,
            source,
            detector,
            scan,
            dose,
            files,
        } = self;
        format!(
            "#[SECTION SIMULATION CONFIG v.2009-05-12]\n{length}\n17\n0\n128\n150\n\
             #[SECTION SOURCE v.2011-07-12]\n{source}\n\
             #[SECTION IMAGE DETECTOR v.2009-12-02]\nimage.dat\n{detector}\n\
             #[SECTION CT SCAN TRAJECTORY v.2011-10-25]\n{scan}\n\
             #[SECTION DOSE DEPOSITION v.2012-12-12]\n{dose}\n\
             #[SECTION VOXELIZED GEOMETRY FILE v.2009-11-30]\n{files}\n"
        )
    }
}

/// Writes a water box of 8 cm x 6 cm x 4 cm in 1 cm voxels with a block of bone near the corner of low x, y and z.
fn write_phantom(folder: &Path) {
    let mut text = "[SECTION VOXELS HEADER v.2008-04-13]\n8 6 4 voxels\n1 1 1 cm\n1\n2\n0\n[END OF VXH SECTION]\n".to_owned();
    for z in 0..4 {
        for y in 0..6 {
            for x in 0..8 {
                let bone = (1..3).contains(&x) && (1..3).contains(&y) && z == 1;
                text += if bone { "3 1.85\n" } else { "1 1.0\n" };
            }
        }
    }
    fs::write(folder.join("box.vox"), text).unwrap();
    fs::write(folder.join("beam.spc"), "50000 1\n50100 -1\n").unwrap();
}

pub const SCAN: Sections = Sections {
    length: "4e4",
    source: "beam.spc\n4 -50 2\n0 1 0\n-1 -1",
    detector: "20 5\n20 10\n100",
    scan: "4\n90\n0 700\n53\n0",
    dose: "YES\nYES\ndose.dat\n1 8\n1 6\n2 99",
    files: "box.vox\n#[SECTION MATERIAL FILE LIST]\nppa:water\nppa:air\nppa:bone_cortical",
};

pub fn simulation(folder: &Path, sections: &Sections) -> Result<Simulation, McgpuError> {
    write_phantom(folder);
    let path = folder.join("scan.in");
    fs::write(&path, sections.text()).unwrap();
    Simulation::read(path)
}

fn photons(simulation: &Simulation, station: &Station, histories: u64) -> Radiograph {
    let length = RunLength::Histories(histories);
    simulation
        .analog(station, length, |_| ControlFlow::Continue(()))
        .unwrap()
        .0
}

/// The shadow of the bone, which is at low x, y and z, moves with the source.
#[test]
fn a_scan_has_the_projections_of_mcgpu_in_order() {
    let folder = tempfile::tempdir().unwrap();
    let square = Sections {
        detector: "20 10\n20 10\n100",
        ..SCAN
    };
    let simulation = simulation(folder.path(), &square).unwrap();
    assert_eq!(simulation.input().run_length, RunLength::Seconds(4e4));
    let stations = simulation.input().stations();
    let angles: Vec<f64> = stations.iter().map(|s| s.angle_deg).collect();
    assert_eq!(angles, [270.0, 360.0, 450.0, 540.0]);
    // Columns run along x and y as seen from −y and +x, and along −x and −y as seen from +y and −x. The bone ends 3 cm and 2
    // cm from the axis and is magnified about twice; it is in the 2 cm below the middle.
    let low_side = [(5..8, true), (7..10, true), (5..8, false), (7..10, false)];
    for (station, (columns, on_the_left)) in stations.iter().zip(low_side) {
        let image = simulation.image(&photons(&simulation, station, 40_000));
        assert_eq!(image.pixels, [20, 10]);
        let sum = |left: bool, rows: std::ops::Range<usize>| -> f32 {
            let column = |column| if left { column } else { 19 - column };
            let pixels = rows.flat_map(|row| columns.clone().map(move |c| 20 * row + column(c)));
            pixels.map(|pixel| image.planes[0][pixel]).sum()
        };
        let shadow = sum(on_the_left, 3..5);
        for open in [sum(!on_the_left, 3..5), sum(on_the_left, 5..7)] {
            assert!(
                shadow < 0.7 * open,
                "{:.0}°: {shadow} {open}",
                station.angle_deg
            );
        }
    }
}

#[test]
fn a_dose_of_another_simulation_is_refused_and_not_added() {
    let folder = tempfile::tempdir().unwrap();
    let simulated = |sections: &Sections| {
        let simulation = simulation(folder.path(), sections).unwrap();
        let station = &simulation.input().stations()[0];
        let length = RunLength::Histories(2_000);
        let counted = simulation.analog(station, length, |_| ControlFlow::Continue(()));
        (counted.unwrap().1.unwrap(), simulation)
    };
    let (dose, own) = simulated(&SCAN);
    let (of_more_voxels, _) = simulated(&Sections {
        dose: "YES\nYES\ndose.dat\n1 8\n1 6\n1 99",
        ..SCAN
    });
    let (of_other_matter, other) = simulated(&Sections {
        files: "box.vox\n#[SECTION MATERIAL FILE LIST]\nppa:water\nppa:air\nppa:pmma\nppa:air",
        ..SCAN
    });
    let mut sums = ScanDose::new(&own);
    let added = sums.add(&own, &of_more_voxels);
    assert!(matches!(added, Err(ScanDoseError::Voxels { .. })));
    let added = sums.add(&own, &of_other_matter);
    assert!(matches!(added, Err(ScanDoseError::Materials { .. })));
    let added = sums.add(&other, &of_other_matter);
    assert!(matches!(added, Err(ScanDoseError::Sums { .. })));
    assert_eq!(sums, ScanDose::new(&own));
    sums.add(&own, &dose).unwrap();
    assert_eq!(sums.histories(), 2_000);
}

/// All files of MC-GPU are written in its layout, and the sums of the text, the raw file and the result agree.
#[test]
fn images_and_doses_are_written_as_mcgpu_does() {
    let folder = tempfile::tempdir().unwrap();
    let simulation = simulation(folder.path(), &SCAN).unwrap();
    let mut scan_dose = ScanDose::new(&simulation);
    let stations = &simulation.input().stations()[..2];
    let mut imparted_kev = 0.0;
    for station in stations {
        let length = RunLength::Histories(5_000);
        let (radiograph, dose) = simulation
            .analog(station, length, |_| ControlFlow::Continue(()))
            .unwrap();
        let dose = dose.unwrap();
        imparted_kev += 0.5e-3 * dose.phantom.ev_per_history.value;
        scan_dose.add(&simulation, &dose).unwrap();
        simulation
            .write_image(folder.path(), station, &radiograph)
            .unwrap();
        let name = simulation.image_name(station);
        let text = fs::read_to_string(folder.path().join(&name)).unwrap();
        let rows: Vec<Vec<f64>> = text
            .lines()
            .filter(|line| !line.starts_with('#') && !line.is_empty())
            .map(|line| line.split(' ').map(|v| v.parse().unwrap()).collect())
            .collect();
        assert_eq!(rows.len(), 100);
        assert!(text.lines().filter(|line| line.is_empty()).count() >= 5);
        let raw = fs::read(folder.path().join(name + ".raw")).unwrap();
        let raw: Vec<f32> = raw
            .chunks(4)
            .map(|v| f32::from_le_bytes(v.try_into().unwrap()))
            .collect();
        assert_eq!(raw.len(), 500);
        // Pixels of 1 cm x 2 cm.
        for (plane, category) in Category::ALL.into_iter().enumerate() {
            let (expected, _) = radiograph.sums.of(category);
            let text: f64 = rows.iter().map(|row| 2.0 * row[plane]).sum();
            let floats = &raw[100 * (plane + 1)..100 * (plane + 2)];
            let floats: f64 = floats.iter().map(|&v| 2.0 * f64::from(v)).sum();
            assert!(
                (text - expected).abs() < 1e-5 * (1.0 + expected),
                "{category:?}"
            );
            assert!(
                (floats - expected).abs() < 1e-5 * (1.0 + expected),
                "{category:?}"
            );
        }
        let total: f64 = raw[..100].iter().map(|&v| 2.0 * f64::from(v)).sum();
        assert!((total / radiograph.sums.total_ev_per_history() - 1.0).abs() < 1e-5);
    }
    assert_eq!(simulation.image_name(&stations[1]), "image.dat_0001");
    // By line of the material list; no voxel is air.
    let materials = scan_dose.materials();
    assert_eq!(scan_dose.histories(), 10_000);
    assert_eq!(materials[1].mass_g, 0.0);
    assert!((materials[2].mass_g - 4.0 * 1.85).abs() < 1e-5);
    let sum: f64 = materials.iter().map(|m| m.ev_per_history.value).sum();
    assert!((1e-3 * sum / imparted_kev - 1.0).abs() < 1e-9);
    // The region is clipped at the border: 8 x 6 x 3 voxels. Dose times mass is the energy.
    scan_dose.write(folder.path(), &simulation).unwrap();
    let raw = fs::read(folder.path().join("dose.dat.raw")).unwrap();
    let errors = fs::read(folder.path().join("dose.dat_PercentRelError2sigma.raw")).unwrap();
    assert_eq!((raw.len(), errors.len()), (4 * 144, 4 * 144));
    let energy_ev: f64 = raw
        .chunks(4)
        .enumerate()
        .map(|(voxel, dose)| {
            let (x, y, z) = (voxel % 8, voxel / 8 % 6, voxel / 48);
            let bone = (1..3).contains(&x) && (1..3).contains(&y) && z == 0;
            let dose = f64::from(f32::from_le_bytes(dose.try_into().unwrap()));
            dose * if bone { 1.85 } else { 1.0 }
        })
        .sum();
    let text = fs::read_to_string(folder.path().join("dose.dat")).unwrap();
    let report = text.split("inside the dose ROI: ").nth(1).unwrap();
    let told_kev: f64 = report.split(' ').next().unwrap().parse().unwrap();
    assert!(
        (1e-3 * energy_ev / told_kev - 1.0).abs() < 1e-4,
        "{energy_ev} {told_kev}"
    );
    assert!(told_kev > 0.5 * imparted_kev && told_kev < imparted_kev);
    assert_eq!(
        text.lines()
            .filter(|line| !line.starts_with('#') && !line.is_empty())
            .count(),
        48
    );
}

/// The first aperture is along the columns. The field is where primary photons arrive; a pencil beam has no width.
#[test]
fn apertures_are_along_columns_then_rows() {
    let folder = tempfile::tempdir().unwrap();
    for (apertures, columns, rows) in [("8 2", 14.0, 3.5), ("2 8", 3.5, 10.0), ("0 0", 0.1, 0.1)] {
        let source = format!("beam.spc\n4 -50 2\n0 1 0\n{apertures}");
        let sections = Sections {
            source: &source,
            detector: "200 100\n20 10\n100",
            scan: "1",
            dose: "NO\nNO",
            ..SCAN
        };
        let simulation = simulation(folder.path(), &sections).unwrap();
        let station = simulation.input().stations()[0];
        let image = simulation.image(&photons(&simulation, &station, 40_000));
        let lit = |of: fn(usize) -> usize| {
            let lit = (0..20_000)
                .filter(|&pixel| image.planes[0][pixel] > 0.0)
                .map(of);
            let (low, high) = lit.fold((usize::MAX, 0), |(low, high), n| (low.min(n), high.max(n)));
            0.1 * (high + 1 - low) as f64
        };
        let found = [lit(|pixel| pixel % 200), lit(|pixel| pixel / 200)];
        println!("{apertures}: {found:?} cm");
        assert!(
            (found[0] - columns).abs() < 0.3 && (found[1] - rows).abs() < 0.3,
            "{found:?}"
        );
    }
}

#[test]
fn what_an_input_file_names_must_fit() {
    let folder = tempfile::tempdir().unwrap();
    let report = |sections: Sections| match simulation(folder.path(), &sections) {
        Ok(_) => panic!("was read"),
        Err(error) => error.to_string(),
    };
    let list = |materials: &str| format!("box.vox\n#[SECTION MATERIAL FILE LIST]\n{materials}");
    for (files, expected) in [
        (
            list("ppa:water\nnowhere.mcgpu.gz # x\nppa:air"),
            "line 34: material file 2 ",
        ),
        (
            list("ppa:water\nnowhere.mcgpu.gz # x\nppa:air"),
            "nowhere.mcgpu.gz is not a file; use ppa:NAME",
        ),
        (list("ppa:water\nppa:air"), "box.vox uses material 3, but "),
        (list("ppa:water\nppa:air\nppa:cheese"), "line 35"),
        (
            list("ppa:water\nppa:air\nbeam.spc"),
            "beam.spc ends after line 2, expected [MATERIAL NAME",
        ),
        (
            list("ppa:water\nppa:air\nppa:air").replace("box", "fox"),
            "line 31: voxel file ",
        ),
    ] {
        let found = report(Sections {
            files: &files,
            ..SCAN
        });
        assert!(found.contains(expected), "{files}: {found}");
    }
    let found = report(Sections {
        source: "x.spc\n4 -50 2\n0 1 0\n-1 -1",
        ..SCAN
    });
    assert!(found.contains("line 8: spectrum file "), "{found}");
    let found = report(Sections {
        source: "box.vox\n4 -50 2\n0 1 0\n-1 -1",
        ..SCAN
    });
    assert!(
        found.starts_with("spectrum ") && found.ends_with("box.vox"),
        "{found}"
    );
    let found = report(Sections {
        detector: "20 5\n20 10.1\n100",
        ..SCAN
    });
    assert!(found.contains("pixels of 1 cm by 2.02 cm"), "{found}");
    let found = report(Sections {
        dose: "NO\nYES\nd\n1 8\n7 8\n1 1",
        ..SCAN
    });
    assert!(
        found.contains("begins at voxel (1, 7, 1), outside the geometry of 8 x 6 x 4"),
        "{found}"
    );
}

/// Projections have different seeds, and the first has that of the file.
#[test]
fn projections_have_histories_of_their_own() {
    let folder = tempfile::tempdir().unwrap();
    let mut simulation = simulation(folder.path(), &SCAN).unwrap();
    let seeds = |simulation: &Simulation| -> Vec<u64> {
        simulation
            .input()
            .stations()
            .iter()
            .map(|s| simulation.seed(s))
            .collect()
    };
    let first = seeds(&simulation);
    simulation.set_seed(18);
    let second = seeds(&simulation);
    assert_eq!((first[0], second[0]), (17, 18));
    let mut all: Vec<u64> = first.into_iter().chain(second).collect();
    all.sort_unstable();
    all.dedup();
    assert_eq!(all.len(), 8);
}

/// The frame of the voxel box is kept: its corner is the origin, and the device has the position given in the file.
#[test]
fn the_frame_is_that_of_the_file() {
    let folder = tempfile::tempdir().unwrap();
    let simulation = simulation(folder.path(), &SCAN).unwrap();
    let projection = simulation.projection(&simulation.input().stations()[0]);
    let pose: Isometry3<f64> = projection.ct_from_device;
    assert!((pose.translation.vector - Vector3::new(40.0, -500.0, 20.0)).norm() < 1e-9);
    assert!((pose * Vector3::z() - Vector3::y()).norm() < 1e-12);
    assert_eq!(projection.source_detector_mm, 1_000.0);
    let [low, .., high] = simulation.phantom().corners_ct();
    assert!(low.coords.norm() < 1e-12);
    assert!((high.coords - Vector3::new(80.0, 60.0, 40.0)).norm() < 1e-12);
}

/// Case a from an input file, with the material files and the spectrum used by MC-GPU.
#[test]
#[ignore = "needs ../shared/reference/xray"]
fn case_a_from_its_input_file_agrees_with_mcgpu() {
    let reference = shared::path("reference/xray");
    let mut files = format!(
        "{}/phantom_a.vox.gz #\n#[SECTION MATERIAL FILE LIST]\n",
        reference.display()
    );
    for name in [
        "air",
        "soft_tissue_icrp",
        "bone_cortical_icrp",
        "titanium",
        "water",
    ] {
        let folder = reference.display();
        writeln!(
            files,
            "{folder}/materials_mcgpu/{name}__5-120keV.xrl.mcgpu.gz #"
        )
        .unwrap();
    }
    let sections = Sections {
        length: "1e7",
        source: &format!(
            "{}/spectrum_60kVp.spc #\n10 -85 10\n0 1 0\n-15 -15",
            reference.display()
        ),
        detector: "300 300\n30 30\n110",
        scan: "1",
        dose: "YES\nNO",
        files: &files,
    };
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("case_a.in");
    fs::write(&path, sections.text()).unwrap();
    let simulation = Simulation::read(path).unwrap();
    let run_length = simulation.input().run_length;
    let station = simulation.input().stations()[0];
    let (image, dose) = simulation
        .analog(&station, run_length, |_| ControlFlow::Continue(()))
        .unwrap();
    let text = fs::read_to_string(reference.join("case_a_mcgpu.json")).unwrap();
    let mcgpu: Value = serde_json::from_str(&text).unwrap();
    for (category, tolerance) in Category::ALL.into_iter().zip([0.01, 0.02, 0.03, 0.02]) {
        let (found, se) = image.sums.of(category);
        let expected = mcgpu["energy_per_history_eV"][category.name()]
            .as_f64()
            .unwrap();
        println!(
            "{:9} {found:.3} ± {se:.3}, MC-GPU {expected:.3}",
            category.name()
        );
        assert!((found / expected - 1.0).abs() < tolerance);
    }
    // Mean energy of the spectrum: emitted energy is absorbed, reaches the detector or escapes.
    let dose = dose.unwrap();
    let stays = dose.phantom.ev_per_history.value + image.sums.total_ev_per_history();
    let emitted = 1e3 * simulation.spectrum().mean_energy_kev();
    assert!(
        (0.5..1.0).contains(&(stays / emitted)),
        "{stays} of {emitted} eV"
    );
}
