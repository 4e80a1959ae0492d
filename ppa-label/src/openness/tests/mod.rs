//! Slabs and phantoms with known openness.

mod chords;
mod phantoms;
mod segmented;
mod slab;
mod views;

use std::sync::OnceLock;

use super::*;
use nalgebra::{Isometry3, Matrix3, Point3, Rotation3, Vector3};
use ppa_ct::Grid;
use ppa_dataset::labels::BoneNumbers;
use ppa_phantom::{LowerLeg, Side, Truth};

/// A patient aligned with the scan: LPS has y posterior and z proximal.
fn ct_from_patient(joint: Point3<f64>, axis: Vector3<f64>) -> Isometry3<f64> {
    let z = axis.normalize();
    let y = (-Vector3::y() + z * z.y).normalize();
    let axes = Rotation3::from_matrix_unchecked(Matrix3::from_columns(&[y.cross(&z), y, z]));
    Isometry3::from_parts(joint.coords.into(), axes.into())
}

/// A phantom's bones on a lattice around its joint.
fn labelled(name: &str, side: Side, spacing_mm: f64) -> (Grid, Vec<u8>, Truth) {
    labels_of(&LowerLeg::family(name, side).unwrap(), spacing_mm)
}

fn labels_of(leg: &LowerLeg, spacing_mm: f64) -> (Grid, Vec<u8>, Truth) {
    let truth = leg.truth();
    let low = truth.joint_centre - Vector3::from_element(62.0);
    let n = (124.0 / spacing_mm) as usize;
    let grid = Grid::axis_aligned([n; 3], Vector3::from_element(spacing_mm), low).unwrap();
    let labels = leg.bone_labels(&grid);
    (grid, labels, truth)
}

fn mortise(name: &str, side: Side, spacing_mm: f64) -> (JointSpace, Truth) {
    let (grid, labels, truth) = labelled(name, side, spacing_mm);
    (joint_space(&grid, &labels, &truth), truth)
}

/// The joint space between labelled bones of a phantom.
fn joint_space(grid: &Grid, labels: &[u8], truth: &Truth) -> JointSpace {
    let joint = truth.joint_centre;
    let bones = AnkleBones::new(grid, labels, BoneNumbers::default(), &joint).unwrap();
    JointSpace::new(bones, &patient(truth)).unwrap()
}

fn patient(truth: &Truth) -> Isometry3<f64> {
    ct_from_patient(truth.joint_centre, truth.axis_direction.into_inner())
}

/// A phantom's right ankle, from its true bones.
struct Ankle {
    leg: LowerLeg,
    truth: Truth,
    grid: Grid,
    labels: Vec<u8>,
    space: JointSpace,
}

/// Spacing of the voxels of [`ankle`].
const ANKLE_SPACING_MM: f64 = 0.8;

/// The ankle of a phantom of the family, P01 to P17, built once. Must not be called from a rayon thread: one that waits for the voxels
/// could start work that needs the same ankle, and wait for itself.
fn ankle(number: usize) -> &'static Ankle {
    static ANKLES: [OnceLock<Ankle>; 17] = [const { OnceLock::new() }; 17];
    ANKLES[number - 1].get_or_init(|| {
        let leg = LowerLeg::family(&format!("P{number:02}"), Side::Right).unwrap();
        let (grid, labels, truth) = labels_of(&leg, ANKLE_SPACING_MM);
        let space = joint_space(&grid, &labels, &truth);
        Ankle {
            leg,
            truth,
            grid,
            labels,
            space,
        }
    })
}

/// All seventeen, in order.
fn family() -> Vec<&'static Ankle> {
    (1..=17).map(ankle).collect()
}

/// The limb rotated inwards: the tube moves in the opposite direction.
fn turned(space: &JointSpace, side: Side, degrees: f64) -> Exposure {
    let sign = match side {
        Side::Right => -1.0,
        Side::Left => 1.0,
    };
    Exposure::around(&space.limb, sign * degrees.to_radians(), 1050.0)
}
