//! Deformation of soft tissue under the phantom's heel and calf.

use nalgebra::{Point3, Vector3};
use ppa_mesh::{Border, Mesh, iso_surface};
use ppa_scene::{
    LandmarkOverrides, Landmarks, PlaceError, PlaceSettings, Placement, Plane, Side, SoftTissue,
    XrayDevice, place, place_with,
};

use crate::scan::P01;

const DEPTHS: SoftTissue = SoftTissue {
    distal_mm: 3.0,
    proximal_mm: 6.0,
};

fn table() -> Plane {
    Plane {
        normal: Vector3::z_axis(),
        offset_mm: 0.0,
    }
}

fn device() -> XrayDevice {
    XrayDevice::overhead(1040.0, 1100.0)
}

fn soft(skin: &Mesh, landmarks: &Landmarks, degrees: f64) -> Placement {
    let angle = degrees.to_radians();
    let settings = PlaceSettings {
        soft_tissue: DEPTHS,
        ..PlaceSettings::default()
    };
    place_with(
        &skin.vertices,
        landmarks,
        angle,
        &table(),
        &device(),
        &settings,
    )
    .unwrap()
}

/// Volume inside a closed surface, by the divergence theorem.
fn volume_mm3(vertices: &[Point3<f32>], triangles: &[[u32; 3]]) -> f64 {
    let corner = |v: u32| vertices[v as usize].cast::<f64>().coords;
    triangles
        .iter()
        .map(|[a, b, c]| corner(*a).dot(&corner(*b).cross(&corner(*c))) / 6.0)
        .sum()
}

/// Both parts sink by the requested depths, the skin ends on the table and not below it, a wider
/// patch of it touches, and the tissue keeps its volume.
#[test]
fn heel_and_calf_become_flat_and_keep_their_volume() {
    let landmarks = P01
        .find(Side::Right, &LandmarkOverrides::default())
        .unwrap();
    let skin = iso_surface(&P01.volume, -500.0, Border::Closed).unwrap();
    for degrees in [20.0_f64, 45.0, 75.0] {
        let placed = soft(&skin, &landmarks, degrees);
        let room_from_ct = placed.room_from_patient * landmarks.patient_from_ct();
        let sunk: Vec<Point3<f32>> = skin
            .vertices
            .iter()
            .map(|p| (room_from_ct * p.cast::<f64>()).cast())
            .collect();
        let lies = placed.in_room(&skin.vertices, &landmarks);
        let lowest = |points: &[Point3<f32>], proximal: bool| {
            let split = placed.contact.split_mm as f32;
            let half = points.iter().filter(|p| (p.y >= split) == proximal);
            half.map(|p| p.z).fold(f32::INFINITY, f32::min)
        };
        assert!(
            (lowest(&sunk, false) + 3.0).abs() < 0.11,
            "{:?}",
            placed.contact
        );
        assert!(
            (lowest(&sunk, true) + 6.0).abs() < 0.11,
            "{:?}",
            placed.contact
        );
        for proximal in [false, true] {
            assert!(lowest(&lies, proximal).abs() < 0.1, "{:?}", placed.contact);
        }
        let c = placed.contact;
        assert!(c.penetration_mm < 0.1 && c.gap_mm < 0.1, "{c:?}");

        let rigid = place(
            &skin.vertices,
            &landmarks,
            degrees.to_radians(),
            &table(),
            &device(),
        )
        .unwrap()
        .in_room(&skin.vertices, &landmarks);
        let touching = |points: &[Point3<f32>]| points.iter().filter(|p| p.z < 0.2).count();
        assert!(
            touching(&lies) > 2 * touching(&rigid),
            "{degrees} degrees: {} points touch, {} of a rigid skin",
            touching(&lies),
            touching(&rigid)
        );

        let (before, after) = (
            volume_mm3(&sunk, &skin.triangles),
            volume_mm3(&lies, &skin.triangles),
        );
        let pressed = {
            let cut: Vec<_> = sunk
                .iter()
                .map(|p| Point3::new(p.x, p.y, p.z.max(0.0)))
                .collect();
            before - volume_mm3(&cut, &skin.triangles)
        };
        println!(
            "{degrees} degrees: {} points touch, {} of a rigid skin; {before:.0} mm³, {pressed:.0} below the table, {:.1} lost",
            touching(&lies),
            touching(&rigid),
            before - after
        );
        assert!(
            (before - after).abs() < 0.02 * pressed,
            "{before} {after} {pressed}"
        );
    }
}

/// Of two points above each other the upper one stays above, and nothing moves above the pressed
/// layer (3⅓ times the depth thick).
#[test]
fn the_profile_rises_and_the_upper_side_stays() {
    let landmarks = P01
        .find(Side::Right, &LandmarkOverrides::default())
        .unwrap();
    let placed = soft(&P01.skin, &landmarks, 10.0);
    let flattening = placed.flattening.unwrap();
    for y in [-60.0, 0.0, 150.0, 260.0] {
        for x in [-30.0, 0.0, 25.0] {
            let heights = (-40..=400).map(|step| f64::from(step) / 20.0);
            let lies: Vec<f64> = heights
                .map(|z| flattening.flattened(&Point3::new(x, y, z)).z)
                .collect();
            let rises = lies.windows(2).all(|pair| pair[0] < pair[1]);
            assert!(rises, "at {x}, {y}: {lies:?}");
        }
        let high = Point3::new(20.0, y, 20.0);
        assert_eq!(flattening.flattened(&high), high);
    }
    let rigid = place(&P01.skin.vertices, &landmarks, 0.2, &table(), &device()).unwrap();
    assert_eq!(rigid.flattening, None);
}

#[test]
fn impossible_depths_are_refused() {
    let landmarks = P01
        .find(Side::Right, &LandmarkOverrides::default())
        .unwrap();
    for bad in [-1.0, 30.0, f64::NAN] {
        let soft_tissue = SoftTissue {
            proximal_mm: bad,
            ..SoftTissue::default()
        };
        let settings = PlaceSettings {
            soft_tissue,
            ..PlaceSettings::default()
        };
        let points = &P01.skin.vertices;
        let placed = place_with(points, &landmarks, 0.0, &table(), &device(), &settings);
        let error = placed.unwrap_err();
        assert!(
            matches!(
                error,
                PlaceError::SoftTissue {
                    name: "proximal_mm",
                    ..
                }
            ),
            "{error}"
        );
    }
}
