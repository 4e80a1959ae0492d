//! The visibility of an ankle's joint space in a radiograph agrees with its geometric openness, the better the less noise there is.

use nalgebra::{Isometry3, Matrix3, Point3, Rotation3, UnitQuaternion, Vector3};
use ppa_dataset::labels::BoneNumbers;
use ppa_generate::XraySettings;
use ppa_label::{AnkleBones, Exposure, JointSpace, Openness, Reading, Visibility};
use ppa_metrics::spearman;
use ppa_phantom::{LowerLeg, Side, TableTop};
use ppa_xray::{Detector, Projection, VoxelPhantom, fast};

const SOURCE_JOINT_MM: f64 = 1050.0;
const SOURCE_DETECTOR_MM: f64 = 1150.0;

/// Pose of the device in front of a right leg that is rotated inwards: x along the rows, y distal, z from tube to detector.
fn ct_from_device(joint: &Point3<f64>, axis: &Vector3<f64>, degrees: f64) -> Isometry3<f64> {
    let anterior = (-Vector3::y() + axis * axis.y).normalize();
    let turn = UnitQuaternion::from_scaled_axis(axis * -degrees.to_radians());
    let towards_source = turn * anterior;
    let x = axis.cross(&towards_source);
    let axes = Matrix3::from_columns(&[x, -axis, -towards_source]);
    let rotation = UnitQuaternion::from_rotation_matrix(&Rotation3::from_matrix_unchecked(axes));
    Isometry3::from_parts(
        (joint + towards_source * SOURCE_JOINT_MM).coords.into(),
        rotation,
    )
}

#[test]
fn radiographs_rank_poses_as_geometry_does() {
    let leg = LowerLeg::family("P01", Side::Right).unwrap();
    let truth = leg.truth();
    let (joint, axis) = (truth.joint_centre, truth.axis_direction.into_inner());
    let reach = Vector3::repeat(60.0);
    let volume = leg
        .voxelise_box([joint - reach, joint + reach], 1.0, TableTop::Absent)
        .unwrap();
    let labels = leg.bone_labels(volume.grid());
    let bones = AnkleBones::new(volume.grid(), &labels, BoneNumbers::default(), &joint).unwrap();
    let anterior = (-Vector3::y() + axis * axis.y).normalize();
    let patient = Matrix3::from_columns(&[anterior.cross(&axis), anterior, axis]);
    let patient = UnitQuaternion::from_rotation_matrix(&Rotation3::from_matrix_unchecked(patient));
    let space =
        JointSpace::new(bones, &Isometry3::from_parts(joint.coords.into(), patient)).unwrap();

    let settings = XraySettings::default();
    let phantom = VoxelPhantom::from_volume(&volume, &settings.calibration, None).unwrap();
    let spectrum = ppa_generate::spectrum(&settings).unwrap();
    let mortise_deg = truth.mortise_angle_rad.to_degrees();
    let devices: Vec<Isometry3<f64>> = (-5..=5)
        .map(|n| ct_from_device(&joint, &axis, mortise_deg + 2.0 * f64::from(n)))
        .collect();
    let exposures: Vec<Exposure> = devices
        .iter()
        .map(|device| Exposure::of_device(device, joint))
        .collect();
    let openness = space.openness(&exposures).unwrap();
    let agreement = |dose_histories: f64| {
        let visible: Vec<Visibility> = devices
            .iter()
            .zip(1..)
            .map(|(device, seed)| {
                let detector = Detector::centred(100, 100, 0.8);
                let projection = Projection::new(*device, SOURCE_DETECTOR_MM, detector);
                let engine = settings
                    .engine
                    .with_dose_histories(dose_histories)
                    .with_scatter_histories(5_000)
                    .with_samples_per_side(2)
                    .with_seed(seed);
                let radiograph = fast(&phantom, &spectrum, &projection, &engine).unwrap();
                let reading = Reading {
                    detector: &detector,
                    source_detector_mm: SOURCE_DETECTOR_MM,
                    ct_from_device: device,
                    value: &radiograph.total(),
                    sigma: &radiograph.sigma(),
                };
                space.visibility(&reading)
            })
            .collect();
        // If nothing is visible in any pose, the rank correlation is 0.
        let rank = |geometric: fn(&Openness) -> f64, visible_of: fn(&Visibility) -> f64| {
            let geometric: Vec<f64> = openness.iter().map(geometric).collect();
            let visible: Vec<f64> = visible.iter().map(visible_of).collect();
            spearman(&geometric, &visible).unwrap_or(0.0)
        };
        let medial = rank(|open| open.medial[1], |seen| seen.medial);
        let lateral = rank(|open| open.lateral[1], |seen| seen.lateral);
        let best = most(&worst_relative(&visible));
        println!("{dose_histories:e}: medial {medial:.3}, lateral {lateral:.3}, best pose {best}");
        (0.5 * (medial + lateral), best)
    };
    let [dark, noisy, clear] = [1e5, 1e7, 1e10].map(agreement);
    assert!(
        dark.0 < noisy.0 && noisy.0 < clear.0,
        "{dark:?} {noisy:?} {clear:?}"
    );
    // Margins read at the wrong places still give 0.977 for a clear image, but 0.69 for a noisy one.
    assert!(noisy.0 > 0.9 && clear.0 > 0.97, "{noisy:?} {clear:?}");
    // Poses are 2 degrees apart.
    let geometric: Vec<f64> = openness.iter().map(|open| open.worst()[1]).collect();
    assert!(most(&geometric).abs_diff(clear.1) <= 1, "{clear:?}");
}

/// Visibility of each gutter relative to its best in several radiographs of one foot; the minimum over the gutters. 0
/// throughout if a gutter is never visible.
fn worst_relative(all: &[Visibility]) -> Vec<f64> {
    let relative = |of: fn(&Visibility) -> f64| -> Vec<f64> {
        let best = all.iter().map(of).fold(0.0, f64::max);
        let seen = |one: &Visibility| if best > 0.0 { of(one) / best } else { 0.0 };
        all.iter().map(seen).collect()
    };
    let (medial, superior) = (relative(|v| v.medial), relative(|v| v.superior));
    let lateral = relative(|v| v.lateral);
    (0..all.len())
        .map(|n| medial[n].min(superior[n]).min(lateral[n]))
        .collect()
}

/// Index of the largest value.
fn most(values: &[f64]) -> usize {
    (0..values.len())
        .max_by(|&a, &b| values[a].total_cmp(&values[b]))
        .unwrap()
}
