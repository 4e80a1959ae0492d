//! A lead ball next to the ankle: radiograph and depth images show it at the same place.

use nalgebra::{Isometry3, Matrix4, Point3, Vector3, Vector4};
use ppa_ct::{Grid, Volume};
use ppa_depth::{Body, MeshBody, PlacedBody};
use ppa_generate::{Plan, SceneSetup, projection};
use ppa_mesh::{Border, iso_surface};
use ppa_phantom::{LowerLeg, TableTop};
use ppa_scene::{LandmarkOverrides, Landmarks, LimbKind, Placement, Side, find_landmarks, place};
use ppa_xray::{Category, Detector, FastSettings, Material, VoxelPhantom, fast};

const RADIUS_MM: f64 = 8.0;
const VOXEL_MM: f64 = 0.5;

/// Depth of a point inside the ball, mm.
fn depth_mm(p: &Point3<f64>, centre: &Point3<f64>) -> f64 {
    RADIUS_MM - (p - centre).norm()
}

fn around(centre: &Point3<f64>) -> Grid {
    let side = (2.0 * (RADIUS_MM + 2.0) / VOXEL_MM) as usize;
    let half = 0.5 * VOXEL_MM * (side - 1) as f64;
    // The ball's centre is neither at a voxel centre nor midway between two.
    let origin = centre - Vector3::new(half + 0.11, half - 0.07, half + 0.19);
    Grid::axis_aligned([side; 3], Vector3::repeat(VOXEL_MM), origin).unwrap()
}

/// Centre of the dark spot in device x and y, mm: the mean over the pixels, weighted by the missing signal.
fn shadow(
    centre: &Point3<f64>,
    placement: &Placement,
    landmarks: &Landmarks,
    setup: &SceneSetup,
    plan: &Plan,
) -> [f64; 2] {
    let grid = around(centre);
    let density = (0..grid.len()).map(|index| {
        let p = grid.centre(grid.voxel(index).map(|v| v as f64));
        // Partial volume of a voxel cut by the surface, assumed flat.
        let share = (depth_mm(&p, centre) / VOXEL_MM + 0.5).clamp(0.0, 1.0);
        11.35 * share as f32
    });
    let density: Vec<f32> = density.collect();
    let lead = Material::named("lead").unwrap();
    let phantom = VoxelPhantom::new(grid, vec![0; density.len()], density, vec![lead]).unwrap();
    let exposure = projection(placement, landmarks, &setup.table.room.device, &plan.xray);
    let settings = FastSettings::default()
        .with_dose_histories(f64::INFINITY)
        .with_scatter_histories(2_000);
    let image = fast(&phantom, &setup.spectrum, &exposure, &settings).unwrap();
    let primary = &image.layer(Category::Primary).value;
    let Detector {
        columns,
        rows,
        pixel_mm,
        ..
    } = image.detector;
    let (mut sum, mut moment) = (0.0, [0.0; 2]);
    for (pixel, value) in primary.iter().enumerate() {
        let missing = 1.0 - f64::from(*value) / image.open_field_at(pixel);
        if missing > 0.5 {
            let at = [pixel as u32 % columns, pixel as u32 / columns];
            let middle = [columns, rows].map(|n| 0.5 * (f64::from(n) - 1.0));
            sum += missing;
            for axis in 0..2 {
                moment[axis] += missing * (f64::from(at[axis]) - middle[axis]) * pixel_mm;
            }
        }
    }
    assert!(
        sum * pixel_mm * pixel_mm > 3.0 * RADIUS_MM * RADIUS_MM,
        "{sum} dark pixels"
    );
    moment.map(|moment| moment / sum)
}

/// Centre of the sphere through points by least squares: |p|² = 2 c·p + (r² − |c|²).
fn sphere_centre(points: &[Point3<f64>]) -> Point3<f64> {
    let near = points[0].coords; // keeps the squares small
    let (mut normal, mut right) = (Matrix4::zeros(), Vector4::zeros());
    for p in points {
        let v = p.coords - near;
        let row = Vector4::new(2.0 * v.x, 2.0 * v.y, 2.0 * v.z, 1.0);
        normal += row * row.transpose();
        right += row * v.norm_squared();
    }
    let found = normal.lu().solve(&right).unwrap();
    Point3::from(found.xyz() + near)
}

/// The position through camera, device pose, room, patient and scan differs from that through the radiograph by at most half
/// a detector pixel.
#[test]
fn radiograph_and_depth_images_agree_on_a_lead_ball() {
    let mut plan = Plan::new(Vec::new());
    plan.xray.detector = Detector::centred(400, 400, 0.8);
    let setup = SceneSetup::of_plan(&plan).unwrap();
    let leg = LowerLeg::p01().voxelise(3.0, TableTop::Absent).unwrap();
    let skin = iso_surface(&leg, -500.0, Border::Open).unwrap();
    let mask: Vec<bool> = leg.hu().iter().map(|hu| *hu >= -500.0).collect();
    let choices = LandmarkOverrides {
        limb: Some(LimbKind::Other),
        ..LandmarkOverrides::default()
    };
    let landmarks = find_landmarks(&leg, &skin, &mask, Side::Right, &choices).unwrap();
    let device = &setup.table.room.device;
    for (degrees, offset) in [
        (0.0_f64, [40.0, -60.0, 35.0]),
        (35.0, [-55.0, -50.0, -40.0]),
    ] {
        let table = &setup.table.plane.plane;
        let angle = degrees.to_radians();
        let placement = place(&skin.vertices, &landmarks, angle, table, device).unwrap();
        let centre = Point3::from(landmarks.joint_centre) + Vector3::from(offset);
        let dark = shadow(&centre, &placement, &landmarks, &setup, &plan);

        let grid = around(&centre);
        let inside = (0..grid.len())
            .map(|index| {
                depth_mm(&grid.centre(grid.voxel(index).map(|v| v as f64)), &centre) as f32
            })
            .collect();
        let ball = iso_surface(&Volume::new(grid, inside).unwrap(), 0.0, Border::Open).unwrap();
        let body = Body::Mesh(MeshBody::new(&ball.vertices, &ball.triangles).unwrap());
        let room_from_ct = placement.room_from_patient * landmarks.patient_from_ct();
        let device_from_room: Isometry3<f64> = *device.room_from_device.inverse().isometry();
        for placed in &setup.cameras {
            let camera_from_body = placed.camera_from_room * room_from_ct.isometry();
            let image = ppa_depth::render(
                &placed.camera,
                &[PlacedBody {
                    body: &body,
                    camera_from_body,
                }],
            );
            let rays = placed.camera.rays();
            let seen: Vec<Point3<f64>> = image
                .z_mm
                .iter()
                .zip(rays.iter())
                .filter(|(z, _)| **z > 0.0)
                .filter_map(|(z, ray)| {
                    let (z, ray) = (f64::from(*z), (*ray)?);
                    Some(Point3::new(ray.x * z, ray.y * z, z))
                })
                .collect();
            assert!(seen.len() > 30, "{} pixels see the ball", seen.len());
            let device_from_camera = device_from_room * placed.camera_from_room.inverse();
            let at = device_from_camera * sphere_centre(&seen);
            let onto_detector = device.source_detector_mm / at.z;
            let apart: Vec<f64> = [at.x, at.y]
                .iter()
                .zip(dark)
                .map(|(lateral, dark)| (lateral * onto_detector - dark) / 0.8)
                .collect();
            println!(
                "{degrees} degrees, {:?}: {apart:.3?} pixels apart",
                placed.view
            );
            assert!(
                apart.iter().all(|apart| apart.abs() < 0.5),
                "{apart:?} pixels"
            );
        }
    }
}
