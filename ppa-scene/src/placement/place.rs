//! Laying a rotated limb on the table under the central beam: T_rot, T_mat and T_opt.

use std::f64::consts::TAU;

use nalgebra::{Isometry3, Point3, Translation3, Unit, UnitQuaternion, Vector3};
use ppa_core::Side;
use serde::{Deserialize, Serialize};

use crate::frames::Room;
use crate::frames::{Ct, Device, Patient, Rigid};
use crate::landmarks::contact::Profile;
use crate::landmarks::found::Landmarks;
use crate::placement::error::{PlaceError, check_points};
use crate::placement::matching::{axes_rotation, on_beam, plane_axes, table_axes};
use crate::placement::positioning::Positioning;
use crate::placement::soft_tissue::{Flattening, SoftTissue};
use crate::room::device::XrayDevice;
use crate::room::plane::Plane;

/// How a limb lies on the table, apart from its rotation.
///
/// The default is the paper's: a rigid limb that rests on two places, its joint on the central beam.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct PlaceSettings {
    /// Indentation of the soft tissue.
    pub soft_tissue: SoftTissue,
    /// Errors of positioning.
    pub positioning: Positioning,
}

/// A limb on the table.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Placement {
    /// T^ToF_P = T_opt · T_mat · T_rot.
    pub room_from_patient: Rigid<Room, Patient>,
    /// Medial rotation about the limb's axis.
    pub t_rot: Rigid<Patient, Patient>,
    /// Brings Π_P onto the table plane, the limb's axis along the table and the joint centre
    /// onto the central beam.
    pub t_mat: Rigid<Room, Patient>,
    /// Tips the limb about the room's X axis through the joint centre until it rests on two
    /// places, or beyond by the tilt of [`Positioning`], and moves it onto the table and away from the beam by its shift.
    pub t_opt: Rigid<Room, Room>,
    /// Flattening of the soft tissue; `None` for a rigid skin.
    pub flattening: Option<Flattening>,
    /// How the limb rests on the table.
    pub contact: Contact,
}

/// How a placed limb rests on the table plane; measured on the placed points, flattened ones if soft tissue deforms.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Contact {
    /// Air between the table and the lowest point, mm.
    pub gap_mm: f64,
    /// How deep the lowest point lies inside the table, mm.
    pub penetration_mm: f64,
    /// Height of the lowest distal point, mm.
    pub distal_mm: f64,
    /// Height of the lowest proximal point, mm.
    pub proximal_mm: f64,
    /// Distance between the contacts, before the tilt of [`Positioning`], mm. Nearly 0 if the limb rests on its middle and its ends
    /// hang in the air.
    pub apart_mm: f64,
    /// Where distal ends and proximal begins, from the joint along the table before the limb is
    /// tipped, mm.
    pub split_mm: f64,
    /// Tilt of T_opt, that of [`Positioning`] included, radians; + lifts the proximal end.
    pub tilt_rad: f64,
    /// Number of searches for the closest points.
    pub iterations: u32,
}

/// T_rot: rotates the limb about its axis, the front of the limb towards the body's midline.
///
/// The front (+y of the patient frame) of a right limb rotates towards −x, the patient's left; that
/// of a left limb towards +x.
pub fn medial_rotation(side: Side, angle_rad: f64) -> Rigid<Patient, Patient> {
    let about_z = match side {
        Side::Right => angle_rad,
        Side::Left => -angle_rad,
    };
    let rotation = UnitQuaternion::from_axis_angle(&Vector3::z_axis(), about_z);
    Rigid::new(Isometry3::from_parts(Translation3::identity(), rotation))
}

/// Places a limb with a rigid skin, given by its vertices in the `ct` frame.
///
/// `table` faces the source. The limb is split into front (distal) and back (proximal) across the
/// table at the joint; a limb that has less than a tenth of its length on one side of the joint (a
/// knee, a calf) is split at the middle of its length instead.
///
/// # Errors
/// [`PlaceError`] when the points or landmarks are unusable, the beam misses the table, or no
/// tilt lets both ends of the limb touch.
pub fn place(
    points_ct: &[Point3<f32>],
    landmarks: &Landmarks,
    angle_rad: f64,
    table: &Plane,
    device: &XrayDevice,
) -> Result<Placement, PlaceError> {
    let settings = PlaceSettings::default();
    place_with(points_ct, landmarks, angle_rad, table, device, &settings)
}

/// [`place`] with soft tissue that deforms where the limb rests, and errors of positioning.
///
/// Both parts sink in; [`Placement::in_room`] gives the flattened skin. A tilted limb rests on one of them. The central beam
/// meets the table at the same point as without a shift; the limb moves instead.
///
/// # Errors
/// The same as [`place`], and for depths, a tilt or a shift out of range.
pub fn place_with(
    points_ct: &[Point3<f32>],
    landmarks: &Landmarks,
    angle_rad: f64,
    table: &Plane,
    device: &XrayDevice,
    settings: &PlaceSettings,
) -> Result<Placement, PlaceError> {
    let PlaceSettings {
        soft_tissue,
        positioning,
    } = settings;
    check_points(points_ct)?;
    soft_tissue.check()?;
    positioning.check()?;
    if !(-TAU..=TAU).contains(&angle_rad) {
        return Err(PlaceError::Angle(angle_rad));
    }
    let patient_from_ct = landmarks.patient_from_ct();
    let turn = patient_from_ct.isometry().rotation;
    if !turn.coords.iter().all(|c| c.is_finite()) {
        return Err(PlaceError::Axes);
    }
    let under_limb = landmarks.supporting_plane().map_err(PlaceError::Plane)?;
    let t_rot = medial_rotation(landmarks.side, angle_rad);
    let (room_axes, limb_axes) = (table_axes(table, device)?, plane_axes(&under_limb));
    let rotation = axes_rotation(&room_axes, &limb_axes);

    // Lengths and heights about the joint centre, along the table and above it.
    let table_from_ct = limb_axes.transpose()
        * (t_rot * patient_from_ct)
            .isometry()
            .rotation
            .to_rotation_matrix()
            .matrix();
    let joint_ct = Point3::from(landmarks.joint_centre);
    let seen = |p: &Point3<f32>| {
        let offset = table_from_ct * (p.cast::<f64>() - joint_ct);
        [offset.y, offset.z]
    };
    let profile = Profile::split(points_ct.iter().map(seen)).lifted(soft_tissue.depths_mm());
    let tilt = profile.resting_tilt().ok_or_else(|| {
        let [distal, proximal] = profile.heights(0.0);
        let low = distal.min(proximal);
        PlaceError::NoRest {
            distal_mm: distal - low,
            proximal_mm: proximal - low,
        }
    })?;
    let tilt_rad = tilt.angle_rad + positioning.tilt_deg.to_radians();
    let [distal, proximal] = profile.heights(tilt_rad);

    let matched_joint = on_beam(-under_limb.offset_mm, table, device)?;
    let [across_mm, along_mm] = positioning.beam_shift_mm;
    let shift = room_axes.column(0) * across_mm + room_axes.column(1) * along_mm;
    let placed_joint = on_beam(-distal.min(proximal), table, device)? - shift;
    let t_mat = Rigid::new(Isometry3::from_parts(matched_joint.into(), rotation));
    let room_x = Unit::new_unchecked(room_axes.column(0).into_owned());
    let about_x = UnitQuaternion::from_axis_angle(&room_x, tilt_rad);
    let t_opt = Rigid::new(
        Translation3::from(placed_joint) * about_x * Translation3::from(matched_joint).inverse(),
    );
    let room_from_patient = t_opt * t_mat * t_rot;
    let room_from_ct = room_from_patient * patient_from_ct;
    let is_distal = |p: &Point3<f32>| seen(p)[0] < profile.split_mm;
    let flattening = if *soft_tissue == SoftTissue::default() {
        None
    } else {
        lowest_points(points_ct, room_from_ct, table, is_distal).map(|lowest| {
            let is_tilted = positioning.tilt_deg != 0.0;
            Flattening::at(lowest, table, &room_axes, is_tilted)
        })
    };
    let [distal_mm, proximal_mm] = measure(
        points_ct,
        room_from_ct,
        table,
        flattening.as_ref(),
        is_distal,
    );
    let lowest_mm = distal_mm.min(proximal_mm);
    Ok(Placement {
        room_from_patient,
        t_rot,
        t_mat,
        t_opt,
        flattening,
        contact: Contact {
            gap_mm: lowest_mm.max(0.0),
            penetration_mm: (-lowest_mm).max(0.0),
            distal_mm,
            proximal_mm,
            apart_mm: tilt.apart_mm,
            split_mm: profile.split_mm,
            tilt_rad,
            iterations: tilt.iterations,
        },
    })
}

impl Placement {
    /// Points of a limb in the room, from the vertices of its skin in the `ct` frame.
    pub fn in_room(&self, points_ct: &[Point3<f32>], landmarks: &Landmarks) -> Vec<Point3<f32>> {
        let room_from_ct = self.room_from_patient * landmarks.patient_from_ct();
        let lies = |p: &Point3<f32>| {
            let placed = room_from_ct * p.cast::<f64>();
            self.flattening
                .map_or(placed, |flattening| flattening.flattened(&placed))
                .cast()
        };
        points_ct.iter().map(lies).collect()
    }
}

/// Pose of the device in the scan: (T^P_CT)⁻¹ (T^ToF_P)⁻¹ · device pose in the room.
///
/// The radiograph of a pose is taken by moving the device, so the voxels are never rotated.
pub fn ct_from_device(
    placement: &Placement,
    landmarks: &Landmarks,
    device: &XrayDevice,
) -> Rigid<Ct, Device> {
    landmarks.patient_from_ct().inverse()
        * placement.room_from_patient.inverse()
        * device.room_from_device
}

/// Lowest heights of the distal and the proximal part of the placed skin above the table.
fn measure(
    points_ct: &[Point3<f32>],
    room_from_ct: Rigid<Room, Ct>,
    table: &Plane,
    flattening: Option<&Flattening>,
    is_distal: impl Fn(&Point3<f32>) -> bool,
) -> [f64; 2] {
    let (mut distal_mm, mut proximal_mm) = (f64::INFINITY, f64::INFINITY);
    // The table in the frame of the scan: one product per point.
    let table_ct = table.transformed(room_from_ct.inverse().isometry());
    let height = |p: Point3<f64>| match flattening {
        None => table_ct.signed_distance(&p),
        Some(flattening) => table.signed_distance(&flattening.flattened(&(room_from_ct * p))),
    };
    for p in points_ct {
        let half = if is_distal(p) {
            &mut distal_mm
        } else {
            &mut proximal_mm
        };
        *half = half.min(height(p.cast()));
    }
    [distal_mm, proximal_mm]
}

/// The lowest distal and the lowest proximal point of the placed limb, if there are both.
fn lowest_points(
    points_ct: &[Point3<f32>],
    room_from_ct: Rigid<Room, Ct>,
    table: &Plane,
    is_distal: impl Fn(&Point3<f32>) -> bool,
) -> Option<[Point3<f64>; 2]> {
    let lowest = |distal: bool| {
        points_ct
            .iter()
            .filter(|p| is_distal(p) == distal)
            .map(|p| room_from_ct * p.cast::<f64>())
            .min_by(|a, b| {
                table
                    .signed_distance(a)
                    .total_cmp(&table.signed_distance(b))
            })
    };
    Some([lowest(true)?, lowest(false)?])
}
