//! Effect of the other side and of beam directions.

use super::*;

/// A mirrored foot, rotated the other way, has the same openness up to the rays that run along an edge of a voxel.
#[test]
fn left_and_right_give_one_curve() {
    use Side::{Left, Right};
    let (grid, labels, truth) = labelled("P01", Right, 1.0);
    let space = joint_space(&grid, &labels, &truth);
    let [nx, ..] = grid.size();
    let mirrored: Vec<u8> = (0..grid.len())
        .map(|index| {
            let [i, j, k] = grid.voxel(index);
            labels[grid.index([nx - 1 - i, j, k])]
        })
        .collect();
    let middle = 0.5 * (grid.centre([0.0; 3]).x + grid.centre([(nx - 1) as f64, 0.0, 0.0]).x);
    let mut joint = truth.joint_centre;
    joint.x = 2.0 * middle - joint.x;
    let mut axis = truth.axis_direction.into_inner();
    axis.x = -axis.x;
    let bones = AnkleBones::new(&grid, &mirrored, BoneNumbers::default(), &joint).unwrap();
    let mirrored = JointSpace::new(bones, &ct_from_patient(joint, axis)).unwrap();
    let curve = |space: &JointSpace, side| {
        let angles = [10.0, 14.0, 18.0, 22.0, 26.0];
        space
            .openness(&angles.map(|d| turned(space, side, d)))
            .unwrap()
    };
    for degrees in [0.0, 20.0, 40.0] {
        let a = space.hidden(&turned(&space, Right, degrees));
        let b = mirrored.hidden(&turned(&mirrored, Left, degrees));
        for (a, b) in [(a.medial, b.medial), (a.lateral, b.lateral)] {
            assert!((a.median_mm - b.median_mm).abs() < 0.2, "{a:?}, {b:?}");
        }
    }
    for (a, b) in curve(&space, Right).iter().zip(curve(&mirrored, Left)) {
        for (a, b) in a.worst().iter().zip(b.worst()) {
            assert!((a - b).abs() < 0.01, "{a}, {b}");
        }
        assert!((a.superior - b.superior).abs() < 0.01);
    }
}

/// A tilted leg, a flexed foot and a beam centred elsewhere along the leg all change the angle between beam and leg. The gap
/// between trochlea and plafond is part of a cylinder: it looks the same until the beam meets the end of its arc, about 20
/// degrees from the middle, and closes beyond that.
#[test]
fn tilt_closes_the_superior_gutter_beyond_the_end_of_its_arc() {
    let side = Side::Right;
    let (space, truth) = mortise("P01", side, 1.0);
    let level = turned(&space, side, truth.mortise_angle_rad.to_degrees());
    let shifted = |tilt_deg: f64| Exposure {
        source: level.source
            + space
                .limb
                .axis
                .scale(level.distance_mm() * tilt_deg.to_radians().tan()),
        ..level
    };
    let tilts = [-45.0, -35.0, -25.0, 0.0, 25.0, 35.0, 45.0];
    let found = space.openness(&tilts.map(shifted)).unwrap();
    let superior: Vec<f64> = found.iter().map(|o| o.superior).collect();
    assert!(superior[3] > 0.95, "{superior:?}");
    for (near, far) in [(3, 2), (2, 1), (1, 0), (3, 4), (4, 5), (5, 6)] {
        assert!(superior[far] < superior[near] - 0.1, "{superior:?}");
    }
}
