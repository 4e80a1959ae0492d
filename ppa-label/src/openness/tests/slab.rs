//! A joint of boxes, whose gutters open according to a formula.

use super::*;

/// Depth of every box along the beam, mm.
const DEPTH: f64 = 25.0;

/// A talus of 10 x 25 x 15 mm in a fork of boxes: gutters of `width` mm next to it and above it, all 25 mm deep.
fn fork(spacing: f64, width: f64) -> AnkleBones {
    flexed_fork(spacing, width, 0.0)
}

/// The same with its talus rotated about the middle of its upper face, toes down.
fn flexed_fork(spacing: f64, width: f64, flexion_deg: f64) -> AnkleBones {
    let (sine, cosine) = flexion_deg.to_radians().sin_cos();
    let half = 17.0;
    let n = (2.0 * half / spacing) as usize;
    // The faces of the boxes are between voxel centres.
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
            let (y, z) = (cosine * p.y - sine * p.z, sine * p.y + cosine * p.z);
            let deep = |y: f64| y.abs() <= 0.5 * DEPTH;
            if p.x.abs() <= 5.0 && deep(y) && (-15.0..=0.0).contains(&z) {
                return 1;
            }
            match (p.x, p.z) {
                _ if !deep(p.y) => 0,
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
    // Far away, so that rays are nearly parallel, as the formula of the slab assumes.
    let exposures: Vec<_> = degrees
        .iter()
        .map(|d| Exposure::around(&space.limb, d.to_radians(), 1e5))
        .collect();
    space.openness(&exposures).unwrap()
}

/// A slab of width w and depth L is closed from atan(w / L) on, within half a degree, on both sides, and half open at half its
/// tangent.
#[test]
fn a_slab_closes_at_atan_of_width_over_depth() {
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
                // If half a millimetre of bone is tolerated, the slab seems that much less deep: 0.14 degrees.
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

/// A beam that meets the leg at an angle φ, because its centre is shifted along the leg or the leg is tilted, finds of a superior gutter of
/// width w and depth L with plane faces: nothing in its way up to atan(w / L), then L / cos φ − w / sin φ of bone where
/// L / cos φ lie above and below, so a contrast of w / (L tan φ).
#[test]
fn a_shifted_beam_closes_a_plane_gutter_by_formula() {
    let width = 3.0;
    let bones = fork(0.25, width);
    let space = JointSpace::new(bones, &ct_from_patient(Point3::origin(), Vector3::z())).unwrap();
    let level = Exposure::around(&space.limb, 0.0, 1e5);
    let open = space.contrast(&level);
    assert!(open > 0.97, "{open}");
    for degrees in [-25.0, -20.0, -15.0, -10.0, 10.0, 15.0, 20.0, 25.0_f64] {
        let tangent = degrees.to_radians().tan();
        let shifted = Exposure {
            source: level.source + space.limb.axis.scale(level.distance_mm() * tangent),
            ..level
        };
        let found = space.contrast(&shifted);
        let expected = width / (DEPTH * tangent.abs());
        println!("{degrees}: {found:.3}, {expected:.3}");
        assert!(
            (found - expected).abs() < 0.04,
            "{degrees}: {found}, {expected}"
        );
    }
}

/// A talus with plane faces, flexed by φ about the middle of its upper face, stands in the superior gutter with half its depth: the
/// highest free ray, at the height w of the plafond, meets L / (2 cos φ) − w / (sin φ cos φ) of it.
#[test]
fn flexion_closes_a_plane_superior_gutter_as_the_formula_tells() {
    let width = 3.0;
    for degrees in [10.0, 15.0, 25.0_f64] {
        let bones = flexed_fork(0.25, width, degrees);
        let space =
            JointSpace::new(bones, &ct_from_patient(Point3::origin(), Vector3::z())).unwrap();
        let found = space.contrast(&Exposure::around(&space.limb, 0.0, 1e5));
        let (sine, cosine) = degrees.to_radians().sin_cos();
        let chord = |height: f64| 0.5 * DEPTH / cosine - height / (sine * cosine);
        // Rows are half a millimetre apart, so that the highest free one lies up to that much below the plafond.
        let [most, least] = [width, width - 0.5].map(|h| 1.0 - chord(h).max(0.0) / DEPTH);
        println!("{degrees}: {found:.3}, {least:.3} to {most:.3}");
        assert!(
            (least - 0.02..most + 0.02).contains(&found),
            "{degrees}: {found}, {least} to {most}"
        );
    }
}

/// Chords are not multiples of the ray's step, 0.4 mm; otherwise tolerances of 0.5, 1 and 2 mm would act as 0.4, 0.8 and 2.
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
        // Longer chords are only reported to be longer.
        assert!(ray.chord_mm(&bones, &[talus], 2.0) > 2.0);
    }
}

/// Two faces of depth L at a distance w overlap by L sin φ − w cos φ.
#[test]
fn a_slab_is_hidden_by_what_its_faces_overlap() {
    let width = 3.0;
    let patient = ct_from_patient(Point3::origin(), Vector3::z());
    let space = JointSpace::new(fork(0.25, width), &patient).unwrap();
    for degrees in [-40.0_f64, -20.0, -10.0, -4.0, 0.0, 4.0, 10.0, 20.0, 40.0] {
        let exposure = Exposure::around(&space.limb, degrees.to_radians(), 1e5);
        let (sine, cosine) = degrees.abs().to_radians().sin_cos();
        let expected = (DEPTH * sine - width * cosine).max(0.0);
        let HiddenGutters { medial, lateral } = space.hidden(&exposure);
        for found in [medial, lateral] {
            // Columns are 0.2 mm wide, and blur rounds the edges.
            let off = (found.median_mm - expected).abs();
            assert!(off < 0.6, "{degrees}: {found:?}, expected {expected}");
            let share = if expected > 0.0 { 1.0 } else { 0.0 };
            assert_eq!(found.share, share, "{degrees}: {found:?}");
        }
    }
}
