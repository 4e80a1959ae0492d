//! Landmarks of the phantom knee in any orientation in the scan, and limbs that are not a knee.

use std::sync::LazyLock;

use nalgebra::{Matrix4, Point3, Rotation3, Vector3};
use ppa_ct::{Grid, Interpolation, Volume};
use ppa_phantom::{Limb, LowerLeg, Scanner, TableTop};
use ppa_scene::{
    Joint, KneeAxis, LandmarkError, LandmarkNote, LandmarkOverrides, Landmarks, LimbKind,
    LimbMeasures, Plane, Side, XrayDevice, bump_sites, place,
};

use crate::scan::{P01, Scan};

const SPACING_MM: f64 = 1.5;

/// The phantom knee, and landmarks from its exact shape.
struct Knee {
    side: Side,
    volume: Volume,
    skin: Vec<Point3<f64>>,
    /// Middle of the joint line, by the phantom's construction.
    joint: Point3<f64>,
    /// Middle of the plateau from front to back, in the middle of the joint space.
    plateau: Point3<f64>,
    /// Perpendicular to the posterior condylar line.
    anterior: Vector3<f64>,
    /// Through the middle of the joint space where the condyles reach lowest, towards the patient's right.
    joint_line: Vector3<f64>,
}

impl Knee {
    fn of(side: Side) -> Self {
        let x = match side {
            Side::Right => -95.0,
            Side::Left => 95.0,
        };
        let limb = Limb::knee(side);
        let joint = Point3::new(x, 10.0, -150.0);
        let bone = |p: [f64; 3]| limb.bone(&(joint + Vector3::from(p)));
        let steps = |from: f64, to: f64, step: f64| {
            (0..=((to - from) / step).round() as usize).map(move |i| from + step * i as f64)
        };
        // Of the patient's right and left condyle: the middle of the joint space, and the most posterior point.
        let [right, left] = [-1.0, 1.0].map(|sign: f64| {
            let columns = steps(15.0, 30.0, 1.0)
                .flat_map(|x| steps(-5.0, 20.0, 1.0).map(move |y| [sign * x, y]));
            let (bottom, [x, y]) = columns
                .map(|[x, y]| {
                    let bottom =
                        steps(-3.0, 15.0, 0.05).find(|z| bone([x, y, *z]) == Some("femur"));
                    (bottom.unwrap_or(f64::INFINITY), [x, y])
                })
                .min_by(|a, b| a.0.total_cmp(&b.0))
                .unwrap();
            let top = steps(0.0, 10.0, 0.05).map(|down| bottom - down);
            let top = top
                .clone()
                .find(|z| bone([x, y, *z]) == Some("tibia"))
                .unwrap();
            let levels =
                steps(6.0, 34.0, 2.0).flat_map(|z| steps(10.0, 36.0, 1.0).map(move |x| [x, z]));
            let hindmost = levels
                .filter_map(|[x, z]| {
                    let x = sign * x;
                    let rear = steps(0.0, 30.0, 0.1).map(|forward| 40.0 - forward);
                    let mut rear = rear.filter(|y| bone([x, *y, z]) == Some("femur"));
                    rear.next().map(|y| [x, y])
                })
                .max_by(|a, b| a[1].total_cmp(&b[1]))
                .unwrap();
            (Vector3::new(x, 0.0, 0.5 * (bottom + top)), hindmost)
        });
        let behind = Vector3::new(left.1[0] - right.1[0], left.1[1] - right.1[1], 0.0);
        let volume = limb.voxelise(SPACING_MM, TableTop::Absent).unwrap();
        let grid = volume.grid();
        let inside = (0..grid.len()).filter(|index| volume.hu()[*index] > -500.0);
        let skin = inside.map(|index| grid.centre(grid.voxel(index).map(|v| v as f64)));
        Self {
            side,
            skin: skin.step_by(5).collect(),
            joint,
            plateau: joint + Vector3::new(0.0, 2.0, 0.5 * (left.0.z + right.0.z)),
            anterior: Vector3::new(behind.y, -behind.x, 0.0).normalize(),
            joint_line: (right.0 - left.0).normalize(),
            volume,
        }
    }

    fn check(&self, turn: &Rotation3<f64>) {
        let scan = Scan::under_the_scanner(&self.volume, self.skin.iter(), turn);
        let name = format!("{:?} {:?}", self.side, turn.scaled_axis());
        let found = scan.find(self.side, &automatic());
        let landmarks = found.unwrap_or_else(|error| panic!("{name}: {error}"));
        self.compare(&name, &landmarks, turn);
        let measures = LimbMeasures::of(&scan.volume, &scan.skin, &scan.mask, &landmarks).unwrap();
        let fibula = measures.fibula.unwrap();
        assert_eq!(fibula.side(), Some(self.side), "{name}: {fibula:?}");
    }

    /// Joint centre within 2 mm, axis, front and joint line within 2 degrees.
    fn compare(&self, name: &str, landmarks: &Landmarks, turn: &Rotation3<f64>) {
        assert_eq!(landmarks.limb, LimbKind::Knee, "{name}");
        let [found] = &landmarks.joints[..] else {
            panic!("{name}: {:?}", landmarks.joints)
        };
        let lines = found.lines.as_ref().unwrap();
        let centre = Point3::from(landmarks.joint_centre);
        let plateau_mm = (centre - turn * self.plateau).norm();
        let degrees =
            |a: [f64; 3], b: Vector3<f64>| Vector3::from(a).angle(&(turn * b)).to_degrees();
        let axis = degrees(landmarks.axis_direction, Vector3::z());
        let front = degrees(landmarks.anterior, self.anterior);
        let line = degrees(lines.joint_line, self.joint_line);
        println!(
            "{name}: joint {plateau_mm:.2} mm, axis {axis:.2}, front {front:.2}, joint line \
             {line:.2} degrees, gap {:.0} HU",
            found.gap_depth_hu
        );
        assert!(plateau_mm < 2.0, "{name}: {centre}");
        assert!(axis < 2.0 && front < 2.0 && line < 2.0, "{name}");
        assert!(!lines.plateau_is_cut && lines.anterior.is_some(), "{name}");
    }
}

static RIGHT: LazyLock<Knee> = LazyLock::new(|| Knee::of(Side::Right));
static LEFT: LazyLock<Knee> = LazyLock::new(|| Knee::of(Side::Left));

fn automatic() -> LandmarkOverrides {
    LandmarkOverrides::default()
}

fn asked(limb: LimbKind) -> LandmarkOverrides {
    LandmarkOverrides {
        limb: Some(limb),
        ..automatic()
    }
}

fn about(axis: usize, degrees: f64) -> Rotation3<f64> {
    Rotation3::from_scaled_axis(Vector3::ith(axis, degrees.to_radians()))
}

#[test]
fn a_right_knee_is_found_however_it_lies() {
    RIGHT.check(&Rotation3::identity());
    for axis in 0..3 {
        RIGHT.check(&about(axis, -20.0));
        RIGHT.check(&about(axis, 20.0));
    }
}

#[test]
fn a_left_knee_is_found_however_it_lies() {
    LEFT.check(&Rotation3::identity());
    for axis in 0..3 {
        LEFT.check(&about(axis, -20.0));
        LEFT.check(&about(axis, 20.0));
    }
}

/// Blurred, noisy and in slices of 3 mm, like real scans.
#[test]
fn a_knee_is_found_in_thick_noisy_slices() {
    let scanner = Scanner {
        noise_hu: 25.0,
        blur_fwhm_mm: 1.5,
        seed: 1,
    };
    let volume = scanner.scan(&RIGHT.volume).unwrap();
    let [ni, nj, nk] = volume.grid().size();
    let matrix = volume.grid().ct_from_voxel().matrix()
        * Matrix4::new_nonuniform_scaling(&Vector3::new(1.0, 1.0, 2.0));
    let affine = nalgebra::Affine3::from_matrix_unchecked(matrix);
    let grid = Grid::new([ni, nj, nk / 2], affine).unwrap();
    let thick = volume
        .resampled_to(&grid, Interpolation::Linear, -1000.0)
        .unwrap();
    let landmarks = Scan::of(thick).find(Side::Right, &automatic()).unwrap();
    RIGHT.compare("thick", &landmarks, &Rotation3::identity());
}

/// Choices that repeat the found values, as in a case with all choices filled in.
fn recorded(found: &Landmarks) -> LandmarkOverrides {
    LandmarkOverrides {
        axis: None,
        plane_points: None,
        ..found.open_choices(&automatic())
    }
}

/// Landmarks found from the recorded choices give the same patient frame.
#[test]
fn recorded_choices_reproduce_a_knee() {
    let scan = Scan::under_the_scanner(&LEFT.volume, LEFT.skin.iter(), &about(0, 20.0));
    let found = scan.find(Side::Left, &automatic()).unwrap();
    let again = scan.find(Side::Left, &recorded(&found)).unwrap();
    let [a, b] = [&found, &again].map(|l| l.patient_from_ct().isometry().to_homogeneous());
    assert!((a - b).amax() < 1e-9);
    assert_eq!(found.calf_region, again.calf_region);
    assert_eq!(found.joints, again.joints);
    let text = serde_json::to_string(&found).unwrap();
    assert!(text.contains("\"limb\":\"knee\""), "{text}");
    assert_eq!(serde_json::from_str::<Landmarks>(&text).unwrap(), found);
}

#[test]
fn a_knee_rests_on_the_table_and_bumps_reach_its_skin() {
    let scan = Scan::of(RIGHT.volume.clone());
    let landmarks = scan.find(Side::Right, &automatic()).unwrap();
    let table = Plane {
        normal: Vector3::z_axis(),
        offset_mm: 0.0,
    };
    let device = XrayDevice::overhead(1040.0, 1100.0);
    for degrees in [0.0_f64, 5.0, 30.0, 90.0] {
        let angle = degrees.to_radians();
        let placed = place(&scan.skin.vertices, &landmarks, angle, &table, &device).unwrap();
        let c = placed.contact;
        assert!(c.gap_mm < 1e-6 && c.penetration_mm < 1e-6, "{c:?}");
        assert!((c.distal_mm - c.proximal_mm).abs() < 0.051, "{c:?}");
    }
    for site in bump_sites(&landmarks) {
        let near = |p: &&Point3<f32>| (p.cast::<f64>() - site.centre).norm() < site.radius_mm;
        assert!(
            scan.skin.vertices.iter().filter(near).count() > 50,
            "{site:?}"
        );
    }
}

#[test]
fn a_knee_is_refused_where_an_ankle_was_asked_for() {
    let scan = Scan::of(RIGHT.volume.clone());
    let error = scan
        .find(Side::Right, &asked(LimbKind::LowerLeg))
        .unwrap_err();
    let LandmarkError::OtherJoint {
        asked,
        found,
        at_mm,
    } = error
    else {
        panic!("{error}")
    };
    assert_eq!([asked, found], [Joint::Ankle, Joint::Knee]);
    assert!(
        (Point3::from(at_mm) - RIGHT.plateau).norm() < 2.0,
        "{at_mm:?}"
    );
    let text = error.to_string();
    assert!(
        text.contains("no ankle found, but the knee is near -95, 1"),
        "{text}"
    );
    assert!(text.contains("(LPS): give --limb knee"), "{text}");
}

#[test]
fn an_ankle_is_refused_where_a_knee_was_asked_for() {
    let joint = LowerLeg::p01().truth().joint_centre;
    let error = P01.find(Side::Right, &asked(LimbKind::Knee)).unwrap_err();
    let LandmarkError::OtherJoint {
        asked,
        found,
        at_mm,
    } = error
    else {
        panic!("{error}")
    };
    assert_eq!([asked, found], [Joint::Knee, Joint::Ankle]);
    assert!((Point3::from(at_mm) - joint).norm() < 6.0, "{at_mm:?}");
}

/// Upside down, the search along the tibia ends at the knee: that is not an ankle, however short the calf is.
#[test]
fn an_upside_down_knee_is_no_ankle() {
    let over = about(1, 180.0);
    let whole = Scan::of(RIGHT.volume.clone());
    let [.., nk] = RIGHT.volume.grid().size();
    for from in [0, 10, 20, 30] {
        let knee = whole.slices(from..nk).turned(&over);
        let landmarks = knee.find(Side::Right, &automatic()).unwrap();
        assert_eq!(landmarks.limb, LimbKind::Knee, "from slice {from}");
        let off = Point3::from(landmarks.joint_centre) - over * RIGHT.plateau;
        assert!(off.norm() < 2.0, "{off:?}");
        let up = Vector3::from(landmarks.axis_direction).z;
        assert!(up < -0.99, "{up}");
        assert!(landmarks.scan_direction[2] < 0.0);
        let error = knee
            .find(Side::Right, &asked(LimbKind::LowerLeg))
            .unwrap_err();
        assert!(matches!(error, LandmarkError::OtherJoint { .. }), "{error}");
    }
}

/// P01 below the phantom knee: a whole leg.
fn leg() -> Scan {
    let truth = LowerLeg::p01().truth();
    let ankle = P01.volume.grid();
    let [ni, nj, nk] = ankle.size();
    let top = ankle.centre([0.0, 0.0, (nk - 1) as f64]).z;
    let level = top - 10.0;
    // 130 mm below the knee's joint, tibia over tibia.
    let onto = Vector3::new(
        truth.joint_centre.x,
        truth.joint_centre.y + 4.0,
        level + 130.0,
    ) - RIGHT.joint.coords;
    let spacing = 2.0;
    let slices = nk + (250.0 / spacing) as usize;
    let grid = Grid::axis_aligned(
        [ni + 20, nj + 20, slices],
        Vector3::repeat(spacing),
        ankle.origin_mm() - Vector3::new(20.0, 20.0, 0.0),
    )
    .unwrap();
    let air = |volume: &Volume, p: &Point3<f64>| volume.sample(p).unwrap_or(-1000.0) as f32;
    let hu = (0..grid.len()).map(|index| {
        let p = grid.centre(grid.voxel(index).map(|v| v as f64));
        if p.z < level {
            air(&P01.volume, &p)
        } else {
            air(&RIGHT.volume, &(p - onto))
        }
    });
    let hu = hu.collect();
    Scan::of(Volume::new(grid, hu).unwrap())
}

/// For a whole leg the ankle is used, or the knee on request; both are recorded.
#[test]
fn a_whole_leg_shows_both_joints() {
    let leg = leg();
    let landmarks = leg.find(Side::Right, &automatic()).unwrap();
    assert_eq!(landmarks.limb, LimbKind::LowerLeg);
    let ankle = LowerLeg::p01().truth().joint_centre;
    assert!((Point3::from(landmarks.joint_centre) - ankle).norm() < 6.0);
    let joints: Vec<Joint> = landmarks.joints.iter().map(|found| found.joint).collect();
    assert_eq!(joints, [Joint::Ankle, Joint::Knee]);
    let expected = |note: &LandmarkNote| {
        matches!(
            note,
            LandmarkNote::OtherJoint {
                joint: Joint::Knee,
                ..
            }
        )
    };
    assert!(
        landmarks.notes.iter().any(expected),
        "{:?}",
        landmarks.notes
    );
    let knee = leg.find(Side::Right, &asked(LimbKind::Knee)).unwrap();
    assert_eq!(knee.joint_centre, landmarks.joints[1].centre_mm);
    assert!((knee.joint_centre[2] - ankle.z) > 200.0);
    assert_eq!(knee.joints, landmarks.joints);
}

/// Without a calf, the femur gives the axis; with little of both, the line through both; with less, there is none.
#[test]
fn the_axis_follows_what_is_seen_of_the_shafts() {
    let whole = Scan::of(RIGHT.volume.clone());
    let slice = |height: f64| ((140.0 + height) / SPACING_MM) as usize;
    let lean = |landmarks: &Landmarks| {
        Vector3::from(landmarks.axis_direction)
            .angle(&Vector3::z())
            .to_degrees()
    };
    let notes = |landmarks: &Landmarks, axis: KneeAxis| {
        landmarks.notes.contains(&LandmarkNote::KneeAxis(axis))
    };
    let thigh = whole.slices(slice(-40.0)..slice(140.0));
    let thigh = thigh.find(Side::Right, &automatic()).unwrap();
    // The phantom's femur is inclined by 3 degrees.
    assert!(
        lean(&thigh) < 4.0 && notes(&thigh, KneeAxis::Femur),
        "{thigh:?}"
    );
    assert!((Point3::from(thigh.joint_centre) - RIGHT.plateau).norm() < 2.0);
    let middle = whole.slices(slice(-70.0)..slice(80.0));
    let middle = middle.find(Side::Right, &automatic()).unwrap();
    assert!(
        lean(&middle) < 3.0 && notes(&middle, KneeAxis::Both),
        "{middle:?}"
    );
    let little = whole.slices(slice(-45.0)..slice(90.0));
    let error = little.find(Side::Right, &automatic()).unwrap_err();
    assert!(matches!(error, LandmarkError::ShortKnee { .. }), "{error}");
    let given = LandmarkOverrides {
        joint_region: Some([-45.0, -30.0]),
        calf_region: Some([60.0, 90.0]),
        ..automatic()
    };
    let given = little.find(Side::Right, &given).unwrap();
    assert!(lean(&given) < 4.0, "{given:?}");
    let overlapping = LandmarkOverrides {
        joint_region: Some([-90.0, -30.0]),
        calf_region: Some([-100.0, -60.0]),
        ..automatic()
    };
    let error = whole.find(Side::Right, &overlapping).unwrap_err();
    assert!(
        error.to_string().contains("overlaps the joint region"),
        "{error}"
    );
}

/// A face of the scan that cuts the medial condyle moves the joint little, and is reported.
#[test]
fn a_cut_plateau_is_reported() {
    let [ni, nj, nk] = RIGHT.volume.grid().size();
    let medial_end = RIGHT.joint.x + 30.0;
    let columns = (medial_end - RIGHT.volume.grid().origin_mm().x) / SPACING_MM;
    assert!((columns as usize) < ni);
    let cut = RIGHT
        .volume
        .crop([0; 3], [columns as usize, nj, nk])
        .unwrap();
    let landmarks = Scan::of(cut).find(Side::Right, &automatic()).unwrap();
    let lines = landmarks.joints[0].lines.as_ref().unwrap();
    assert!(lines.plateau_is_cut);
    assert!(landmarks.notes.contains(&LandmarkNote::PlateauCut));
    let off = Point3::from(landmarks.joint_centre) - RIGHT.plateau;
    assert!(off.norm() < 4.0, "{off:?}");
}
