//! Case 4.1, computed tomography of a PMMA cylinder: energy imparted to discs of 1 cm.

use nalgebra::Isometry3;
use ppa_xray::{Collimation, Detector, Estimate, Projection, Source, VoxelBox, VoxelPhantom};

use super::{assert_close, dose, grid, material, numbers, reference, spectrum};

/// The source rotates about the cylinder; complete discs are symmetric, so one direction is enough. The cylinder has voxels
/// of 2 mm and is cut at 50.5 cm from the fan instead of 150 cm, from where almost nothing returns. The air between source
/// and cylinder is included, that around it is not.
fn case_4_1(spectrum_name: &str, slit_mm: f64, expected: [f64; 4]) {
    let reference = reference();
    let grid = grid([-160.0, -505.0, 10.0], [2.0, 10.0, 2.0], [160, 101, 375]);
    let (material_index, density) = (0..grid.len())
        .map(|index| {
            let centre = grid.centre(grid.voxel(index).map(|v| v as f64));
            if centre.x.hypot(centre.z - 600.0) < 160.0 {
                (1, 1.19)
            } else {
                (0, 0.001_205)
            }
        })
        .unzip();
    let materials = ["air", "pmma"].map(|name| material(&reference, name));
    let phantom = VoxelPhantom::new(grid, material_index, density, materials.to_vec()).unwrap();
    let (isocentre_mm, detector_mm) = (600.0, 1_000.0);
    let detector = Detector::centred(10, 10, 50.0);
    let mut projection = Projection::new(Isometry3::identity(), detector_mm, detector);
    projection.source = Source::default().with_collimation(Collimation::Rectangle {
        size_mm: [320.0, slit_mm].map(|side| side * detector_mm / isocentre_mm),
        centre_mm: [0.0; 2],
    });
    // Three discs on either side of the middle one.
    let disc = |cm: i32| VoxelBox {
        low: [0, (50 + cm) as usize, 215],
        high: [160, (51 + cm) as usize, 375],
    };
    let discs = (-3..=3).map(disc).collect();
    let spectrum = spectrum(spectrum_name);
    let dose = dose(&phantom, &spectrum, &projection, 6_000_000, discs);
    for (cm, expected) in expected.into_iter().enumerate() {
        let [a, b] = [3 + cm, 3 - cm].map(|disc| dose.regions[disc].1.ev_per_history);
        let found = if cm == 0 {
            a
        } else {
            Estimate {
                value: 0.5 * (a.value + b.value),
                se: 0.5 * a.se.hypot(b.se),
            }
        };
        let what = format!("{spectrum_name}, {slit_mm} mm, disc at {cm} cm");
        assert_close(&what, found, expected, 0.007);
    }
}

fn shared_discs(name: &str) -> [f64; 4] {
    let discs = numbers(&reference()["case4.1_ct_cylinder"][name]);
    discs.try_into().unwrap()
}

#[test]
#[ignore = "needs ../shared/reference/xray"]
fn case_4_1_slit_of_10_mm_at_56_kev() {
    case_4_1("56.4keV", 10.0, shared_discs("56.4keV_10mm"));
}

#[test]
#[ignore = "needs ../shared/reference/xray"]
fn case_4_1_slit_of_80_mm_at_120_kvp() {
    case_4_1("120kVp", 80.0, shared_discs("120kVp_80mm"));
}

#[test]
#[ignore = "needs ../shared/reference/xray"]
fn case_4_1_slit_of_80_mm_at_56_kev() {
    case_4_1("56.4keV", 80.0, [3380.39, 3332.64, 3176.44, 2559.58]);
}

#[test]
#[ignore = "needs ../shared/reference/xray"]
fn case_4_1_slit_of_10_mm_at_120_kvp() {
    case_4_1("120kVp", 10.0, [13137.02, 2585.47, 1706.86, 1250.61]);
}
