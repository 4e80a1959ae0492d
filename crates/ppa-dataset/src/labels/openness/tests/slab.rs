//! A joint of boxes, whose gutters open as a formula tells.

use super::*;

/// A talus of 10 x 25 x 15 mm between a fork of boxes: gutters of `width` mm beside it and above it, all 25 mm deep.
fn fork(spacing: f64, width: f64) -> AnkleBones {
    let half = 17.0;
    let n = (2.0 * half / spacing) as usize;
    // The faces of the boxes lie between voxel centres.
    let first = 0.5 * spacing - half;
    let grid = Grid::axis_aligned(
        [n; 3],
        Vector3::from_element(spacing),
        Point3::from([first; 3]),
    );
    let grid = grid.unwrap();
    let labels: Vec<u8> = (0..grid.len())
        .map(|index| {
            let p = grid.centre(grid.voxel(index).map(|v| v as f64));
            let deep = p.y.abs() <= 12.5;
            match (p.x, p.z) {
                _ if !deep => 0,
                (x, z) if x.abs() <= 5.0 && (-15.0..=0.0).contains(&z) => 1,
                (x, z) if (5.0 + width..15.0).contains(&x) && z >= -12.0 => 3,
                (x, z) if (-15.0..=-5.0 - width).contains(&x) && z >= -12.0 => 4,
                (x, z) if x.abs() <= 4.0 && z >= width => 3,
                _ => 0,
            }
        })
        .collect();
    AnkleBones::new(&grid, &labels, BoneNumbers::default(), &Point3::origin()).unwrap()
}

fn openness(space: &JointSpace, degrees: &[f64]) -> Vec<Openness> {
    // Far away, so that rays are nearly parallel, as the formula of the slab has them.
    let exposures: Vec<_> = degrees
        .iter()
        .map(|d| Exposure::around(&space.limb, d.to_radians(), 1e5))
        .collect();
    space.openness(&exposures).unwrap()
}

/// A slab of width w and depth L is closed from atan(w / L) on, within half a degree, on both sides, and half open at half its
/// tangent.
#[test]
fn a_slab_closes_at_the_angle_whose_tangent_is_width_over_depth() {
    for width in [3.0_f64, 4.0] {
        // Blur rounds the edges: in voxels of 0.5 mm the window is 0.75 degrees wider.
        let bones = fork(0.2, width);
        let space =
            JointSpace::new(bones, &ct_from_patient(Point3::origin(), Vector3::z())).unwrap();
        let closes = (width / 25.0).atan().to_degrees();
        let half = (0.5 * width / 25.0).atan().to_degrees();
        let steps: Vec<f64> = (-4..=4).map(|n| closes + 0.25 * f64::from(n)).collect();
        let mut degrees = vec![0.0, half, -half];
        degrees.extend(&steps);
        degrees.extend(steps.iter().map(|d| -d));
        let found = openness(&space, &degrees);
        for of in [|o: &Openness| o.medial, |o: &Openness| o.lateral] {
            let found: Vec<[f64; 3]> = found.iter().map(of).collect();
            assert!(found[0][1] > 0.95, "{width}: {found:?}");
            for side in [1, 2] {
                // A pixel is a twelfth of the narrower slab.
                assert!((found[side][1] - 0.5).abs() < 0.1, "{width}: {found:?}");
            }
            for side in found[3..].chunks(steps.len()) {
                // With half a millimetre of bone let through the slab seems so much less deep: 0.14 degrees.
                let shut = side.iter().position(|open| open[0] < 0.02);
                let half_window = steps[shut.expect("it closes")];
                println!("{width}: {half_window:.2}, {closes:.2}");
                assert!(
                    (half_window - closes).abs() < 0.51,
                    "{half_window}, {closes}"
                );
            }
        }
    }
}

/// Chords do not come in steps of the ray, 0.4 mm, or tolerances of 0.5, 1 and 2 mm would act as 0.4, 0.8 and 2.
#[test]
fn chords_are_as_long_as_the_body_is_deep() {
    let bones = fork(0.5, 4.0);
    let talus = bones.body(AnkleBone::Talus);
    for n in 0..7 {
        let angle = 0.04 * f64::from(n);
        let exposure = Exposure {
            source: Point3::new(1000.0 * angle.sin(), -1000.0 * angle.cos(), -7.0),
            joint: Point3::new(0.0, 0.0, -7.0),
            across: Vector3::new(angle.cos(), angle.sin(), 0.0),
            along: Vector3::z(),
        };
        let ray = rays::Ray::through(&exposure, [0.1 * f64::from(n), 0.0], &bones);
        let found = ray.chord_mm(&bones, &[talus], f64::INFINITY);
        let expected = 25.0 / angle.cos();
        assert!(
            (found - expected).abs() < 0.08,
            "{angle}: {found}, {expected}"
        );
        // What is longer than asked for is told to be longer, no more.
        assert!(ray.chord_mm(&bones, &[talus], 2.0) > 2.0);
    }
}
