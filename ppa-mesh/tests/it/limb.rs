//! The limb against the phantom's exact skin.

use std::sync::LazyLock;

use nalgebra::{Affine3, Matrix4, Point3};
use ppa_ct::{Grid, Volume};
use ppa_mesh::{Limb, LimbError, LimbSettings, SurfaceError, VoxelBox, extract_limb, toggle_body};
use ppa_phantom::{LowerLeg, TableTop};

use crate::fields::{on_grid, volume};

pub const VOXEL_MM: f64 = 1.5;

pub static PHANTOM: LazyLock<(LowerLeg, Volume, Limb)> = LazyLock::new(|| {
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

    // Where the two are pressed together nobody knows where the skin was.
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

/// A block of 30 mm beside the shin, 6 mm of air between them, and its centre.
fn with_block(scan: &Volume, alone: &Limb) -> (Volume, Point3<f64>) {
    let grid = scan.grid();
    let right = alone.mesh.vertices.iter().map(|v| f64::from(v.x));
    let right = right.fold(f64::INFINITY, f64::min);
    let size = grid.size();
    let middle = grid.centre([0, 1, 2].map(|axis| 0.5 * size[axis] as f64));
    let level = |v: &&Point3<f32>| (f64::from(v.z) - middle.z).abs() < 20.0;
    let edge = alone.mesh.vertices.iter().filter(level);
    let edge = edge.map(|v| f64::from(v.x)).fold(f64::INFINITY, f64::min);
    let centre = Point3::new(edge - 6.0 - 15.0, middle.y, middle.z);
    // Grid, and the box that it needs.
    let more = ((right - centre.x + 25.0) / VOXEL_MM).ceil().max(0.0) as usize;
    let first = grid.centre([0.0; 3]) - nalgebra::Vector3::x() * VOXEL_MM * more as f64;
    let wide = Grid::axis_aligned(
        [size[0] + more, size[1], size[2]],
        [VOXEL_MM; 3].into(),
        first,
    );
    let wide = wide.expect("grid");
    let hu = (0..wide.len()).map(|at| {
        let [i, j, k] = wide.voxel(at);
        let p = wide.centre([i, j, k].map(|v| v as f64));
        let off = (p - centre).abs().max();
        let block = if off < 15.0 { 50.0 } else { -1000.0 };
        let there = i.checked_sub(more).map(|i| scan.at([i, j, k]));
        there.unwrap_or(-1000.0).max(block)
    });
    (
        Volume::new(wide.clone(), hu.collect()).expect("finite"),
        centre,
    )
}

#[test]
fn a_body_is_kept_where_a_person_points_at_it() {
    let leg = LowerLeg::p01();
    let scan = leg.voxelise(VOXEL_MM, TableTop::Absent).expect("phantom");
    let alone = extract_limb(&scan, &LimbSettings::default()).expect("limb");
    let (planted, centre) = with_block(&scan, &alone);
    let of = |kept: &[Point3<f64>]| {
        let settings = LimbSettings {
            kept: kept.iter().map(|p| (*p).into()).collect(),
            ..LimbSettings::default()
        };
        extract_limb(&planted, &settings)
    };
    let removed = of(&[]).expect("limb");
    assert_eq!(removed.report.limb_voxels, alone.report.limb_voxels);
    let kept = of(&[centre]).expect("limb");
    // The same voxels of the leg, and those of the block: its sides are 19 to 21 voxels long.
    let both = removed.mask.iter().zip(&kept.mask);
    let (mut lost, mut added) = (0, 0);
    let grid = planted.grid();
    for (at, (before, after)) in both.enumerate() {
        let p = grid.centre(grid.voxel(at).map(|v| v as f64));
        let in_block = (p - centre).abs().max() < 15.0 + VOXEL_MM;
        lost += usize::from(*before && !after);
        added += usize::from(!before && *after && in_block);
        assert!(in_block || before == after, "{p}");
    }
    assert_eq!(lost, 0);
    assert!(
        (19_usize.pow(3)..=21_usize.pow(3)).contains(&added),
        "{added}"
    );
    assert_eq!(kept.report.limb_voxels, removed.report.limb_voxels + added);
    let topology = |limb: &Limb| limb.mesh.topology().components;
    assert_eq!((topology(&removed), topology(&kept)), (1, 2));
    let points = |limb: &Limb| {
        let bodies = limb.report.bodies.iter();
        bodies.map(|body| body.kept.len()).collect::<Vec<_>>()
    };
    assert_eq!((points(&removed), points(&kept)), (vec![0, 0], vec![0, 1]));

    // A second point of the block, or one of the leg, changes nothing; one in air is refused.
    let aside = centre + nalgebra::Vector3::new(3.0, 0.0, 0.0);
    assert_eq!(of(&[centre, aside]).expect("limb").mask, kept.mask);
    let in_leg = Point3::from(removed.report.bodies[0].centre_mm);
    assert_eq!(of(&[in_leg]), Ok(removed));
    let air = centre - nalgebra::Vector3::new(20.0, 0.0, 0.0);
    assert_eq!(of(&[air]), Err(LimbError::Kept(air.into())));
}

#[test]
fn a_toggled_body_is_kept_and_removed_as_its_points_say() {
    let leg = LowerLeg::p01();
    let scan = leg.voxelise(VOXEL_MM, TableTop::Absent).expect("phantom");
    let alone = extract_limb(&scan, &LimbSettings::default()).expect("limb");
    let (planted, centre) = with_block(&scan, &alone);
    let none = LimbSettings::default();
    let removed = extract_limb(&planted, &none).expect("limb");
    let point: [f64; 3] = centre.into();
    let (kept, points) = toggle_body(&planted, &none, point).expect("limb");
    assert_eq!(points, [point]);
    let settings = LimbSettings {
        kept: points,
        ..none.clone()
    };
    assert_eq!(extract_limb(&planted, &settings), Ok(kept.clone()));
    let aside = (centre + nalgebra::Vector3::new(3.0, 0.0, 0.0)).into();
    let again = toggle_body(&planted, &settings, aside).expect("limb");
    assert_eq!(again, (removed.clone(), Vec::new()));

    let in_leg = removed.report.bodies[0].point_mm();
    let refused = toggle_body(&planted, &settings, in_leg);
    assert_eq!(refused, Err(LimbError::InLimb(in_leg)));
    let air = (centre - nalgebra::Vector3::new(20.0, 0.0, 0.0)).into();
    let refused = toggle_body(&planted, &settings, air);
    assert_eq!(refused, Err(LimbError::Kept(air)));

    // A sheet 20 mm beyond the block is in no body, though some body is nearest.
    let grid = planted.grid();
    let sheet_y = centre.y - 15.0 - 20.0;
    let hu = (0..grid.len()).map(|at| {
        let p = grid.centre(grid.voxel(at).map(|v| v as f64));
        let off = p - centre;
        let in_sheet = (p.y - sheet_y).abs() < 2.0 && off.x.abs() < 12.0 && off.z.abs() < 12.0;
        if in_sheet {
            50.0
        } else {
            planted.values().at(at)
        }
    });
    let with_sheet = Volume::new(grid.clone(), hu.collect()).expect("finite");
    let in_sheet = [centre.x, sheet_y, centre.z];
    let refused = toggle_body(&with_sheet, &none, in_sheet);
    assert_eq!(refused, Err(LimbError::Thin(in_sheet)));
}

/// A gutter of 12 mm beside the shin, open towards the front: its middle lies in the air within it.
#[test]
fn a_hollow_body_is_kept_by_the_point_of_its_report() {
    let leg = LowerLeg::p01();
    let scan = leg.voxelise(VOXEL_MM, TableTop::Absent).expect("phantom");
    let alone = extract_limb(&scan, &LimbSettings::default()).expect("limb");
    let (planted, block) = with_block(&scan, &alone);
    let grid = planted.grid();
    // In place of the block, which is as far from the shin.
    let axis = block + nalgebra::Vector3::new(-20.0, 0.0, 0.0);
    let (inner_mm, outer_mm) = (20.0, 32.0);
    let more = ((outer_mm + 25.0) / VOXEL_MM).ceil() as usize;
    let [nx, ny, nz] = grid.size();
    let first = grid.centre([-(more as f64), 0.0, 0.0]);
    let wide = Grid::axis_aligned([nx + more, ny, nz], [VOXEL_MM; 3].into(), first).expect("grid");
    let hu = (0..wide.len()).map(|at| {
        let [i, j, k] = wide.voxel(at);
        let off = wide.centre([i, j, k].map(|v| v as f64)) - axis;
        let is_gutter = (inner_mm..outer_mm).contains(&off.x.hypot(off.y))
            && off.z.abs() < 40.0
            && (off.y > 0.0 || off.x.abs() > 10.0);
        let in_block = off.x.abs() < 45.0 && off.z.abs() < 45.0;
        match i.checked_sub(more).map(|i| planted.at([i, j, k])) {
            _ if is_gutter => 50.0,
            Some(_) if in_block => -1000.0,
            Some(hu) => hu,
            None => -1000.0,
        }
    });
    let scan = Volume::new(wide.clone(), hu.collect()).expect("finite");
    let found = extract_limb(&scan, &LimbSettings::default()).expect("limb");
    let [leg, gutter] = &found.report.bodies[..] else {
        panic!("{:?}", found.report.bodies)
    };
    assert_eq!(leg.inside_mm, Some(leg.centre_mm));
    let off_axis = |p: [f64; 3]| (p[0] - axis.x).hypot(p[1] - axis.y);
    assert!(off_axis(gutter.centre_mm) < inner_mm - 5.0, "{gutter:?}");
    let point = gutter.point_mm();
    // The core is what an erosion by 4 mm leaves.
    let core = inner_mm + 4.0 - VOXEL_MM..outer_mm - 4.0 + VOXEL_MM;
    assert!(core.contains(&off_axis(point)), "{point:?}");
    let settings = |kept| LimbSettings {
        kept: vec![kept],
        ..LimbSettings::default()
    };
    let kept = extract_limb(&scan, &settings(point)).expect("limb");
    assert_eq!(kept.report.bodies[1].kept, [point]);
    let refused = extract_limb(&scan, &settings(gutter.centre_mm));
    assert_eq!(refused, Err(LimbError::Kept(gutter.centre_mm)));
}

#[test]
fn settings_without_kept_bodies_are_written_as_before() {
    let text = serde_json::to_string(&LimbSettings::default()).unwrap();
    assert!(!text.contains("kept"), "{text}");
}

/// Two legs alike a hand's breadth apart: the direction chooses, not the few voxels of bone by which one is larger.
#[test]
fn of_two_limbs_the_one_in_the_wanted_direction_is_taken() {
    let leg = LowerLeg::p01()
        .voxelise(3.0, TableTop::Absent)
        .expect("phantom");
    let [nx, ny, nz] = leg.grid().size();
    let [spacing, origin] = [leg.grid().spacing_mm(), leg.grid().centre([0.0; 3]).coords];
    let grid = Grid::axis_aligned([2 * nx, ny, nz], spacing, origin.into()).expect("grid");
    let hu = (0..grid.len()).map(|at| {
        let [i, j, k] = grid.voxel(at);
        leg.at([i % nx, j, k])
    });
    let pair = Volume::new(grid.clone(), hu.collect()).expect("finite");
    let middle = grid.centre([nx as f64 - 0.5, 0.0, 0.0]).x;
    for sign in [-1.0, 1.0] {
        let settings = LimbSettings {
            towards: Some([sign, 0.0, 0.0]),
            ..LimbSettings::default()
        };
        let limb = extract_limb(&pair, &settings).expect("limb");
        assert!(
            limb.mesh
                .vertices
                .iter()
                .all(|v| (f64::from(v.x) - middle) * sign > 0.0)
        );
        assert_eq!(
            limb.report.bodies.iter().filter(|body| body.alike).count(),
            2
        );
    }
    // Lengthwise they do not lie side by side: nothing is chosen by that direction.
    let lengthwise = LimbSettings {
        towards: Some([0.0, 0.0, 1.0]),
        ..LimbSettings::default()
    };
    let default = extract_limb(&pair, &LimbSettings::default()).expect("limb");
    assert_eq!(
        extract_limb(&pair, &lengthwise).expect("limb").mask,
        default.mask
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

/// A rod through all of a scan with a tilted gantry.
#[test]
fn a_sheared_scan_has_the_limb_s_own_volume() {
    let tilt = 20_f64.to_radians();
    let mut matrix = Matrix4::identity();
    matrix[(1, 2)] = 2.0 * tilt.sin();
    matrix[(2, 2)] = 2.0 * tilt.cos();
    let grid = Grid::new([60, 90, 40], Affine3::from_matrix_unchecked(matrix)).expect("grid");
    let (middle, radius_mm) = (Point3::new(29.6, 58.2, 0.0), 20.0);
    let rod = on_grid(grid, |p| {
        let depth = radius_mm - (p.x - middle.x).hypot(p.y - middle.y);
        (-500.0 + 500.0 * depth).clamp(-1000.0, 40.0) as f32
    });
    let report = extract_limb(&rod, &LimbSettings::default())
        .expect("rod")
        .report;
    let area_mm2 = std::f64::consts::PI * radius_mm * radius_mm;
    let volume_mm3 = area_mm2 * 40.0 * 2.0 * tilt.cos();
    let off = report.limb_mm3 / volume_mm3 - 1.0;
    assert!(off.abs() < 0.01, "volume off by {off}");
    for cut in &report.cut_faces {
        let off = cut.area_mm2 / area_mm2 - 1.0;
        assert!(off.abs() < 0.01, "{cut:?} off by {off}");
    }
    assert_eq!(report.cut_faces.len(), 2);
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
