//! Voxels, slices and axes.

use super::Measures;
use super::findings::{Finding, FindingCode, Severity};
use crate::grid::Grid;
use crate::scan::{Scan, WarningCode};

/// Largest tilt of the slice step that is attributed to rounding.
const TILT_DEG: f64 = 0.5;
/// Voxel lengths above which voxels show in the images and spoil them.
const COARSE_MM: [f64; 2] = [3.0, 5.0];
/// Relative difference, as a fraction of the step, below which slice thickness and step count as equal.
const SAME_THICKNESS: f64 = 0.05;

/// Volume of a voxel.
pub(super) fn voxel_cm3(grid: &Grid) -> f64 {
    let linear = grid.ct_from_voxel().matrix().fixed_view::<3, 3>(0, 0);
    linear.determinant().abs() / 1000.0
}

/// Letters of the body directions closest to the voxel axes.
pub(super) fn letters(grid: &Grid) -> String {
    let mut letters = ['?'; 3];
    for (direction, (axis, against)) in grid.lps_axes().into_iter().enumerate() {
        letters[axis] = [['L', 'R'], ['P', 'A'], ['S', 'I']][direction][usize::from(against)];
    }
    letters.into_iter().collect()
}

pub(super) fn check(scan: &Scan, measures: &Measures) -> Vec<Finding> {
    let grid = scan.volume.grid();
    let spacing = grid.spacing_mm();
    let stated = &scan.acquisition;
    let mut found = Vec::new();
    let mut add = |code, severity, text| found.push(Finding::new(code, severity, text));

    if measures.tilt_deg > TILT_DEG {
        add(
            FindingCode::Reader(WarningCode::GantryTilt),
            Severity::Caution,
            format!(
                "the slice step deviates by {:.2} degrees from the slice normal (tilted gantry)",
                measures.tilt_deg
            ),
        );
    }
    let linear = grid.ct_from_voxel().matrix().fixed_view::<3, 3>(0, 0);
    if linear.determinant() < 0.0 {
        add(
            FindingCode::LeftHanded,
            Severity::Note,
            format!(
                "the voxel axes run to {} and are left-handed",
                measures.axes
            ),
        );
    }
    let longest = spacing.max();
    if longest > COARSE_MM[0] {
        let severity = if longest > COARSE_MM[1] {
            Severity::Caution
        } else {
            Severity::Note
        };
        let text = format!(
            "voxels of {:.2} x {:.2} x {:.2} mm are coarse",
            spacing.x, spacing.y, spacing.z
        );
        add(FindingCode::CoarseVoxels, severity, text);
    }
    let step = spacing.z * measures.tilt_deg.to_radians().cos();
    if let Some(thick) = stated.slice_thickness_mm.filter(|_| grid.size()[2] > 1) {
        let text = format!("slices are {thick:.3} mm thick and {step:.3} mm apart");
        if thick < step * (1.0 - SAME_THICKNESS) {
            add(FindingCode::GapsBetweenSlices, Severity::Caution, text);
        } else if thick > step * (1.0 + SAME_THICKNESS) {
            add(FindingCode::OverlappingSlices, Severity::Note, text);
        }
    }
    if stated.lossy {
        let text = "the pixels have undergone lossy compression".to_owned();
        add(FindingCode::LossyPixels, Severity::Caution, text);
    }
    found
}
