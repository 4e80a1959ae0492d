//! Separates the bones of an ankle in a scan and grades two exposures by how open the joint space is in them.
//!
//! `cargo run -p ppa-label --example label_ankle`

use std::error::Error;

use nalgebra::{Isometry3, Matrix3, Rotation3, Vector3};
use ppa_dataset::labels::BoneNumbers;
use ppa_label::{AnkleBones, Exposure, JointSpace, LabelScale, ScaleName, segment_bones};
use ppa_phantom::{LowerLeg, TableTop};

fn main() -> Result<(), Box<dyn Error>> {
    let leg = LowerLeg::p01();
    let joint = leg.truth().joint_centre;
    let reach = Vector3::repeat(62.0);
    let scan = leg.voxelise_box([joint - reach, joint + reach], 1.0, TableTop::Absent)?;
    // A patient aligned with the scan: y anterior, z proximal, x to the patient's right.
    let axes = Matrix3::from_columns(&[-Vector3::x(), -Vector3::y(), Vector3::z()]);
    let axes = Rotation3::from_matrix_unchecked(axes);
    let ct_from_patient = Isometry3::from_parts(joint.coords.into(), axes.into());

    let limb = vec![true; scan.grid().len()];
    let found = segment_bones(&scan, &limb, &ct_from_patient)?;
    let bones = AnkleBones::new(&found.grid, &found.labels, BoneNumbers::default(), &joint)?;
    let space = JointSpace::new(bones, &ct_from_patient)?;
    // The tube is 1 m in front of the leg; moving it outwards is equivalent to rotating the limb inwards.
    let exposure = |degrees: f64| {
        let turn = Rotation3::from_axis_angle(&Vector3::z_axis(), -degrees.to_radians());
        let from_front = Matrix3::from_columns(&[Vector3::x(), -Vector3::z(), Vector3::y()]);
        let device = turn * Rotation3::from_matrix_unchecked(from_front);
        let ct_from_device = Isometry3::from_parts(joint.coords.into(), device.into())
            * Isometry3::translation(0.0, 0.0, -1000.0);
        Exposure::of_device(&ct_from_device, joint)
    };
    let rotations = [0.0, 18.0];
    let found = space.openness(&rotations.map(exposure))?;
    for (degrees, openness) in rotations.into_iter().zip(found) {
        let hidden = space.hidden(&exposure(degrees));
        let grade = LabelScale::new(ScaleName::Graded).grade(&openness, &hidden);
        let [medial, superior, lateral] = grade.gutters;
        println!(
            "{degrees:2} degrees: medial gutter {medial}, superior {superior}, lateral {lateral}: grade {}",
            grade.label
        );
    }
    Ok(())
}
