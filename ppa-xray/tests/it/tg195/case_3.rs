//! Case 3, mammography: energy imparted to the glandular tissue of a compressed breast and to seven volumes in it.
//!
//! References: means of EGSnrc, Geant4, MCNP and PENELOPE and, for the whole breast, the lowest and the highest of them, as the public
//! validation programme of DXMClib lists them.

use nalgebra::Isometry3;
use ppa_xray::{
    Collimation, Detector, Estimate, Projection, Source, Spectrum, VoxelBox, VoxelPhantom,
};

use super::{assert_close, dose, grid, material, reference};

/// 30 kVp of molybdenum behind molybdenum, photons per bin of 0.5 keV from 7 keV on, as the report lists them.
#[rustfmt::skip]
const MO_30_KVP: [f64; 46] = [
    1.551e-4, 4.691e-4, 1.199e-3, 2.405e-3, 4.263e-3, 6.797e-3, 9.761e-3, 1.314e-2, 1.666e-2, 2.013e-2,
    2.349e-2, 2.666e-2, 2.933e-2, 3.167e-2, 3.365e-2, 3.534e-2, 3.644e-2, 3.741e-2, 3.796e-2, 3.823e-2,
    3.445e-1, 3.770e-2, 3.704e-2, 3.639e-2, 9.200e-2, 2.178e-3, 2.048e-3, 2.043e-3, 2.098e-3, 2.193e-3,
    2.327e-3, 2.471e-3, 2.625e-3, 2.770e-3, 2.907e-3, 3.000e-3, 3.062e-3, 3.058e-3, 2.988e-3, 2.823e-3,
    2.575e-3, 2.233e-3, 1.815e-3, 1.290e-3, 6.696e-4, 4.086e-5,
];

pub fn mo_30_kvp() -> Spectrum {
    let edges_kev: Vec<f64> = (0..=MO_30_KVP.len())
        .map(|bin| 7.0 + 0.5 * bin as f64)
        .collect();
    Spectrum::from_bins(&edges_kev, &MO_30_KVP).unwrap()
}

/// Voxels of 2 mm x 2 mm x 1 mm; z from the source towards the detector, with the middle of the breast at 62 cm. Half discs of
/// 10 cm radius, 2 mm of skin on all sides except the chest wall; paddles of PMMA above and below; a body of water behind the
/// wall. Air fills the rest of a box from 1 cm behind the source to the end of the body.
fn breast() -> VoxelPhantom {
    let reference = reference();
    let grid = grid([-170.0, -150.0, 10.0], [2.0, 2.0, 1.0], [155, 150, 760]);
    let (material_index, density) = (0..grid.len())
        .map(|index| {
            let centre = grid.centre(grid.voxel(index).map(|v| v as f64));
            let (height, radius) = ((centre.z - 620.0).abs(), centre.x.hypot(centre.y));
            if centre.x < 0.0 && height < 150.0 {
                (1, 1.0)
            } else if centre.x > 0.0 && radius < 98.0 && height < 23.0 {
                (4, 0.952)
            } else if centre.x > 0.0 && radius < 100.0 && height < 25.0 {
                (3, 1.09)
            } else if centre.x > 0.0 && (25.0..27.0).contains(&height) && centre.y.abs() < 130.0 {
                (2, 1.19)
            } else {
                (0, 0.001_205)
            }
        })
        .unzip();
    let names = ["air", "water", "pmma", "skin", "breast_20pct_glandular"];
    let materials = names.map(|name| material(&reference, name)).to_vec();
    VoxelPhantom::new(grid, material_index, density, materials).unwrap()
}

/// The beam fills a detector of 14 cm x 26 cm, one edge at the chest wall, 66 cm from the source; photons are followed to 78 cm.
fn projection() -> Projection {
    let (detector_mm, end_mm) = (660.0, 780.0);
    let detector = Detector::centred(10, 10, 50.0);
    let mut projection = Projection::new(Isometry3::identity(), end_mm, detector);
    projection.source = Source::default().with_collimation(Collimation::Rectangle {
        size_mm: [140.0, 260.0].map(|side| side * end_mm / detector_mm),
        centre_mm: [70.0 * end_mm / detector_mm, 0.0],
    });
    projection
}

/// Region of voxels between two corners in mm.
fn region(low_mm: [f64; 3], high_mm: [f64; 3]) -> VoxelBox {
    let voxel = |mm: [f64; 3]| {
        [(mm[0] + 170.0) / 2.0, (mm[1] + 150.0) / 2.0, mm[2] - 10.0].map(|v| v.round() as usize)
    };
    VoxelBox {
        low: voxel(low_mm),
        high: voxel(high_mm),
    }
}

/// Volumes of 2 cm x 2 cm x 1 cm. Volumes 1 and 5, on either side of the middle, are equivalent by symmetry.
fn case_3(name: &str, spectrum: &Spectrum, whole: f64, volumes: [f64; 7]) {
    let centres_mm = [
        [50.0, -50.0, 620.0],
        [20.0, 0.0, 620.0],
        [50.0, 0.0, 620.0],
        [80.0, 0.0, 620.0],
        [50.0, 50.0, 620.0],
        [50.0, 0.0, 635.0],
        [50.0, 0.0, 605.0],
    ];
    let half_mm = [10.0, 10.0, 5.0];
    let at = |centre: [f64; 3], sign: f64| [0, 1, 2].map(|a| centre[a] + sign * half_mm[a]);
    let regions = centres_mm
        .map(|centre| region(at(centre, -1.0), at(centre, 1.0)))
        .to_vec();
    let dose = dose(&breast(), spectrum, &projection(), 4_000_000, regions);
    let (_, tissue) = &dose.materials[4];
    assert_close(
        &format!("{name}, breast"),
        tissue.ev_per_history,
        whole,
        0.005,
    );
    let found = |volume: usize| dose.regions[volume].1.ev_per_history;
    for (volume, &expected) in volumes.iter().enumerate() {
        let what = format!("{name}, volume {}", volume + 1);
        assert_close(&what, found(volume), expected, 0.02);
    }
    let [a, b] = [found(0), found(4)];
    let beside = Estimate {
        value: 0.5 * (a.value + b.value),
        se: 0.5 * a.se.hypot(b.se),
    };
    let expected = 0.5 * (volumes[0] + volumes[4]);
    assert_close(&format!("{name}, volumes 1, 5"), beside, expected, 0.01);
}

/// Codes from 4691.0 to 4700.5 eV for the breast.
#[test]
#[ignore = "needs ../shared/reference/xray"]
fn case_3_mammography_at_16_8_kev() {
    let volumes = [17.692, 18.070, 17.865, 17.262, 17.768, 5.417, 56.017];
    let spectrum = Spectrum::monoenergetic(16.8).unwrap();
    case_3("16.8 keV", &spectrum, 4697.333, volumes);
}

/// Codes from 4287.4 to 4296.8 eV for the breast.
#[test]
#[ignore = "needs ../shared/reference/xray"]
fn case_3_mammography_at_30_kvp() {
    let volumes = [16.502, 16.658, 16.814, 16.249, 16.521, 6.041, 50.041];
    case_3("30 kVp", &mo_30_kvp(), 4293.433, volumes);
}
