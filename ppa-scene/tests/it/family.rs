//! Landmarks of the seventeen phantoms in any orientation in the scan.

use nalgebra::{Point3, Rotation3, Vector3};
use ppa_ct::Volume;
use ppa_mesh::{Border, iso_surface};
use ppa_phantom::{LowerLeg, TableTop, Truth};
use ppa_scene::{Joint, LandmarkOverrides, LimbKind, Side};
use rayon::prelude::*;

use crate::scan::Scan;

const SPACING_MM: f64 = 1.5;

/// A phantom and points of its exact skin.
struct Subject {
    name: String,
    side: Side,
    truth: Truth,
    /// Middle of the joint space on the axis: the groove of the trochlea is below the cone that
    /// [`Truth::joint_centre`] belongs to.
    joint: Point3<f64>,
    volume: Volume,
    skin: Vec<Point3<f64>>,
}

impl Subject {
    /// Odd numbers are left legs.
    fn numbered(number: u32) -> Self {
        let side = match number % 2 {
            0 => Side::Right,
            _ => Side::Left,
        };
        let name = format!("P{number:02}");
        let leg = LowerLeg::family(&name, side).unwrap();
        let volume = leg.voxelise(SPACING_MM, TableTop::Absent).unwrap();
        let truth = leg.truth();
        let axis = truth.axis_direction.into_inner();
        let bone_along = |towards: f64| {
            let steps = (0..1000).map(|step| towards * 0.01 * f64::from(step));
            let mut places = steps.map(|mm| truth.joint_centre + axis * mm);
            places.find(|p| leg.bone(p).is_some()).unwrap()
        };
        let below = match leg.bone(&truth.joint_centre) {
            Some(bone) => panic!("{name}: {bone} at the joint"),
            None => bone_along(-1.0),
        };
        let near = iso_surface(&volume, -500.0, Border::Open).unwrap();
        // Every third one: a plane that touches the skin between two of them lies 0.03 mm deeper. Newton's steps along the normal,
        // from within 0.2 mm, end on the surface.
        let skin = near.vertices.iter().step_by(3).map(|vertex| {
            (0..2).fold(vertex.cast::<f64>(), |p, _| {
                p - leg.skin_normal(&p).into_inner() * leg.skin_distance_mm(&p)
            })
        });
        Self {
            name,
            side,
            skin: skin.collect(),
            joint: nalgebra::center(&below, &bone_along(1.0)),
            truth,
            volume,
        }
    }

    /// The leg rotated in the world while the scanner's slices stay level.
    fn turned(&self, turn: &Rotation3<f64>) -> Scan {
        Scan::under_the_scanner(&self.volume, self.skin.iter(), turn)
    }

    /// Normal of the plane that touches the exact skin from behind, and how far the joint lies above.
    fn plane(&self, turn: &Rotation3<f64>) -> (Vector3<f64>, f64) {
        let z = turn * self.truth.axis_direction.into_inner();
        let y = (z * z.y - Vector3::y()).normalize();
        let joint = turn * self.truth.joint_centre;
        let mut points: Vec<[f64; 2]> = self
            .skin
            .iter()
            .map(|p| turn * p - joint)
            .map(|v| [v.dot(&z), v.dot(&y)])
            .collect();
        points.sort_by(|a, b| a.partial_cmp(b).unwrap());
        let mut hull: Vec<[f64; 2]> = Vec::new();
        for p in points {
            while let [.., a, b] = hull[..] {
                if (b[0] - a[0]) * (p[1] - a[1]) > (b[1] - a[1]) * (p[0] - a[0]) {
                    break;
                }
                hull.pop();
            }
            hull.push(p);
        }
        let back = hull.iter().position(|p| p[0] >= 0.0).unwrap();
        let (a, b) = (hull[back - 1], hull[back]);
        let tilt = f64::atan2(b[1] - a[1], b[0] - a[0]);
        let normal = y * tilt.cos() - z * tilt.sin();
        let height = -(a[1] * tilt.cos() - a[0] * tilt.sin());
        (normal, height)
    }
}

fn degrees_between(a: &Vector3<f64>, b: &Vector3<f64>) -> f64 {
    a.cross(b).norm().atan2(a.dot(b)).to_degrees()
}

/// Axis within 1 degree, joint within 1 mm, and Π_P within 1 degree and 1 mm of the exact skin's.
fn check(subject: &Subject, turn: &Rotation3<f64>) {
    let scan = subject.turned(turn);
    let name = format!(
        "{} {:?} {:?}",
        subject.name,
        subject.side,
        turn.scaled_axis()
    );
    let found = scan.find(subject.side, &LandmarkOverrides::default());
    let landmarks = found.unwrap_or_else(|error| panic!("{name}: {error}"));
    assert_eq!(landmarks.limb, LimbKind::LowerLeg, "{name}");
    let joints: Vec<Joint> = landmarks.joints.iter().map(|found| found.joint).collect();
    assert_eq!(joints, [Joint::Ankle], "{name}");
    let axis = turn * subject.truth.axis_direction.into_inner();
    let joint = turn * subject.joint;
    let axis_deg = degrees_between(&landmarks.axis_direction.into(), &axis);
    let off = Point3::from(landmarks.joint_centre) - joint;
    let (normal, height_mm) = subject.plane(turn);
    let ct_from_patient = landmarks.patient_from_ct().inverse();
    let plane = landmarks
        .plane_patient()
        .transformed(ct_from_patient.isometry());
    let plane_deg = degrees_between(&plane.normal, &normal);
    let above = turn * subject.truth.joint_centre;
    let plane_mm = plane.signed_distance(&above) - height_mm;
    println!(
        "{name}: axis {axis_deg:.2} degrees, joint {:.2} mm along and {:.2} mm beside the axis, \
         plane {plane_deg:.2} degrees, {plane_mm:.2} mm",
        off.dot(&axis),
        off.cross(&axis).norm()
    );
    assert!(axis_deg < 1.0, "{name}: axis {axis_deg:.2} degrees off");
    assert!(off.norm() < 1.0, "{name}: joint off by {off:?}");
    assert!(
        plane_deg < 1.0 && plane_mm.abs() < 1.0,
        "{name}: {plane_deg:.2} degrees, {plane_mm:.2} mm"
    );
}

fn twenty_degrees(axis: usize, sign: f64) -> Rotation3<f64> {
    Rotation3::from_scaled_axis(Vector3::ith(axis, sign * 20_f64.to_radians()))
}

/// A left leg with its toes down by 12 degrees, inclined backwards and lying across the table.
#[test]
fn a_leaning_leg_is_measured_across_its_shaft() {
    let subject = Subject::numbered(13);
    assert!(subject.truth.plantarflexion_rad.to_degrees() > 10.0);
    check(&subject, &twenty_degrees(0, 1.0));
    check(&subject, &twenty_degrees(1, -1.0));
}

/// Feet from 2 degrees up to 12 degrees down, as they lie and rotated about one of the axes: left and right legs either way about each.
#[test]
#[ignore = "a minute"]
fn seventeen_legs_turned_about_an_axis_each() {
    (1..=17).into_par_iter().for_each(|number| {
        let subject = Subject::numbered(number);
        check(&subject, &Rotation3::identity());
        let sign = if number / 6 % 2 == 0 { 1.0 } else { -1.0 };
        check(&subject, &twenty_degrees(number as usize % 3, sign));
    });
}
