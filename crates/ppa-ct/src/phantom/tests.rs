//! The phantom measured back: from its shapes and from its voxels.

use std::collections::BTreeMap;
use std::sync::LazyLock;

use nalgebra::{Point3, Rotation3, Unit, Vector3};
use proptest::prelude::*;

use super::sdf::Shape;
use super::*;
use crate::volume::Volume;

const VOXEL_MM: f64 = 1.0;

static LIMB: LazyLock<LowerLeg> = LazyLock::new(LowerLeg::p01);
static CT: LazyLock<Volume> = LazyLock::new(|| LIMB.voxelise(VOXEL_MM, TableTop::Absent).unwrap());

/// A point of the mortise frame (medial, posterior, proximal of the joint centre) in `ct`.
fn mortise_point(medial: f64, posterior: f64, proximal: f64) -> Point3<f64> {
    LIMB.ct_from_limb * Point3::from(LIMB.mortise.point(medial, posterior, proximal))
}

fn skin_slope(p: &Point3<f64>) -> Vector3<f64> {
    let step_mm = 0.02;
    Vector3::from_fn(|axis, _| {
        let step = Vector3::ith(axis, step_mm);
        (LIMB.skin_distance_mm(&(p + step)) - LIMB.skin_distance_mm(&(p - step))) / (2.0 * step_mm)
    })
}

/// Lattice over the limb, `step_mm` apart, off the symmetry planes.
fn lattice(step_mm: f64) -> impl Iterator<Item = Point3<f64>> {
    let (low, high) = LIMB.skin_box();
    let count = ((high - low) / step_mm).map(|n| n as usize);
    (0..count.x * count.y * count.z).map(move |n| {
        let place = Vector3::new(n % count.x, n / count.x % count.y, n / (count.x * count.y));
        low + place.map(|i| i as f64 + 0.37) * step_mm
    })
}

/// Length of the line through `start` until the volume rises above `hu` on either side.
fn gap_mm(start: Point3<f64>, along: Unit<Vector3<f64>>, hu: f64) -> f64 {
    let reach = |sign: f64| {
        (0..200)
            .map(|n| sign * 0.05 * f64::from(n))
            .find(|t| CT.sample(&(start + along.scale(*t))).unwrap() > hu)
            .expect("bone within 10 mm")
    };
    reach(1.0) - reach(-1.0)
}

/// Point on the talar side of a facet, and the direction across its gutter.
fn facet_point(facet: &Shape, from: Point3<f64>) -> (Point3<f64>, Unit<Vector3<f64>>) {
    let Shape::HalfSpace { normal, offset } = facet else {
        panic!("a facet is a half-space")
    };
    let from = LIMB.limb_point(&from);
    let on_facet = from + normal.scale(offset - normal.dot(&from.coords));
    (LIMB.ct_from_limb * on_facet, LIMB.ct_from_limb * *normal)
}

#[test]
fn skin_distance_has_slope_one_near_the_skin() {
    let (mut near, mut off) = (0, 0);
    for p in lattice(3.1) {
        if LIMB.skin_distance_mm(&p).abs() < 4.0 {
            near += 1;
            off += usize::from((skin_slope(&p).norm() - 1.0).abs() > 0.2);
        }
    }
    assert!(near > 20_000, "{near} points near the skin");
    // Only in the creases between toes, where the nearest skin is on both sides.
    assert!(off * 25 < near, "{off} of {near} points");
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(300))]
    /// Walking the distance back along the slope ends on the skin, up to the 20 % by which the slope may be
    /// off, from random points around the shank.
    #[test]
    fn skin_distance_leads_to_the_skin(
        angle in 0.0..std::f64::consts::TAU, height in -5.0..240.0_f64, start in -3.0..3.0_f64,
    ) {
        let truth = LIMB.truth();
        let axis = truth.joint_centre + truth.axis_direction.scale(height) + Vector3::new(0.0, 15.0, 0.0);
        let outwards = Vector3::new(angle.cos(), angle.sin(), 0.0);
        let (mut inside, mut outside) = (0.0, 120.0);
        for _ in 0..40 {
            let middle = 0.5 * (inside + outside);
            if LIMB.skin_distance_mm(&(axis + outwards * middle)) < 0.0 { inside = middle } else { outside = middle }
        }
        let p = axis + outwards * (inside + start);
        let (distance, slope) = (LIMB.skin_distance_mm(&p), skin_slope(&p));
        let foot = p - slope.normalize() * distance;
        prop_assert!(LIMB.skin_distance_mm(&foot).abs() < 0.05 + 0.25 * distance.abs(), "{distance} mm from {p}");
    }
}

#[test]
fn bones_keep_half_a_millimetre_and_lie_below_the_skin() {
    let mut volume_ml: BTreeMap<&str, f64> = BTreeMap::new();
    let (bones, step_mm) = (LIMB.skeleton.bones(), 1.7);
    for p in lattice(step_mm) {
        let p = LIMB.limb_point(&p);
        let near: Vec<(usize, f64)> = (0..bones.len())
            .filter(|&b| LIMB.skeleton.box_distance(b, &p) < 0.5)
            .map(|b| (b, LIMB.skeleton.distance(b, &p)))
            .filter(|&(_, distance)| distance < 0.5)
            .collect();
        for &(bone, distance) in near.iter().filter(|(_, distance)| *distance < 0.0) {
            *volume_ml.entry(bones[bone].name).or_default() += step_mm.powi(3) / 1000.0;
            assert_eq!(
                near.len(),
                1,
                "{} meets another bone at {p}",
                bones[bone].name
            );
            let cover = -LIMB.envelope.skin_distance(&p);
            assert!(
                cover > 2.0,
                "{} {distance} at {p} has {cover} mm of cover",
                bones[bone].name
            );
        }
    }
    assert_eq!(volume_ml.len(), 28, "{volume_ml:?}");
    // Adult men; the leg bones as far as the scan shows them.
    for (name, low, high) in [
        ("talus", 30.0, 48.0),
        ("calcaneus", 48.0, 85.0),
        ("navicular", 8.0, 16.0),
        ("cuboid", 10.0, 20.0),
        ("tibia", 130.0, 220.0),
        ("fibula", 25.0, 50.0),
    ] {
        let ml = volume_ml[name];
        assert!((low..high).contains(&ml), "{name} of {ml} ml");
    }
}

#[test]
fn gutters_measured_in_the_voxels_are_those_of_the_truth() {
    let (truth, p) = (LIMB.truth(), &LIMB.parameters);
    let half_way = 650.0; // between cartilage and a thin shell blurred by a voxel
    for (medial, posterior) in [(-8.0, 0.0), (0.0, -6.0), (0.0, 6.0), (8.0, 0.0)] {
        let axis_point = LIMB.mortise.axis_z;
        let from = mortise_point(0.0, 0.0, axis_point);
        let towards = mortise_point(medial, posterior, 0.0) - from;
        let along = Unit::new_normalize(
            towards
                - truth
                    .talocrural_axis
                    .scale(towards.dot(&truth.talocrural_axis)),
        );
        let start = from
            + truth.talocrural_axis.scale(medial)
            + along.scale(
                p.trochlea_radius_mm - medial * p.axis_inclination_rad.tan()
                    + 0.3 * p.superior_gutter_mm,
            );
        let gap = gap_mm(start, along, half_way);
        assert!(
            (gap - truth.superior_gutter_mm).abs() < VOXEL_MM,
            "superior {gap}"
        );
    }
    for (facet, medial, width) in [
        (LIMB.mortise.medial_facet(p), 16.0, truth.medial_gutter_mm),
        (
            LIMB.mortise.lateral_facet(p),
            -16.0,
            truth.lateral_gutter_mm,
        ),
    ] {
        for (posterior, proximal) in [(-4.0, -9.0), (0.0, -8.0), (4.0, -9.0)] {
            let (on_facet, across) =
                facet_point(&facet, mortise_point(medial, posterior, proximal));
            let gap = gap_mm(on_facet + across.scale(0.5 * width), across, half_way);
            assert!(
                (gap - width).abs() < VOXEL_MM,
                "{gap} mm at {medial}, {posterior}, {proximal}"
            );
        }
    }
}

/// Bone on a ray through each of the points, in mm of bone of 1000 HU, for a beam from front to back with the
/// limb turned inwards.
fn bone_on_ray(points: &[Point3<f64>], internal_rotation_deg: f64) -> f64 {
    let turn = Rotation3::from_axis_angle(&Vector3::z_axis(), -internal_rotation_deg.to_radians());
    let along = LIMB.ct_from_limb * (turn * Vector3::y());
    let step_mm = 0.5;
    let ray = |p: &Point3<f64>| -> f64 {
        (-90..=90)
            .map(|n| CT.sample(&(p + along * (step_mm * f64::from(n)))).unwrap())
            .map(|hu| step_mm * (hu - 60.0).max(0.0) / 1000.0)
            .sum()
    };
    points.iter().map(ray).sum::<f64>() / points.len() as f64
}

#[test]
fn gutters_open_at_the_mortise_angle_and_close_at_0_and_45_degrees() {
    let (truth, p) = (LIMB.truth(), &LIMB.parameters);
    let mut both = vec![0.0; 61];
    for (facet, medial, width, angle_rad) in [
        (
            LIMB.mortise.medial_facet(p),
            16.0,
            truth.medial_gutter_mm,
            truth.medial_gutter_angle_rad,
        ),
        (
            LIMB.mortise.lateral_facet(p),
            -16.0,
            truth.lateral_gutter_mm,
            truth.lateral_gutter_angle_rad,
        ),
    ] {
        let middle: Vec<Point3<f64>> = (0..6)
            .map(|n| {
                let from = mortise_point(medial, 0.0, -6.0 - f64::from(n));
                let (on_facet, across) = facet_point(&facet, from);
                on_facet + across.scale(0.5 * width)
            })
            .collect();
        let bone: Vec<f64> = (-10..=50)
            .map(|a| bone_on_ray(&middle, f64::from(a)))
            .collect();
        let least = |bone: &[f64]| {
            (0..bone.len()).fold(0, |best, n| if bone[n] < bone[best] { n } else { best })
        };
        let open = least(&bone) as f64 - 10.0;
        assert!(
            (open - angle_rad.to_degrees()).abs() <= 3.0,
            "opens at {open}: {bone:?}"
        );
        for closed in [0, 45] {
            assert!(
                bone[closed + 10] > 5.0 + bone[least(&bone)],
                "at {closed}: {bone:?}"
            );
        }
        for (worst, bone) in both.iter_mut().zip(&bone) {
            *worst = f64::max(*worst, *bone);
        }
    }
    let best = (0..both.len()).fold(0, |best, n| if both[n] < both[best] { n } else { best });
    let best_deg = best as f64 - 10.0;
    assert!(
        (best_deg - truth.mortise_angle_rad.to_degrees()).abs() <= 3.0,
        "{best_deg}: {both:?}"
    );
}

/// Shadow of a bone across the beam, 10 mm above the joint: most lateral and most medial point.
fn shadow(bone: &str, internal_rotation_deg: f64) -> [f64; 2] {
    let turn = Rotation3::from_axis_angle(&Vector3::z_axis(), -internal_rotation_deg.to_radians());
    let mut edges = [f64::INFINITY, f64::NEG_INFINITY];
    for n in 0..400 * 160 {
        let [u, v] = [
            0.2 * f64::from(n % 400) - 40.0,
            0.5 * f64::from(n / 400) - 40.0,
        ];
        let p = LIMB.ct_from_limb * (turn * Point3::new(u, v, 10.0));
        if LIMB.bone(&p) == Some(bone) {
            edges = [edges[0].min(u), edges[1].max(u)];
        }
    }
    edges
}

#[test]
fn tibiofibular_overlap_falls_with_internal_rotation_as_published() {
    let overlap = |angle| shadow("fibula", angle)[1] - shadow("tibia", angle)[0];
    let (front, turned) = (overlap(0.0), overlap(15.0));
    // Patil 2012, mean ± 2 SD: 11.2 ± 4.4 mm and 4.2 ± 1.7 mm.
    assert!((2.4..20.0).contains(&front), "{front} mm from the front");
    assert!((0.8..7.6).contains(&turned), "{turned} mm at 15 degrees");
    assert!(turned < front - 2.0, "{front} mm to {turned} mm");
}

#[test]
fn lengths_and_girths_measured_in_the_voxels() {
    let truth = LIMB.truth();
    let grid = CT.grid();
    let (mut toe, mut heel) = (f64::INFINITY, f64::NEG_INFINITY);
    let mut slice_mm2: BTreeMap<usize, f64> = BTreeMap::new();
    for (index, hu) in CT.hu().iter().enumerate() {
        if *hu > -500.0 {
            let voxel = grid.voxel(index);
            let p = grid.centre(voxel.map(|v| v as f64));
            toe = toe.min(p.y);
            if p.z < truth.joint_centre.z {
                heel = heel.max(p.y);
            }
            *slice_mm2.entry(voxel[2]).or_default() += VOXEL_MM * VOXEL_MM;
        }
    }
    let foot_mm = heel - toe;
    assert!(
        (foot_mm - truth.foot_length_mm).abs() < VOXEL_MM,
        "foot of {foot_mm} mm"
    );
    assert!((239.0..291.0).contains(&foot_mm)); // adult men, mean ± 2 SD
    assert!(
        (heel - truth.back_plane_y_mm).abs() < VOXEL_MM,
        "heel at {heel}"
    );
    // Girth of the circle with the same area, a lower bound of the girth.
    let girth = |height_mm: f64| {
        let z = truth.joint_centre.z + height_mm;
        let slice = ((z - grid.origin_mm().z) / VOXEL_MM).round() as usize;
        (4.0 * std::f64::consts::PI * slice_mm2[&slice]).sqrt()
    };
    let (ankle, calf) = (girth(75.0), girth(240.0));
    assert!((200.0..265.0).contains(&ankle), "ankle girth {ankle}");
    assert!((320.0..420.0).contains(&calf), "calf girth {calf}");

    // The malleoli end where they should: the last bone on lines along the shaft below them.
    for (medial, posterior, reach) in [
        (22.0, -4.5, truth.medial_malleolus_mm),
        (-26.0, 4.5, truth.lateral_malleolus_mm),
    ] {
        let last = (0..500)
            .map(|n| -40.0 + 0.05 * f64::from(n))
            .find(|z| CT.sample(&mortise_point(medial, posterior, *z)).unwrap() > 550.0)
            .unwrap();
        assert!(
            (last + reach).abs() < VOXEL_MM,
            "malleolus ends at {last}, expected {reach} below"
        );
    }
}

#[test]
fn heel_and_calf_touch_the_table_and_the_ankle_does_not() {
    let truth = LIMB.truth();
    let table = |x: f64, z: f64| {
        let height = truth.joint_centre.coords + Vector3::new(x, 0.0, z);
        LIMB.skin_distance_mm(&Point3::new(height.x, truth.back_plane_y_mm, height.z))
    };
    assert!(
        (0.0..0.2).contains(&table(-3.0, -50.0)),
        "heel {}",
        table(-3.0, -50.0)
    );
    assert!(
        (0.0..0.2).contains(&table(-6.0, 200.0)),
        "calf {}",
        table(-6.0, 200.0)
    );
    assert!(table(-3.0, 30.0) > 5.0);
    for p in lattice(4.0).filter(|p| p.y > truth.back_plane_y_mm) {
        assert!(LIMB.skin_distance_mm(&p) > 0.0);
    }
}

#[test]
fn partial_volume_keeps_the_mass_at_any_spacing() {
    let mass = |ct: &Volume| {
        let share: f64 = ct.hu().iter().map(|hu| f64::from(*hu) + 1000.0).sum();
        share * ct.grid().spacing_mm().product()
    };
    let fine = mass(&CT);
    for spacing_mm in [2.0, 4.0] {
        let coarse = mass(&LIMB.voxelise(spacing_mm, TableTop::Absent).unwrap());
        // The proximal cut is a full slice: up to one slice of 9000 mm² out of 2.4 litres.
        let cut = spacing_mm * 9000.0 / 2.4e6;
        assert!(
            (coarse / fine - 1.0).abs() < 0.002 + cut,
            "{} at {spacing_mm}",
            coarse / fine
        );
    }
}

/// Against the tissue at 10³ points inside each voxel; bones left out, whose units vary inside.
#[test]
fn a_voxel_at_the_skin_is_the_mean_of_the_tissues_in_it() {
    let spacing_mm = 3.0;
    let ct = LIMB.voxelise(spacing_mm, TableTop::Absent).unwrap();
    let at_skin = (0..ct.hu().len())
        .map(|index| {
            (
                index,
                ct.grid().centre(ct.grid().voxel(index).map(|v| v as f64)),
            )
        })
        .filter(|(_, centre)| LIMB.skin_distance_mm(centre).abs() < 0.8 * spacing_mm);
    let (mut count, mut square) = (0.0, 0.0);
    for (index, centre) in at_skin.step_by(97) {
        let mut mean = 0.0;
        for n in 0..1000 {
            let place =
                Vector3::new(n % 10, n / 10 % 10, n / 100).map(|i| f64::from(i) / 10.0 - 0.45);
            mean += 0.001
                * match LIMB.tissue(&(centre + place * spacing_mm)) {
                    Tissue::Air => -1000.0,
                    Tissue::Skin => 60.0,
                    Tissue::Fat => -100.0,
                    Tissue::SoftTissue => 50.0,
                    Tissue::Tendon => 85.0,
                    _ => f64::NAN,
                };
        }
        if mean.is_finite() {
            count += 1.0;
            square += (f64::from(ct.hu()[index]) - mean).powi(2);
        }
    }
    let rms = f64::sqrt(square / count);
    assert!(count > 100.0, "{count} voxels");
    // A surface misplaced by 0.05 mm changes a voxel by 0.05 / 3 of 1000 HU.
    assert!(rms < 17.0, "{rms} HU over {count} voxels");
}

#[test]
fn voxels_are_the_same_for_any_number_of_threads() {
    let with_threads = |n| {
        let pool = rayon::ThreadPoolBuilder::new()
            .num_threads(n)
            .build()
            .unwrap();
        pool.install(|| LIMB.voxelise(4.0, TableTop::Present).unwrap())
    };
    assert_eq!(with_threads(1), with_threads(3));
}

#[test]
fn spacing_outside_the_range_is_refused() {
    for spacing_mm in [0.0, -1.0, f64::NAN, 0.1, 9.0] {
        let refusal = LIMB.voxelise(spacing_mm, TableTop::Absent).unwrap_err();
        assert!(
            refusal.to_string().contains("expected 0.25 to 8"),
            "{refusal}"
        );
    }
}
