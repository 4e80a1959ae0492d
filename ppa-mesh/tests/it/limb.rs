//! The limb against the phantom's exact skin.

use std::sync::LazyLock;

use nalgebra::{Affine3, Matrix4, Point3};
use ppa_ct::{Grid, Volume};
use ppa_mesh::{Limb, LimbError, LimbSettings, SurfaceError, VoxelBox, extract_limb};
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

    // Where the two are pressed together, the position of the skin is unknown.
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

/// Two similar legs a hand's breadth apart: the direction decides, not the few voxels of bone by which one is larger.
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
    // Lengthwise they are not side by side, so that direction has no effect.
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

/// Air in the flesh, marrow as light as lung and bone throughout do not change the surface.
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

/// A rod through an entire scan with a tilted gantry.
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
