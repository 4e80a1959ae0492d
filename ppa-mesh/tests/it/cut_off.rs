//! Cutting balls off a scan.

use nalgebra::Point3;
use ppa_mesh::{Ball, LimbError, LimbSettings, extract_limb, toggle_body};

use crate::limb::{PHANTOM, VOXEL_MM};

fn removing(ball: Ball) -> LimbSettings {
    LimbSettings {
        removed: vec![ball],
        ..LimbSettings::default()
    }
}

/// A ball at the front of the shin, half in the air.
#[test]
fn a_ball_takes_its_voxels_and_leaves_its_surface() {
    let (leg, scan, whole) = &*PHANTOM;
    let grid = scan.grid();
    let middle = grid.centre([0, 1, 2].map(|axis| 0.5 * grid.size()[axis] as f64));
    let vertices = whole.mesh.vertices.iter().map(|v| v.cast::<f64>());
    let level = vertices.filter(|v| (v.z - middle.z).abs() < VOXEL_MM);
    let front = level.min_by(|a, b| a.y.total_cmp(&b.y)).expect("skin");
    let radius_mm = 16.0;
    let ball = Ball {
        centre_mm: front.into(),
        radius_mm,
    };
    let cut = extract_limb(scan, &removing(ball)).expect("limb");
    let off = |p: &Point3<f64>| (p - front).norm() - radius_mm;
    let mut taken = 0;
    for at in 0..grid.len() {
        let off_mm = off(&grid.centre(grid.voxel(at).map(|v| v as f64)));
        assert!(!(cut.mask[at] && off_mm < 0.0), "{off_mm}");
        // Thin edges between the skin and the ball wear off.
        if cut.mask[at] != whole.mask[at] {
            assert!(off_mm < 4.0 * VOXEL_MM && whole.mask[at], "{off_mm}");
        }
        taken += usize::from(whole.mask[at] && off_mm < 0.0);
    }
    // Only voxels of the limb are in the ball, each 1.5 mm wide.
    let taken_mm3 = taken as f64 * VOXEL_MM.powi(3);
    assert!(taken_mm3 > 3000.0, "{taken_mm3}");
    assert!(
        (cut.report.removed_mm3 / taken_mm3 - 1.0).abs() < 0.02,
        "{} {taken_mm3}",
        cut.report.removed_mm3
    );
    // Deep in the limb the surface is that of the ball.
    let vertices = cut.mesh.vertices.iter().map(|v| v.cast::<f64>());
    let deep = vertices.filter(|v| leg.skin_distance_mm(v) < -4.0);
    let errors: Vec<f64> = deep.map(|v| off(&v).abs()).collect();
    assert!(errors.len() > 100, "{}", errors.len());
    let mean = errors.iter().sum::<f64>() / errors.len() as f64;
    assert!(mean < 0.1 * VOXEL_MM, "{mean}");
}

#[test]
fn what_a_cut_separates_is_a_body_that_can_be_kept() {
    let (_, scan, whole) = &*PHANTOM;
    let grid = scan.grid();
    let bones = &whole.report.bodies[0];
    // Through the entire shin.
    let [low, high] = [whole.report.low, whole.report.high];
    let middle = grid.centre([0, 1, 2].map(|axis| 0.5 * (low[axis] + high[axis]) as f64));
    let shin = whole.mesh.vertices.iter().map(|v| v.cast::<f64>());
    let level: Vec<_> = shin.filter(|v| (v.z - middle.z).abs() < 2.0).collect();
    let sum = level
        .iter()
        .fold(nalgebra::Vector3::zeros(), |s, v| s + v.coords);
    let centre = Point3::from(sum / level.len() as f64);
    let widest = level
        .iter()
        .map(|v| (v - centre).norm())
        .fold(0.0, f64::max);
    let ball = Ball {
        centre_mm: centre.into(),
        radius_mm: widest + 8.0,
    };
    let settings = removing(ball);
    let cut = extract_limb(scan, &settings).expect("limb");
    // Besides specks that the cut leaves.
    let bodies = cut.report.bodies.iter();
    let large = bodies.filter(|body| body.core_mm3 > 0.1 * bones.core_mm3);
    assert_eq!(large.count(), 2, "{:?}", cut.report.bodies);
    let other = cut.report.bodies.iter().find(|body| !body.chosen);
    let point = other.expect("two bodies").point_mm();
    let (both, kept) = toggle_body(scan, &settings, point).expect("limb");
    assert_eq!(kept, [point]);
    assert!(both.report.limb_voxels > cut.report.limb_voxels);
    assert_eq!(both.mesh.topology().components, 2);
}

#[test]
fn a_ball_without_a_radius_is_refused() {
    let (_, scan, _) = &*PHANTOM;
    for (centre, radius_mm, named) in [
        (0.0, 0.0, "removed[].radius_mm"),
        (0.0, f64::NAN, "removed[].radius_mm"),
        (f64::INFINITY, 1.0, "removed[].centre_mm"),
    ] {
        let ball = Ball {
            centre_mm: [centre, 0.0, 0.0],
            radius_mm,
        };
        let refused = extract_limb(scan, &removing(ball));
        assert!(
            matches!(refused, Err(LimbError::Setting { name, .. }) if name == named),
            "{refused:?}"
        );
    }
    // Far from the scan it takes nothing.
    let (_, _, whole) = &*PHANTOM;
    let ball = Ball {
        centre_mm: [9e3, 0.0, 0.0],
        radius_mm: 10.0,
    };
    assert_eq!(extract_limb(scan, &removing(ball)).as_ref(), Ok(whole));
}

#[test]
fn settings_without_balls_are_written_as_before() {
    let text = serde_json::to_string(&LimbSettings::default()).unwrap();
    assert!(!text.contains("removed"), "{text}");
    let (_, _, whole) = &*PHANTOM;
    let text = serde_json::to_string(&whole.report).unwrap();
    assert!(!text.contains("removed_mm3"), "{text}");
}
