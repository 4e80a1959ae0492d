//! A C-arm rotated around a limb: one prepared phantom, many projections, each with a preview first.
//!
//! `cargo run --release -p ppa-xray --example c_arm_sweep -- [VIEWS] [OUT_FOLDER]`

use std::error::Error;
use std::ops::ControlFlow;
use std::path::PathBuf;

use nalgebra::{Isometry3, Matrix3, Rotation3, Translation3, UnitQuaternion, Vector3};
use ppa_phantom::{LowerLeg, TableTop};
use ppa_xray::{
    ComptonModel, Detector, FastSettings, HuCalibration, PreparedPhantom, Presentation, Projection,
    Spectrum, TubeSpec, VoxelPhantom,
};

fn main() -> Result<(), Box<dyn Error>> {
    let mut arguments = std::env::args().skip(1);
    let views: u32 = arguments.next().map_or(Ok(12), |text| text.parse())?;
    let out = PathBuf::from(arguments.next().unwrap_or_else(|| "sweep".into()));
    std::fs::create_dir_all(&out)?;

    let limb = LowerLeg::p01();
    let volume = limb.voxelise(1.5, TableTop::Absent)?;
    let voxels = VoxelPhantom::from_volume(&volume, &HuCalibration::default(), None)?;
    let phantom = PreparedPhantom::new(voxels, ComptonModel::default());
    let spectrum = Spectrum::tungsten(&TubeSpec::new(
        70.0,
        12.0,
        vec!["Al:2.5".parse()?, "Cu:0.1".parse()?],
    ))?;
    let isocentre = Translation3::from(limb.truth().joint_centre);
    // The beam from anterior (ct −y), detector columns along ct x.
    let from_front = Rotation3::from_matrix_unchecked(Matrix3::from_columns(&[
        Vector3::x(),
        -Vector3::z(),
        Vector3::y(),
    ]));

    for view in 0..views {
        let orbit_deg = 180.0 * f64::from(view) / f64::from(views);
        let orbit = Rotation3::from_axis_angle(&Vector3::z_axis(), orbit_deg.to_radians());
        let projection = Projection::new(
            isocentre
                * UnitQuaternion::from_rotation_matrix(&(orbit * from_front))
                * Isometry3::translation(0.0, 0.0, -700.0),
            1_100.0,
            Detector::centred(200, 200, 1.5),
        );
        let settings = FastSettings::default()
            .with_scatter_histories(20_000)
            .with_seed(view.into());
        let never = |_| ControlFlow::Continue(());
        let preview = phantom.preview(&spectrum, &projection, &settings, &never)?;
        let image = phantom.fast(&spectrum, &projection, &settings)?;
        println!(
            "{orbit_deg:5.1}°: preview of {} x {}, image of {} x {} pixels",
            preview.detector.columns,
            preview.detector.rows,
            image.detector.columns,
            image.detector.rows
        );
        let file = out.join(format!("{view:03}.png"));
        image.write_png(&file, &Presentation::default())?;
    }
    Ok(())
}
