//! Pictures of a phantom: slices, parallel projections under internal rotation, and its skin.
//!
//! `cargo run --release -p ppa-phantom --example views -- OUT_DIR [SPACING_MM] [NAME]`

use std::error::Error;
use std::path::PathBuf;

use image::{GrayImage, Luma};
use nalgebra::{Point3, Rotation3, Unit, Vector3};
use ppa_ct::Volume;
use ppa_phantom::{LowerLeg, Side, TableTop};

/// Edge of a picture's pixel over that of a voxel.
const PIXEL_OVER_VOXEL: f64 = 0.4375;

fn main() -> Result<(), Box<dyn Error>> {
    let mut args = std::env::args().skip(1);
    let out = PathBuf::from(args.next().ok_or("expected an output folder")?);
    let spacing_mm: f64 = args.next().map_or(Ok(0.8), |s| s.parse())?;
    let pixel_mm = PIXEL_OVER_VOXEL * spacing_mm;
    std::fs::create_dir_all(&out)?;

    let name = args.next().unwrap_or("P01".to_owned());
    let limb = LowerLeg::family(&name, Side::Right)?;
    let ct = limb.voxelise(spacing_mm, TableTop::Present)?;
    let joint = limb.truth().joint_centre;
    for (name, across, down, centre, size) in [
        (
            "coronal",
            Vector3::x(),
            -Vector3::z(),
            joint,
            [130.0, 150.0],
        ),
        (
            "coronal_talus",
            Vector3::x(),
            -Vector3::z(),
            joint - 6.0 * Vector3::y(),
            [130.0, 150.0],
        ),
        (
            "sagittal",
            -Vector3::y(),
            -Vector3::z(),
            joint - Vector3::new(0.0, 50.0, -60.0),
            [330.0, 330.0],
        ),
        (
            "sagittal_medial",
            -Vector3::y(),
            -Vector3::z(),
            joint - Vector3::new(-22.0, 50.0, -60.0),
            [330.0, 330.0],
        ),
        (
            "axial_shaft",
            Vector3::x(),
            Vector3::y(),
            joint + 120.0 * Vector3::z(),
            [140.0, 160.0],
        ),
        (
            "axial_incisura",
            Vector3::x(),
            Vector3::y(),
            joint + 12.0 * Vector3::z(),
            [140.0, 160.0],
        ),
        (
            "axial_mortise",
            Vector3::x(),
            Vector3::y(),
            joint - 9.0 * Vector3::z(),
            [140.0, 160.0],
        ),
        (
            "axial_foot",
            Vector3::x(),
            Vector3::y(),
            joint - Vector3::new(0.0, 70.0, 46.0),
            [130.0, 300.0],
        ),
    ] {
        let corner = centre - across * size[0] / 2.0 - down * size[1] / 2.0;
        picture(size, pixel_mm, |u, v| {
            let hu = ct
                .sample(&(corner + across * u + down * v))
                .unwrap_or(-1000.0);
            (hu + 250.0) / 1500.0
        })
        .save(out.join(format!("slice_{name}.png")))?;
    }
    let small = limb.voxelise(spacing_mm, TableTop::Absent)?;
    for degrees in [0.0, 18.0, 45.0, 90.0] {
        projection(&small, &joint, f64::to_radians(degrees), pixel_mm)
            .save(out.join(format!("projection_{degrees:02}.png")))?;
    }
    for (name, towards_limb) in [
        ("front", Vector3::new(0.0, 1.0, 0.0)),
        ("medial", Vector3::new(-1.0, 0.1, 0.0)),
        ("oblique", Vector3::new(0.8, 1.0, 0.35)),
        ("sole", Vector3::new(0.2, 0.3, 1.0)),
    ] {
        skin(&limb, towards_limb.normalize(), pixel_mm)
            .save(out.join(format!("skin_{name}.png")))?;
    }
    Ok(())
}

/// Picture of a function of mm to 0 (black) … 1 (white).
fn picture(size_mm: [f64; 2], pixel_mm: f64, value: impl Fn(f64, f64) -> f64) -> GrayImage {
    let [width, height] = size_mm.map(|s| (s / pixel_mm) as u32);
    GrayImage::from_fn(width, height, |i, j| {
        let grey = value(f64::from(i) * pixel_mm, f64::from(j) * pixel_mm);
        Luma([(255.0 * grey.clamp(0.0, 1.0)) as u8])
    })
}

/// Sum of attenuation along parallel rays from front to back, the limb rotated inwards about z.
fn projection(
    ct: &Volume,
    joint: &Point3<f64>,
    internal_rotation_rad: f64,
    pixel_mm: f64,
) -> GrayImage {
    let limb_from_room = Rotation3::from_axis_angle(&Vector3::z_axis(), -internal_rotation_rad);
    let (across, along) = (limb_from_room * Vector3::x(), limb_from_room * Vector3::y());
    let corner = joint - across * 80.0 + Vector3::z() * 100.0;
    picture([160.0, 190.0], pixel_mm, |u, v| {
        let start = corner + across * u - Vector3::z() * v;
        let sum: f64 = (-220..=120)
            .filter_map(|step| ct.sample(&(start + along * f64::from(step))))
            // Water near 60 keV; calcium attenuates more than its density suggests.
            .map(|hu| 0.02 * (1.0 + hu / 1000.0) * (1.0 + 0.4 * (hu / 400.0).clamp(0.0, 1.0)))
            .sum();
        1.3 * (1.0 - (-sum / 3.6).exp()) - 0.15
    })
}

/// The skin under a light next to the viewer.
fn skin(limb: &LowerLeg, towards_limb: Vector3<f64>, pixel_mm: f64) -> GrayImage {
    let truth = limb.truth();
    let up = if towards_limb.z.abs() > 0.8 {
        -Vector3::y()
    } else {
        Vector3::z()
    };
    let across = towards_limb.cross(&up).normalize();
    let down = towards_limb.cross(&across);
    let middle = truth.joint_centre + Vector3::new(0.0, -40.0, 60.0);
    let corner = middle - across * 170.0 - down * 200.0 - towards_limb * 400.0;
    let light = (-towards_limb + 0.6 * up - 0.5 * across).normalize();
    let along = Unit::new_normalize(towards_limb);
    picture([340.0, 400.0], pixel_mm, |u, v| {
        match limb.skin_hit(&(corner + across * u + down * v), &along, 900.0) {
            Some(hit) if hit.point.z < truth.joint_centre.z + 255.0 => {
                0.15 + 0.8 * hit.normal.dot(&light).max(0.0)
            }
            _ => 0.0,
        }
    })
}
