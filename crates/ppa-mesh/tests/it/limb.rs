//! The limb against the phantom's exact skin.

use std::sync::LazyLock;

use nalgebra::Point3;
use ppa_ct::Volume;
use ppa_ct::phantom::{LowerLeg, TableTop};
use ppa_mesh::{
    BumpError, BumpSite, Limb, LimbError, LimbSettings, Mesh, SurfaceError, VoxelBox, add_bumps,
    extract_limb, offset, seeded_bumps,
};

use crate::fields::volume;

const VOXEL_MM: f64 = 1.5;

static PHANTOM: LazyLock<(LowerLeg, Volume, Limb)> = LazyLock::new(|| {
    let leg = LowerLeg::p01();
    let scan = leg.voxelise(VOXEL_MM, TableTop::Present).expect("phantom");
    let limb = extract_limb(&scan, &LimbSettings::default()).expect("limb");
    (leg, scan, limb)
});

#[test]
fn table_goes_and_skin_stays() {
    let (leg, scan, limb) = &*PHANTOM;
    let errors = limb
        .mesh
        .vertices
        .iter()
        .map(|v| leg.skin_distance_mm(&v.cast()).abs());
    let beyond = errors.clone().filter(|e| *e > 0.5 * VOXEL_MM).count();
    assert!(
        beyond * 200 < limb.mesh.vertices.len(),
        "{beyond} vertices off by half a voxel"
    );
    let worst = errors.fold(0.0, f64::max);
    assert!(worst < VOXEL_MM, "{worst} mm");

    let topology = limb.mesh.topology();
    assert_eq!((topology.components, topology.non_manifold_edges), (1, 0));
    assert_eq!(
        topology.euler, 1,
        "one surface, open at the proximal cut only"
    );
    assert!(limb.report.couch_voxels > 0);
    let cut: Vec<&str> = limb
        .report
        .cut_faces
        .iter()
        .map(|cut| cut.face.as_str())
        .collect();
    assert_eq!(cut, ["+k"]);

    let grid = scan.grid();
    let wrong = (0..grid.len()).filter(|&at| {
        let depth = leg.skin_distance_mm(&grid.centre(grid.voxel(at).map(|v| v as f64)));
        limb.mask[at] != (depth < 0.0) && depth.abs() > VOXEL_MM
    });
    assert_eq!(
        wrong.count(),
        0,
        "voxels more than a voxel from the skin on the wrong side"
    );
}

/// A second limb, thinner and with a bone in it, pressed against the calf, and a wavy sheet across both.
#[test]
fn a_neighbour_and_a_sheet_leave_the_skin_where_it_was() {
    let (leg, scan, alone) = &*PHANTOM;
    let grid = scan.grid();
    let high = grid.centre([0.0, 0.0, grid.size()[2] as f64 - 1.0]).z;
    let calf: Vec<_> = alone
        .mesh
        .vertices
        .iter()
        .map(|v| v.cast::<f64>())
        .collect();
    let beside = calf
        .iter()
        .filter(|v| v.z > high - 60.0)
        .max_by(|a, b| a.x.total_cmp(&b.x))
        .expect("calf");
    let front = calf.iter().map(|v| v.y).fold(f64::INFINITY, f64::min);
    let (radius_mm, pressed_mm) = (18.0, 1.0);
    let axis = Point3::new(beside.x + radius_mm - pressed_mm, beside.y, 0.0);
    let hu = |at: usize| {
        let p = grid.centre(grid.voxel(at).map(|v| v as f64));
        let off_axis = (p.x - axis.x).hypot(p.y - axis.y);
        let from_sheet = p.y - (front - 0.5 + 2.0 * (0.1 * p.x).sin());
        let other = match off_axis {
            r if r < 5.0 => 900.0,
            r => (-500.0 - 550.0 * (r - radius_mm) / VOXEL_MM).clamp(-1000.0, 40.0),
        };
        let sheet = if from_sheet.abs() < VOXEL_MM {
            -300.0
        } else {
            -1000.0
        };
        scan.values().at(at).max(other as f32).max(sheet)
    };
    let planted = Volume::new(grid.clone(), (0..grid.len()).map(hu).collect()).expect("finite");
    let limb = extract_limb(&planted, &LimbSettings::default()).expect("limb");
    assert!(limb.report.other_voxels > 2000, "{:?}", limb.report);

    // Where the two are pressed together nobody can tell where the skin was.
    let free = |v: &Point3<f64>| (v.x - axis.x).hypot(v.y - axis.y) > radius_mm + 2.0 * VOXEL_MM;
    let vertices = limb.mesh.vertices.iter().map(|v| v.cast::<f64>());
    let (away, pressed): (Vec<_>, Vec<_>) = vertices.partition(free);
    let off = |v: &&Point3<f64>| leg.skin_distance_mm(v).abs() > 0.5 * VOXEL_MM;
    let beyond = away.iter().filter(off).count();
    assert!(beyond * 100 < away.len(), "{beyond} of {}", away.len());
    let worst = |part: &[Point3<f64>]| {
        let errors = part.iter().map(|v| leg.skin_distance_mm(v).abs());
        errors.fold(0.0, f64::max)
    };
    let [worst_away, worst_pressed] = [worst(&away), worst(&pressed)];
    assert!(worst_away < 2.0 * VOXEL_MM, "{worst_away} mm");
    assert!(
        worst_pressed < 2.0 * VOXEL_MM,
        "{worst_pressed} mm in the contact"
    );
}

/// Air in the flesh, marrow as light as lung and bone in all of it leave the cloud as it was.
#[test]
fn nothing_inside_reaches_the_surface() {
    let (leg, scan, alone) = &*PHANTOM;
    let grid = scan.grid();
    let high = grid.centre([0.0, 0.0, grid.size()[2] as f64 - 1.0]).z;
    let hu = |at: usize| {
        let p = grid.centre(grid.voxel(at).map(|v| v as f64));
        // Below the skin, and not where the scan's end opens the bones.
        let deep = leg.skin_distance_mm(&p) < -6.0 && p.z < high - 6.0;
        let pocket = [p.x, p.y, p.z]
            .map(|c| (0.13 * c).sin())
            .iter()
            .product::<f64>()
            > 0.5;
        match scan.values().at(at) {
            _ if deep && pocket => -1000.0,
            bone if deep && bone > 300.0 => -700.0,
            hu => hu,
        }
    };
    let hollow = Volume::new(grid.clone(), (0..grid.len()).map(hu).collect()).expect("finite");
    let limb = extract_limb(&hollow, &LimbSettings::default()).expect("limb");
    let hollow_voxels = limb.report.interior_voxels;
    assert!(hollow_voxels > 5000, "{hollow_voxels} voxels of air inside");
    assert_eq!(limb.mesh, alone.mesh);
}

#[test]
fn a_crop_finds_the_same_skin() {
    let (_, scan, whole) = &*PHANTOM;
    let size = scan.grid().size();
    let crop = VoxelBox {
        low: [0, 0, 20],
        high: [size[0], size[1], size[2] - 20],
    };
    let settings = LimbSettings {
        crop: Some(crop),
        ..LimbSettings::default()
    };
    let part = extract_limb(scan, &settings).unwrap();
    let grid = scan.grid();
    let within = |at: usize| (22..size[2] - 22).contains(&grid.voxel(at)[2]);
    let differ = (0..grid.len()).filter(|&at| within(at) && part.mask[at] != whole.mask[at]);
    assert!(differ.count() * 1000 < whole.report.limb_voxels);
    assert_eq!(part.report.low[2], 20);
}

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
        let moved = mean(&offset(&limb.mesh, distance)) - mean(&limb.mesh);
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
    let swollen = add_bumps(&limb.mesh, &[bump]);
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
fn a_thinner_limb_does_not_turn_inside_out_and_keeps_the_distance() {
    let mesh = &PHANTOM.2.mesh;
    let thin = offset(mesh, -4.0);
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
        let moved = offset(mesh, -4.0);
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
    assert!((most - 4.0).abs() < 1e-3);
    assert!(
        (left_mm3 / exact_mm3 - 1.0).abs() < 0.03,
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
    assert_eq!(bumps(&[air, air]), Err(BumpError::NoSkin { sites: 2 }));
    assert_eq!(bumps(&[]), Err(BumpError::NoSite { count: 3 }));
}

#[test]
fn air_and_wild_settings_are_refused() {
    let air = volume([8; 3], [1.0; 3], |_| -1000.0);
    let found = extract_limb(&air, &LimbSettings::default());
    assert!(matches!(found, Err(LimbError::NothingSolid { .. })));
    let slice = volume([64, 64, 1], [1.0; 3], |_| 40.0);
    let thin = SurfaceError::TooThin([64, 64, 1]);
    assert_eq!(
        extract_limb(&slice, &LimbSettings::default()),
        Err(LimbError::Surface(thin))
    );
    let (_, scan, _) = &*PHANTOM;
    let far = LimbSettings {
        inside: Some([1e4; 3]),
        ..LimbSettings::default()
    };
    assert_eq!(extract_limb(scan, &far), Err(LimbError::Inside([1e4; 3])));
    let thin = LimbSettings {
        core_radius_mm: f64::NAN,
        ..LimbSettings::default()
    };
    assert!(matches!(
        extract_limb(scan, &thin),
        Err(LimbError::Setting { .. })
    ));
    let crop = VoxelBox {
        low: [0; 3],
        high: [9999; 3],
    };
    let beyond = LimbSettings {
        crop: Some(crop),
        ..LimbSettings::default()
    };
    assert!(matches!(
        extract_limb(scan, &beyond),
        Err(LimbError::Crop { .. })
    ));
}
