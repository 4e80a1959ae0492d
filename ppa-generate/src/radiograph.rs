//! The exposure of a posed limb: its voxels around the central beam, and the device in the frame of the scan.

use nalgebra::{Point3, Unit, Vector3};
use ppa_ct::Volume;
use ppa_scene::{Landmarks, Placement, XrayDevice, ct_from_device};
use ppa_xray::{PreparedPhantom, Projection, VoxelPhantom};

use crate::plan::{Plan, XraySettings};
use crate::prepared_limb::PreparedLimb;

const AIR_HU: f32 = -1000.0;

/// Why the joint cannot be converted to voxels of material and density.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum JointError {
    /// No voxel of the limb lies near the beam.
    #[error(
        "no voxel of the limb lies within {half_length_mm} mm of the central beam along the limb's axis"
    )]
    NoLimb {
        /// Half the length that was searched, mm.
        half_length_mm: f64,
    },
    /// The scan cannot be cropped.
    #[error(transparent)]
    Volume(#[from] ppa_ct::VolumeError),
    /// Materials and densities cannot be assigned.
    #[error(transparent)]
    Phantom(#[from] ppa_xray::PhantomError),
}

/// The limb around the central beam as voxels of material and density; couch and sheet become air.
///
/// # Errors
/// [`JointError`] when there is no limb near the beam or the HU calibration is unusable.
fn limb_phantom(
    prepared: &PreparedLimb,
    settings: &XraySettings,
    shift_mm: f64,
) -> Result<VoxelPhantom, JointError> {
    let (volume, mask) = (&prepared.volume, &prepared.limb.mask);
    let grid = volume.grid();
    let joint = Point3::from(prepared.landmarks.joint_centre);
    let axis = Unit::new_normalize(Vector3::from(prepared.landmarks.axis_direction));
    let half_length_mm = settings.half_length_mm;
    let (mut low, mut high) = (grid.size(), [0; 3]);
    for index in (0..grid.len()).filter(|&index| mask[index]) {
        let voxel = grid.voxel(index);
        let along_mm = (grid.centre(voxel.map(|v| v as f64)) - joint).dot(&axis);
        if (along_mm - shift_mm).abs() <= half_length_mm {
            for a in 0..3 {
                low[a] = low[a].min(voxel[a]);
                high[a] = high[a].max(voxel[a] + 1);
            }
        }
    }
    if high == [0; 3] {
        return Err(JointError::NoLimb { half_length_mm });
    }
    let cropped = volume.crop(low, high)?;
    let hu = cropped.values().iter().enumerate().map(|(index, hu)| {
        let [i, j, k] = cropped.grid().voxel(index);
        let in_limb = mask[grid.index([i + low[0], j + low[1], k + low[2]])];
        if in_limb { hu } else { AIR_HU }
    });
    let limb = Volume::new(cropped.grid().clone(), hu.collect())?;
    let fine = limb.refined(settings.max_voxel_mm)?;
    let phantom = VoxelPhantom::from_volume(&fine, &settings.calibration, None)?;
    Ok(phantom
        .with_interpolation(settings.interpolation)
        .with_form_factors(settings.form_factors))
}

/// The limb around the central beam as voxels of material and density, ready for exposures in any rotation.
///
/// The result depends on the plan's shift of the beam along the limb, voxels, interpolation, calibration, form factors and Compton model.
///
/// # Errors
/// [`JointError`] when there is no limb near the beam or the HU calibration is unusable.
pub fn prepared_phantom(
    prepared: &PreparedLimb,
    plan: &Plan,
) -> Result<PreparedPhantom<'static>, JointError> {
    let [_, along_mm] = plan.positioning.beam_shift_mm;
    let voxels = limb_phantom(prepared, &plan.xray, along_mm)?;
    Ok(PreparedPhantom::new(voxels, plan.xray.engine.compton_model))
}

/// The projection of a placed limb: the device is moved into the frame of the scan, the voxels stay.
pub fn projection(
    placement: &Placement,
    landmarks: &Landmarks,
    device: &XrayDevice,
    settings: &XraySettings,
) -> Projection {
    Projection::new(
        *ct_from_device(placement, landmarks, device).isometry(),
        device.source_detector_mm,
        settings.detector,
    )
    .with_source(settings.source)
    .with_receptor(settings.receptor.clone())
    .with_marker(settings.marker.map(|place| place.of(landmarks.side)))
}
