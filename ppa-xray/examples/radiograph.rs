//! The ankle of the built-in phantom in mortise view: voxel volume in, radiograph out.
//!
//! `cargo run --release -p ppa-xray --example radiograph -- [ANGLE_DEG] [OUT_STEM]`

use std::error::Error;

use nalgebra::{Isometry3, Matrix3, Rotation3, Translation3, UnitQuaternion, Vector3};
use ppa_phantom::{LowerLeg, TableTop};
use ppa_xray::{
    Category, Detector, FastSettings, HuCalibration, Presentation, Projection, Spectrum, TubeSpec,
    VoxelPhantom, fast,
};

fn main() -> Result<(), Box<dyn Error>> {
    let mut arguments = std::env::args().skip(1);
    let angle_deg: f64 = arguments.next().map_or(Ok(18.0), |text| text.parse())?;
    let stem = arguments.next().unwrap_or_else(|| "ankle".into());

    let limb = LowerLeg::p01();
    let volume = limb.voxelise(1.0, TableTop::Absent)?;
    let phantom = VoxelPhantom::from_volume(&volume, &HuCalibration::default(), None)?;
    let spectrum = Spectrum::tungsten(&TubeSpec::new(60.0, 12.0, vec!["Al:2.5".parse()?]))?;

    // Beam from anterior (ct −y) through the joint; rotating the device outwards is equivalent to rotating the limb inwards.
    let from_front = Matrix3::from_columns(&[Vector3::x(), -Vector3::z(), Vector3::y()]);
    let turn = Rotation3::from_axis_angle(&Vector3::z_axis(), -angle_deg.to_radians());
    let rotation = turn * Rotation3::from_matrix_unchecked(from_front);
    let joint = Translation3::from(limb.truth().joint_centre);
    let projection = Projection::new(
        joint
            * UnitQuaternion::from_rotation_matrix(&rotation)
            * Isometry3::translation(0.0, 0.0, -1_000.0),
        1_100.0,
        Detector::centred(600, 600, 0.4),
    );

    let radiograph = fast(&phantom, &spectrum, &projection, &FastSettings::default())?;
    for category in Category::ALL {
        let (energy, se) = radiograph.sums.of(category);
        println!(
            "{:9} {energy:9.2} ± {se:.2} eV per history",
            category.name()
        );
    }
    radiograph.write_png(format!("{stem}.png").as_ref(), &Presentation::default())?;
    radiograph.write_exr(format!("{stem}.exr").as_ref())?;
    Ok(())
}
