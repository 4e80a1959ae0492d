//! A CT acquisition of a water cylinder with a bone insert, and the line integrals used for reconstruction.
//!
//! Prints one detector row of the first view: −ln(signal / open field) with and without scatter. Scatter makes the middle of the
//! cylinder look less dense, which appears as cupping in reconstructions.
//!
//! `cargo run --release -p ppa-xray --example ct_acquisition -- [VIEWS]`

use std::error::Error;

use nalgebra::{Isometry3, Matrix3, Point3, Rotation3, UnitQuaternion, Vector3};
use ppa_ct::Grid;
use ppa_xray::{
    Category, ComptonModel, Detector, FastSettings, Material, PreparedPhantom, Projection,
    Spectrum, TubeSpec, VoxelPhantom,
};

fn main() -> Result<(), Box<dyn Error>> {
    let views: u32 = std::env::args().nth(1).map_or(Ok(4), |text| text.parse())?;

    // 100 mm across, along z, in air.
    let grid = Grid::axis_aligned(
        [60, 60, 40],
        Vector3::repeat(2.0),
        Point3::new(-59.0, -59.0, -39.0),
    )?;
    let names = [("air", 0.001_205), ("water", 1.0), ("bone_cortical", 1.85)];
    let (material, density) = (0..grid.len())
        .map(|index| {
            let at = grid.centre(grid.voxel(index).map(|v| v as f64));
            let material = if (at.x - 25.0).hypot(at.y) < 10.0 {
                2
            } else {
                u8::from(at.x.hypot(at.y) < 50.0)
            };
            (material, names[usize::from(material)].1)
        })
        .unzip();
    let materials = names
        .iter()
        .map(|(name, _)| Material::named(name))
        .collect::<Result<Vec<_>, _>>()?;
    let voxels = VoxelPhantom::new(grid, material, density, materials)?;
    let phantom = PreparedPhantom::new(voxels, ComptonModel::default());
    let spectrum = Spectrum::tungsten(&TubeSpec::new(120.0, 12.0, vec!["Al:6".parse()?]))?;
    // Columns along ct x, rows along ct z, source at ct −y.
    let from_front = Rotation3::from_matrix_unchecked(Matrix3::from_columns(&[
        Vector3::x(),
        -Vector3::z(),
        Vector3::y(),
    ]));

    for view in 0..views {
        let angle_deg = 360.0 * f64::from(view) / f64::from(views);
        let gantry = Rotation3::from_axis_angle(&Vector3::z_axis(), angle_deg.to_radians());
        let projection = Projection::new(
            UnitQuaternion::from_rotation_matrix(&(gantry * from_front))
                * Isometry3::translation(0.0, 0.0, -570.0),
            1_040.0,
            Detector::centred(120, 40, 2.0),
        );
        let settings = FastSettings::default()
            .with_dose_histories(f64::INFINITY)
            .with_scatter_histories(40_000)
            .with_seed(view.into());
        let image = phantom.fast(&spectrum, &projection, &settings)?;
        let (primary, total) = (&image.layer(Category::Primary).value, image.total());
        let middle = 20 * 120 + 60;
        println!(
            "{angle_deg:5.1}°: scatter is {:.0} % of the signal behind the axis",
            100.0 * (1.0 - primary[middle] / total[middle])
        );
        if view == 0 {
            println!("mm from the axis on the detector: line integral with scatter, without");
            for column in (4..120).step_by(12) {
                let pixel = 20 * 120 + column;
                let [with, without] = [total[pixel], primary[pixel]]
                    .map(|signal| (image.open_field_at(pixel) / f64::from(signal)).ln());
                let mm = image.detector.pixel_centre_mm(pixel).x;
                println!("{mm:6.0}: {with:.3}, {without:.3}");
            }
        }
    }
    Ok(())
}
