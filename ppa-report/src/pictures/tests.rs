//! Tests of the pictures of cases and poses.

use std::sync::LazyLock;

use image::RgbImage;
use nalgebra::{Matrix4, Point3, Vector3};
use ppa_ct::{Grid, Volume};
use ppa_dataset::findings::{Finding, FindingCode, Severity};
use ppa_generate::Plan;
use ppa_generate::PreparedLimb;
use ppa_generate::Table;
use ppa_mesh::{LimbSettings, extract_limb};
use ppa_phantom::{LowerLeg, TableTop};
use ppa_scene::{LandmarkOverrides, LimbKind, Side, find_landmarks, place};

use super::canvas::Rect;
use super::case_picture::panel;
use super::palette::{AXIS, JOINT, OUTLINE};
use super::pose_scene::PoseScene;
use super::sheet::{HEIGHT, WIDTH};
use super::{PosedLimb, case_picture, pose_picture};

fn prepared(volume: Volume, choices: &LandmarkOverrides) -> PreparedLimb {
    let limb = extract_limb(&volume, &LimbSettings::default()).unwrap();
    let landmarks = find_landmarks(&volume, &limb.mesh, &limb.mask, Side::Right, choices).unwrap();
    PreparedLimb {
        volume,
        limb: limb.into(),
        landmarks,
        findings: Vec::new(),
    }
}

fn phantom() -> Volume {
    LowerLeg::p01().voxelise(2.0, TableTop::Absent).unwrap()
}

static LEG: LazyLock<PreparedLimb> =
    LazyLock::new(|| prepared(phantom(), &LandmarkOverrides::default()));
static PICTURE: LazyLock<RgbImage> = LazyLock::new(|| case_picture("leg.case.toml", &LEG, &[]));

/// Centres of the pixels of a panel that have a colour.
fn coloured(picture: &RgbImage, rect: Rect, colour: [u8; 3]) -> Vec<[f64; 2]> {
    let [[left, right], [top, bottom]] = rect.ends();
    let pixels = (top..bottom).flat_map(|y| (left..right).map(move |x| (x, y)));
    pixels
        .filter(|(x, y)| picture.get_pixel(*x, *y).0 == colour)
        .map(|(x, y)| [f64::from(x) + 0.5, f64::from(y) + 0.5])
        .collect()
}

fn mean(points: &[[f64; 2]]) -> [f64; 2] {
    [0, 1].map(|i| points.iter().map(|p| p[i]).sum::<f64>() / points.len() as f64)
}

/// The joint's disc is drawn over the axis, so the line through the axis' pixels has to meet the middle of the disc.
#[test]
fn the_axis_meets_the_joint_within_a_pixel_in_every_panel() {
    // In the axial slice, the axis is little more than a point.
    let panels = [(1, 0), (2, 0), (0, 1), (1, 1), (2, 1)];
    for (column, row) in panels {
        let rect = panel(column, row);
        let axis = coloured(&PICTURE, rect, AXIS);
        assert!(axis.len() > 150, "{column} {row}: {} pixels", axis.len());
        let [x, y] = mean(&axis);
        let sum = |f: fn(f64, f64) -> f64| axis.iter().map(|p| f(p[0] - x, p[1] - y)).sum::<f64>();
        // Direction of least squares across the line.
        let angle = 0.5 * (2.0 * sum(|u, v| u * v)).atan2(sum(|u, v| u * u - v * v));
        let joint = mean(&coloured(&PICTURE, rect, JOINT));
        let off = (joint[1] - y) * angle.cos() - (joint[0] - x) * angle.sin();
        assert!(off.abs() < 1.0, "{column} {row}: {off:.2} pixels");
    }
}

#[test]
fn a_picture_has_its_size_and_the_same_bytes_every_time() {
    assert_eq!(PICTURE.dimensions(), (WIDTH, HEIGHT));
    assert!(*PICTURE == case_picture("leg.case.toml", &LEG, &[]));
    let folder = tempfile::tempdir().unwrap();
    let write = |name: &str| {
        let path = folder.path().join(name);
        super::write_picture(&path, &PICTURE).unwrap();
        std::fs::read(path).unwrap()
    };
    assert_eq!(write("a.png"), write("b.png"));
}

/// The phantom's proximal end is cut by its volume anyway; here the front half of the volume is cut away as well.
#[test]
fn the_skin_is_outlined_and_its_cut_is_shown() {
    for column in 0..3 {
        assert!(coloured(&PICTURE, panel(column, 0), OUTLINE).len() > 60);
    }
    assert_eq!(LEG.limb.report.cut_faces.len(), 1);
    let volume = phantom();
    let [ni, nj, nk] = volume.grid().size();
    let cut = volume.crop([0, nj / 2, 0], [ni, nj, nk]).unwrap();
    let cut = prepared(cut, &LandmarkOverrides::default());
    let picture = case_picture("cut.toml", &cut, &[]);
    let magenta = |picture: &RgbImage| {
        let [[left, right], [top, bottom]] = panel(0, 1).ends();
        let pixels = (top..bottom).flat_map(|y| (left..right).map(move |x| (x, y)));
        let is_cut = |p: [u8; 3]| p[0] > 100 && p[1] < 40 && p[2] > 70;
        let cut = pixels.filter(|(x, y)| is_cut(picture.get_pixel(*x, *y).0));
        cut.count()
    };
    let [before, after] = [&*PICTURE, &picture].map(magenta);
    assert!(after > before + 1000, "{before} and {after} pixels");
}

/// The same scan with its columns stored from left to right instead of from right to left and its slices first.
fn stored_otherwise(volume: &Volume) -> Volume {
    let [ni, nj, nk] = volume.grid().size();
    let affine = volume.grid().ct_from_voxel().matrix();
    let column = |axis: usize| affine.column(axis).into_owned();
    let origin = column(3) + column(0) * (ni - 1) as f64;
    let matrix = Matrix4::from_columns(&[column(2), -column(0), column(1), origin]);
    let grid = Grid::new(
        [nk, ni, nj],
        nalgebra::Affine3::from_matrix_unchecked(matrix),
    )
    .unwrap();
    let values = (0..grid.len()).map(|index| {
        let [k, i, j] = grid.voxel(index);
        volume.at([ni - 1 - i, j, k])
    });
    let values = values.collect();
    Volume::new(grid, values).unwrap()
}

#[test]
fn the_picture_does_not_depend_on_how_the_scan_is_stored() {
    let otherwise = prepared(stored_otherwise(&LEG.volume), &LandmarkOverrides::default());
    let picture = case_picture("leg.case.toml", &otherwise, &[]);
    for row in 0..2 {
        for column in 0..3 {
            let [[left, right], [top, bottom]] = panel(column, row).ends();
            let pixels = (top..bottom).flat_map(|y| (left..right).map(move |x| (x, y)));
            let differs = |(x, y): &(u32, u32)| {
                let [a, b] = [&*PICTURE, &picture].map(|p| p.get_pixel(*x, *y).0);
                (0..3).any(|i| a[i].abs_diff(b[i]) > 40)
            };
            let count = pixels.filter(differs).count();
            assert!(count < 600, "{count} pixels differ in panel {column} {row}");
        }
    }
}

/// A block of metal left of the joint is on the viewer's right, at the letter L.
#[test]
fn the_patients_left_is_on_the_viewers_right() {
    let volume = phantom();
    let joint = Point3::from(LEG.landmarks.joint_centre);
    let block = joint + Vector3::new(45.0, 0.0, 0.0);
    let values = (0..volume.grid().len()).map(|index| {
        let voxel = volume.grid().voxel(index).map(|v| v as f64);
        let near = (volume.grid().centre(voxel) - block).amax() < 12.0;
        if near {
            3000.0
        } else {
            volume.at(volume.grid().voxel(index))
        }
    });
    let values: Vec<f32> = values.collect();
    let marked = Volume::new(volume.grid().clone(), values).unwrap();
    let marked = PreparedLimb {
        volume: marked,
        limb: LEG.limb.clone(),
        landmarks: LEG.landmarks.clone(),
        findings: Vec::new(),
    };
    let picture = case_picture("leg.case.toml", &marked, &[]);
    for column in [0, 1] {
        let rect = panel(column, 0);
        let pixels = coloured_differently(&picture, rect);
        let joint = mean(&coloured(&PICTURE, rect, JOINT));
        let block = mean(&pixels);
        assert!(pixels.len() > 30, "{column}: {}", pixels.len());
        assert!(block[0] > joint[0] + 20.0, "{block:?} {joint:?}");
        assert!((block[1] - joint[1]).abs() < 12.0, "{block:?} {joint:?}");
    }
}

fn coloured_differently(picture: &RgbImage, rect: Rect) -> Vec<[f64; 2]> {
    let [[left, right], [top, bottom]] = rect.ends();
    let pixels = (top..bottom).flat_map(|y| (left..right).map(move |x| (x, y)));
    pixels
        .filter(|(x, y)| picture.get_pixel(*x, *y) != PICTURE.get_pixel(*x, *y))
        .map(|(x, y)| [f64::from(x) + 0.5, f64::from(y) + 0.5])
        .collect()
}

#[test]
fn odd_limbs_have_pictures_too() {
    let volume = phantom();
    let [ni, nj, nk] = volume.grid().size();
    let calf = volume.crop([0, 0, nk - 40], [ni, nj, nk]).unwrap();
    let other = LandmarkOverrides {
        limb: Some(LimbKind::Other),
        ..LandmarkOverrides::default()
    };
    // Next to the limb.
    let [x, y, z] = LEG.landmarks.joint_centre;
    let far_joint = LandmarkOverrides {
        joint_centre: Some([x + 80.0, y, z]),
        ..LandmarkOverrides::default()
    };
    let odd = [prepared(calf, &other), prepared(phantom(), &far_joint)];
    for mut limb in odd {
        limb.findings = vec![Finding {
            code: FindingCode::LimbTooSmall,
            severity: Severity::Severe,
            text: "a finding somewhere else ".repeat(30),
            value: Some(f64::NAN),
            place_mm: Some([1e9, f64::NAN, 0.0]),
        }];
        let picture = case_picture("é漢.toml", &limb, &[FindingCode::NoJoint]);
        assert_eq!(picture.width(), WIDTH);
        assert!(picture.height() >= HEIGHT);
        let known = case_picture("é漢.toml", &limb, &[FindingCode::LimbTooSmall]);
        assert!(picture != known);
    }
}

#[test]
fn a_posed_limb_rests_on_the_points_that_are_marked() {
    let plan = Plan::new(Vec::new());
    let table = Table::of_plan(&plan).unwrap();
    let limb = &*LEG;
    for angle_deg in [0.0, 18.0, 90.0] {
        let skin = &limb.limb.mesh.vertices;
        let (landmarks, plane) = (&limb.landmarks, &table.plane.plane);
        let angle = f64::to_radians(angle_deg);
        let placement = place(skin, landmarks, angle, plane, &table.room.device).unwrap();
        let rig = plan.depth.cameras().unwrap();
        let detector = &plan.xray.detector;
        let scene = PoseScene::new(limb, &placement, &table, &rig, detector).unwrap();
        let [distal, proximal] = scene.contacts[..] else {
            panic!("{:?}", scene.contacts);
        };
        for (point, height) in [
            (distal, placement.contact.distal_mm),
            (proximal, placement.contact.proximal_mm),
        ] {
            // In single precision.
            assert!((plane.signed_distance(&point) - height).abs() < 1e-3);
        }
        let head = scene.axes.column(1);
        assert!(head.dot(&(proximal - distal)) > 0.0);
        // Both cameras are above the table, and the joint is inside the part of it that they see.
        for cone in &scene.cones {
            assert!(plane.signed_distance(&cone.eye) > 500.0);
            let [across, head] = [0, 1].map(|i| scene.axes.column(i).into_owned());
            let flat = cone.corners.map(|c| c - scene.joint);
            let flat = flat.map(|c| [across.dot(&c), head.dot(&c)]);
            let turns = (0..4).map(|i| {
                let ([ax, ay], [bx, by]) = (flat[i], flat[(i + 1) % 4]);
                ax * by - ay * bx > 0.0
            });
            let turns: Vec<bool> = turns.collect();
            assert!(
                turns.iter().all(|t| *t == turns[0]),
                "{}: {flat:?}",
                cone.name
            );
        }
        let posed = PosedLimb {
            limb,
            placement: &placement,
            angle_deg,
            table: &table,
            plan: &plan,
            acknowledged: &[],
        };
        let picture = pose_picture("leg.case.toml", &posed).unwrap();
        assert_eq!(picture.dimensions(), (WIDTH, HEIGHT));
        assert!(picture == pose_picture("leg.case.toml", &posed).unwrap());
    }
}
