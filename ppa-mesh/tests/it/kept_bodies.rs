//! Bodies next to the limb that are kept as parts of it.

use nalgebra::Point3;
use ppa_ct::{Grid, Volume};
use ppa_mesh::{Limb, LimbError, LimbSettings, extract_limb, toggle_body};
use ppa_phantom::{LowerLeg, TableTop};

use crate::limb::VOXEL_MM;

/// A block of 30 mm next to the shin, 6 mm of air between them, and its centre.
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

    // A second point of the block, or one of the leg, has no effect; one in air is refused.
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

/// A gutter of 12 mm next to the shin, open towards the front: its middle is in the air within it.
#[test]
fn a_hollow_body_is_kept_by_the_point_of_its_report() {
    let leg = LowerLeg::p01();
    let scan = leg.voxelise(VOXEL_MM, TableTop::Absent).expect("phantom");
    let alone = extract_limb(&scan, &LimbSettings::default()).expect("limb");
    let (planted, block) = with_block(&scan, &alone);
    let grid = planted.grid();
    // Instead of the block, which is as far from the shin.
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
