//! Body shapes: moved skins, bumps, and what they displace.

use nalgebra::Point3;
use ppa_mesh::{
    Border, Bump, BumpSite, Displacement, Mesh, ShapeError, add_bumps, iso_surface, offset,
    seeded_bumps,
};

use crate::fields::volume;
use crate::limb::PHANTOM;

#[test]
fn body_shapes_move_the_skin_by_what_was_asked() {
    let (leg, _, limb) = &*PHANTOM;
    let mean = |mesh: &Mesh| {
        let sum: f64 = mesh
            .vertices
            .iter()
            .map(|v| leg.skin_distance_mm(&v.cast()))
            .sum();
        sum / mesh.vertices.len() as f64
    };
    for distance in [4.0, -3.0] {
        let moved = mean(&offset(&limb.mesh, distance).unwrap()) - mean(&limb.mesh);
        assert!(
            (moved - distance).abs() < 0.1 * distance.abs(),
            "{moved} for {distance}"
        );
    }

    let joint = leg.truth().joint_centre;
    let sites = [BumpSite {
        centre: joint,
        radius_mm: 60.0,
    }];
    let bumps = seeded_bumps(&limb.mesh, &sites, 3, 11).unwrap();
    assert_eq!(bumps, seeded_bumps(&limb.mesh, &sites, 3, 11).unwrap());
    let bump = bumps[0];
    let swollen = add_bumps(&limb.mesh, &[bump]).unwrap();
    for (before, after) in limb.mesh.vertices.iter().zip(&swollen.vertices) {
        let away = (before.cast::<f64>() - bump.centre).norm();
        let lift = f64::from((after - before).norm());
        // Never more than the Gaussian of the straight distance: paths on the skin are longer.
        let most = bump.height_mm * (-0.5 * (away / bump.sigma_mm).powi(2)).exp();
        assert!(lift <= most + 1e-3, "{lift} > {most}");
        if away < 0.1 {
            assert!((lift - bump.height_mm).abs() < 0.01 * bump.height_mm);
        }
    }
    assert!(
        swollen
            .normals
            .iter()
            .all(|n| (n.norm() - 1.0).abs() < 1e-4)
    );
}

#[test]
fn a_thinner_limb_does_not_turn_inside_out() {
    let mesh = &PHANTOM.2.mesh;
    let thin = offset(mesh, -4.0).unwrap();
    let (mut flipped, mut total) = (0.0, 0.0);
    for triangle in &mesh.triangles {
        let area = |mesh: &Mesh| {
            let [a, b, c] = triangle.map(|v| mesh.vertices[v as usize].cast::<f64>());
            (b - a).cross(&(c - a))
        };
        let before = area(mesh);
        total += before.norm();
        if before.dot(&area(&thin)) <= 0.0 {
            flipped += before.norm();
        }
    }
    assert!(flipped < 1e-3 * total, "{flipped} of {total}");
    let exact = std::iter::zip(&mesh.vertices, &thin.vertices)
        .filter(|(before, after)| ((*after - *before).norm() - 4.0).abs() < 1e-3);
    assert!(exact.count() as f64 > 0.99 * mesh.vertices.len() as f64);
}

/// A rod of 3 mm radius with round ends cannot lose 4 mm; one of 8 mm can.
#[test]
fn the_inward_shift_ends_short_of_the_radius_of_curvature() {
    let rod = |radius_mm: f64| {
        let field = volume([40; 3], [1.0; 3], |p| {
            let on_axis = nalgebra::Point3::new(19.6, 19.3, p.z.clamp(12.2, 27.1));
            (-500.0 - 100.0 * ((p - on_axis).norm() - radius_mm)) as f32
        });
        ppa_mesh::iso_surface(&field, -500.0, ppa_mesh::Border::Open).expect("rod")
    };
    let largest = |mesh: &Mesh| {
        let moved = offset(mesh, -4.0).unwrap();
        let shifts = std::iter::zip(&mesh.vertices, &moved.vertices);
        let most = shifts.map(|(a, b)| (b - a).norm()).fold(0.0, f32::max);
        (most, moved.volume_mm3())
    };
    let (most, left_mm3) = largest(&rod(3.0));
    assert!(
        most < 3.0 && left_mm3 > 0.0,
        "{most} mm, {left_mm3} mm³ left"
    );
    let (most, left_mm3) = largest(&rod(8.0));
    let exact_mm3 = std::f64::consts::PI * (16.0 * 14.9 + 4.0 / 3.0 * 64.0);
    // Vertices moved sideways a little are farther from their origin.
    assert!((4.0..4.1).contains(&most), "{most} mm");
    assert!(
        (left_mm3 / exact_mm3 - 1.0).abs() < 0.04,
        "{left_mm3} of {exact_mm3} mm³"
    );
}

#[test]
fn sites_without_skin_are_passed_over() {
    let (leg, _, limb) = &*PHANTOM;
    let site = |centre| BumpSite {
        centre,
        radius_mm: 60.0,
    };
    let skin = site(leg.truth().joint_centre);
    let air = site(leg.truth().joint_centre + nalgebra::Vector3::x() * 1e4);
    let bumps = |sites: &[BumpSite]| seeded_bumps(&limb.mesh, sites, 3, 11);
    assert_eq!(bumps(&[air, skin, air]), bumps(&[skin]));
    assert_eq!(bumps(&[air, air]), Err(ShapeError::NoSkin { sites: 2 }));
    assert_eq!(bumps(&[]), Err(ShapeError::NoSite { count: 3 }));
}

/// Two fingers 4 mm apart on one palm, and the palm's flat far side.
fn fingers() -> Mesh {
    let field = volume([64, 40, 50], [0.7, 0.7, 0.7], |p| {
        let finger = |x: f64| {
            let on_axis = Point3::new(x, 14.0, p.z.clamp(10.0, 26.0));
            (p - on_axis).norm() - 5.0
        };
        let middle = Point3::new(p.x.clamp(15.0, 29.0), 14.0, 26.0);
        let palm = (p - middle).norm() - 6.0;
        let nearest = finger(15.3).min(finger(29.1)).min(palm);
        (-500.0 - 100.0 * nearest) as f32
    });
    iso_surface(&field, -500.0, Border::Open).expect("hand")
}

#[test]
fn fingers_that_grow_do_not_pass_through_each_other() {
    let hand = fingers();
    assert_eq!(hand.topology().components, 1);
    assert!(hand.self_crossings().is_empty());
    for distance in [4.0_f64, -2.0] {
        let moved = offset(&hand, distance).unwrap();
        let pairs = moved.self_crossings();
        assert!(
            pairs.is_empty(),
            "{distance} mm: {} pairs cross",
            pairs.len()
        );
        let shifts = Displacement::between(&hand, &moved).shifts_mm;
        let whole = shifts
            .iter()
            .filter(|s| (*s - distance.abs()).abs() < 1e-3)
            .count();
        let [least, _, most] = Displacement::between(&hand, &moved).least_mean_most_mm();
        let limited = least < 0.8 * distance.abs();
        assert!(limited == (distance > 0.0), "{least} mm");
        assert!(most < 1.05 * distance.abs(), "{most} mm");
        assert!(
            4 * whole > shifts.len(),
            "{distance} mm: {whole} of {}",
            shifts.len()
        );
    }
    // Where nothing limits it, the new skin is at the requested distance from the old one.
    let moved = offset(&hand, 4.0).unwrap();
    let shifts = Displacement::between(&hand, &moved).shifts_mm;
    let whole = moved.vertices.iter().zip(shifts);
    for (new, _) in whole.filter(|(_, shift)| (shift - 4.0).abs() < 1e-3) {
        let squared = hand.vertices.iter().map(|v| (v - new).norm_squared());
        let nearest = squared.fold(f32::INFINITY, f32::min).sqrt();
        assert!((3.8..4.1).contains(&nearest), "{nearest} mm");
    }
}

#[test]
fn no_variant_of_the_phantom_passes_through_itself() {
    let skin = &PHANTOM.2.mesh;
    for distance in [6.0, -6.0] {
        let moved = offset(skin, distance).unwrap();
        let pairs = moved.self_crossings();
        assert!(
            pairs.is_empty(),
            "{distance} mm: {} pairs cross",
            pairs.len()
        );
    }
}

#[test]
fn the_volume_of_a_displacement_is_that_of_the_meshes() {
    let hand = fingers();
    for distance in [2.0, -1.0] {
        let moved = offset(&hand, distance).unwrap();
        let change = Displacement::between(&hand, &moved).volume_mm3;
        let closed = moved.volume_mm3() - hand.volume_mm3();
        assert!(
            (change - closed).abs() < 1e-3 * closed.abs(),
            "{change}, {closed} mm³"
        );
        assert_eq!(change > 0.0, distance > 0.0);
    }
    // An open skin has a volume only with a lid, but its change needs none.
    let (leg, scan, limb) = &*PHANTOM;
    let change = Displacement::between(&limb.mesh, &offset(&limb.mesh, 3.0).unwrap()).volume_mm3;
    let grid = scan.grid();
    let between = (0..grid.len()).filter(|&at| {
        let p = grid.centre(grid.voxel(at).map(|v| v as f64));
        (0.0..3.0).contains(&leg.skin_distance_mm(&p))
    });
    let counted = between.count() as f64 * super::limb::VOXEL_MM.powi(3);
    assert!(
        (change / counted - 1.0).abs() < 0.05,
        "{change}, {counted} mm³"
    );
}

#[test]
fn bumps_that_are_none_are_refused() {
    let skin = &PHANTOM.2.mesh;
    let good = Bump {
        centre: PHANTOM.0.truth().joint_centre,
        height_mm: -5.0,
        sigma_mm: 8.0,
    };
    let dented = add_bumps(skin, &[good]).unwrap();
    assert!(Displacement::between(skin, &dented).volume_mm3 < -500.0);
    let sigma = |sigma_mm| Bump { sigma_mm, ..good };
    let height = |height_mm| Bump { height_mm, ..good };
    for bad in [
        sigma(0.0),
        sigma(-8.0),
        sigma(f64::NAN),
        height(f64::INFINITY),
        height(1e4),
    ] {
        let found = add_bumps(skin, &[good, bad]);
        assert!(
            matches!(found, Err(ShapeError::Size { index: 1, .. })),
            "{bad:?}"
        );
    }
    let site = BumpSite {
        centre: good.centre,
        radius_mm: 60.0,
    };
    let many = seeded_bumps(skin, &[site], 1001, 0);
    assert_eq!(many, Err(ShapeError::TooMany { count: 1001 }));
    for shift in [f64::NAN, f64::INFINITY, 201.0] {
        let found = offset(skin, shift);
        assert!(
            matches!(found, Err(ShapeError::Shift { .. })),
            "{shift}: {found:?}"
        );
    }
}
