//! Slabs and phantoms, whose openness is known.

mod chords;
mod phantoms;
mod segmented;
mod slab;
mod views;

use super::*;
use nalgebra::{Isometry3, Matrix3, Point3, Rotation3, Vector3};
use ppa_ct::Grid;
use ppa_dataset::labels::BoneNumbers;
use ppa_phantom::{LowerLeg, Side, Truth};

/// A patient who lies as the scan: LPS has y posterior and z proximal.
fn ct_from_patient(joint: Point3<f64>, axis: Vector3<f64>) -> Isometry3<f64> {
    let z = axis.normalize();
    let y = (-Vector3::y() + z * z.y).normalize();
    let axes = Rotation3::from_matrix_unchecked(Matrix3::from_columns(&[y.cross(&z), y, z]));
    Isometry3::from_parts(joint.coords.into(), axes.into())
}

/// A phantom's bones on a lattice around its joint.
fn labelled(name: &str, side: Side, spacing_mm: f64) -> (Grid, Vec<u8>, Truth) {
    let leg = LowerLeg::family(name, side).unwrap();
    let truth = leg.truth();
    let low = truth.joint_centre - Vector3::from_element(62.0);
    let n = (124.0 / spacing_mm) as usize;
    let grid = Grid::axis_aligned([n; 3], Vector3::from_element(spacing_mm), low).unwrap();
    let labels = leg.bone_labels(&grid);
    (grid, labels, truth)
}

fn mortise(name: &str, side: Side, spacing_mm: f64) -> (JointSpace, Truth) {
    let (grid, labels, truth) = labelled(name, side, spacing_mm);
    let joint = truth.joint_centre;
    let bones = AnkleBones::new(&grid, &labels, BoneNumbers::default(), &joint).unwrap();
    let patient = ct_from_patient(joint, truth.axis_direction.into_inner());
    (JointSpace::new(bones, &patient).unwrap(), truth)
}

/// The limb turned inwards: the tube goes the other way round.
fn turned(space: &JointSpace, side: Side, degrees: f64) -> Exposure {
    let sign = match side {
        Side::Right => -1.0,
        Side::Left => 1.0,
    };
    Exposure::around(&space.limb, sign * degrees.to_radians(), 1050.0)
}
