//! Laying a rotated limb on the table under the central beam: T_rot, T_mat and T_opt.

use nalgebra::{
    Isometry3, Matrix3, Point3, Rotation3, Translation3, Unit, UnitQuaternion, Vector3,
};
use serde::{Deserialize, Serialize};

use crate::contact::{Profile, Tilt, split_level};
use crate::device::XrayDevice;
use crate::frames::{Ct, Device, Patient, Rigid};
use crate::landmarks::{Landmarks, Side};
use crate::plane::Plane;
use crate::room::Room;

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
    /// places, and moves it onto the table.
    pub t_opt: Rigid<Room, Room>,
    /// How it rests.
    pub contact: Contact,
}

/// How a placed limb rests on the table plane; measured on the placed points.
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
    /// Where distal ends and proximal begins, along z of the patient frame, mm.
    pub split_mm: f64,
    /// Tilt found by T_opt, radians; + lifts the proximal end.
    pub tilt_rad: f64,
    /// How often the closest points were looked for.
    pub iterations: u32,
}

/// Why a limb cannot be placed.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum PlaceError {
    /// Nothing to place.
    #[error("the limb has {found} points, expected at least 3")]
    TooFewPoints {
        /// Points given.
        found: usize,
    },
    /// A coordinate is NaN or infinite.
    #[error("point {index} of the limb is not finite")]
    NotFinite {
        /// Its index.
        index: usize,
    },
    /// The rotation angle is NaN or infinite.
    #[error("the rotation angle is {0}, expected a finite number of radians")]
    Angle(f64),
    /// Axis, anterior direction or plane points do not span what they should.
    #[error("{0}")]
    Landmarks(&'static str),
    /// The beam runs along the table or away from it.
    #[error("the central beam does not meet the table plane in front of the source")]
    BeamMissesTable,
    /// The limb does not fit between table and source.
    #[error("the joint would lie {height_mm:.1} mm above the table, not below the x-ray source")]
    AboveSource {
        /// Height of the joint.
        height_mm: f64,
    },
    /// No tilt lets both ends rest.
    #[error(
        "tipping the limb by up to 60 degrees brings its ends no closer than the table: distal \
         end {distal_mm:.2} mm, proximal end {proximal_mm:.2} mm above the lowest point"
    )]
    NoRest {
        /// Height of the lowest distal point above the lowest point, untipped.
        distal_mm: f64,
        /// Height of the lowest proximal point above the lowest point, untipped.
        proximal_mm: f64,
    },
}

/// T_rot: turns the limb about its axis, the front of the limb towards the body's midline.
///
/// The front (+y of the patient frame) of a right limb turns towards −x, the patient's left; that
/// of a left limb towards +x.
pub fn medial_rotation(side: Side, angle_rad: f64) -> Rigid<Patient, Patient> {
    let about_z = match side {
        Side::Right => angle_rad,
        Side::Left => -angle_rad,
    };
    let rotation = UnitQuaternion::from_axis_angle(&Vector3::z_axis(), about_z);
    Rigid::new(Isometry3::from_parts(Translation3::identity(), rotation))
}

/// Places a limb, given by the vertices of its skin in the `ct` frame.
///
/// `table` faces the source. The limb is split into front (distal) and back (proximal) at the
/// joint; a limb that has less than a tenth of its length on one side of the joint (a knee, a
/// calf) is split at the middle of its length instead.
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
    check_points(points_ct)?;
    if !angle_rad.is_finite() {
        return Err(PlaceError::Angle(angle_rad));
    }
    let patient_from_ct = landmarks.patient_from_ct();
    let under_limb = landmarks.plane_patient();
    let finite = |v: &Vector3<f64>| v.iter().all(|c| c.is_finite());
    if !finite(&patient_from_ct.isometry().rotation.scaled_axis()) {
        return Err(PlaceError::Landmarks(
            "the anterior direction runs along the limb's axis, expected one across it",
        ));
    }
    if !finite(&under_limb.normal) || under_limb.normal.z.abs() > 0.9 {
        return Err(PlaceError::Landmarks(
            "the three plane points give no plane along the limb",
        ));
    }
    let t_rot = medial_rotation(landmarks.side, angle_rad);
    let (room_axes, limb_axes) = (table_axes(table, device)?, plane_axes(&under_limb));
    let rotation = axes_rotation(&room_axes, &limb_axes);

    // Heights and lengths about the joint centre, in table axes.
    let table_from_ct = limb_axes.transpose()
        * (t_rot * patient_from_ct)
            .isometry()
            .rotation
            .to_rotation_matrix()
            .matrix();
    let joint_ct = Point3::from(landmarks.joint_centre);
    let axis_ct = patient_from_ct.inverse().rotate(&Vector3::z());
    let (profile, split_mm) = halves(points_ct, &joint_ct, &axis_ct, &table_from_ct);
    let Tilt {
        angle_rad: tilt_rad,
        iterations,
    } = profile.resting_tilt().ok_or_else(|| {
        let [distal, proximal] = profile.heights(0.0);
        let low = distal.min(proximal);
        PlaceError::NoRest {
            distal_mm: distal - low,
            proximal_mm: proximal - low,
        }
    })?;
    let [distal, proximal] = profile.heights(tilt_rad);
    let lowest = distal.min(proximal);

    let matched_joint = on_beam(-under_limb.offset_mm, table, device)?;
    let placed_joint = on_beam(-lowest, table, device)?;
    let t_mat = Rigid::new(Isometry3::from_parts(matched_joint.into(), rotation));
    let room_x = Unit::new_unchecked(room_axes.column(0).into_owned());
    let tilt = UnitQuaternion::from_axis_angle(&room_x, tilt_rad);
    let t_opt = Rigid::new(
        Translation3::from(placed_joint) * tilt * Translation3::from(matched_joint).inverse(),
    );
    let room_from_patient = t_opt * t_mat * t_rot;
    let contact = Contact {
        split_mm,
        tilt_rad,
        iterations,
        ..measure(
            points_ct,
            room_from_patient * patient_from_ct,
            &axis_ct,
            table,
            |along| along - axis_ct.dot(&joint_ct.coords) < split_mm,
        )
    };
    Ok(Placement {
        room_from_patient,
        t_rot,
        t_mat,
        t_opt,
        contact,
    })
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

fn check_points(points: &[Point3<f32>]) -> Result<(), PlaceError> {
    if points.len() < 3 {
        return Err(PlaceError::TooFewPoints {
            found: points.len(),
        });
    }
    match points.iter().position(|p| !p.iter().all(|c| c.is_finite())) {
        Some(index) => Err(PlaceError::NotFinite { index }),
        None => Ok(()),
    }
}

/// Columns x, y, z: across the table, towards the head end, up; in the room.
fn table_axes(table: &Plane, device: &XrayDevice) -> Result<Matrix3<f64>, PlaceError> {
    let up = table.normal.into_inner();
    let head = device.head_direction();
    let y = (head - up * up.dot(&head))
        .try_normalize(1e-6)
        .ok_or(PlaceError::BeamMissesTable)?;
    Ok(Matrix3::from_columns(&[y.cross(&up), y, up]))
}

/// The same triad of the plane under the limb, in the patient frame: y along the limb's axis.
fn plane_axes(under_limb: &Plane) -> Matrix3<f64> {
    let up = under_limb.normal.into_inner();
    let y = (Vector3::z() - up * up.z).normalize();
    Matrix3::from_columns(&[y.cross(&up), y, up])
}

/// The rotation that takes one triad to another.
fn axes_rotation(to: &Matrix3<f64>, from: &Matrix3<f64>) -> UnitQuaternion<f64> {
    let matrix = Rotation3::from_matrix_unchecked(to * from.transpose());
    UnitQuaternion::from_rotation_matrix(&matrix)
}

/// The point of the central beam at a height above the table.
fn on_beam(height_mm: f64, table: &Plane, device: &XrayDevice) -> Result<Point3<f64>, PlaceError> {
    let (source, beam) = (device.source(), device.beam_direction());
    if table.normal.dot(&beam) >= 0.0 || table.hit(&source, &beam).is_none() {
        return Err(PlaceError::BeamMissesTable);
    }
    let raised = Plane {
        offset_mm: table.offset_mm + height_mm,
        ..*table
    };
    raised
        .hit(&source, &beam)
        .ok_or(PlaceError::AboveSource { height_mm })
}

/// The two halves in table axes about the joint centre, and where they were split.
fn halves(
    points_ct: &[Point3<f32>],
    joint_ct: &Point3<f64>,
    axis_ct: &Vector3<f64>,
    table_from_ct: &Matrix3<f64>,
) -> (Profile, f64) {
    let along = |p: &Point3<f32>| (p.cast::<f64>() - joint_ct).dot(axis_ct);
    let split_mm = split_level(points_ct.iter().map(along));
    let mut profile = Profile {
        distal: Vec::new(),
        proximal: Vec::new(),
    };
    for p in points_ct {
        let offset = p.cast::<f64>() - joint_ct;
        let seen = table_from_ct * offset;
        if along(p) < split_mm {
            profile.distal.push([seen.y, seen.z]);
        } else {
            profile.proximal.push([seen.y, seen.z]);
        }
    }
    (profile, split_mm)
}

/// Heights of the placed points above the table.
fn measure(
    points_ct: &[Point3<f32>],
    room_from_ct: Rigid<Room, Ct>,
    axis_ct: &Vector3<f64>,
    table: &Plane,
    is_distal: impl Fn(f64) -> bool,
) -> Contact {
    let (mut distal_mm, mut proximal_mm) = (f64::INFINITY, f64::INFINITY);
    for p in points_ct {
        let p = p.cast::<f64>();
        let height = table.signed_distance(&(room_from_ct * p));
        let half = if is_distal(axis_ct.dot(&p.coords)) {
            &mut distal_mm
        } else {
            &mut proximal_mm
        };
        *half = half.min(height);
    }
    let lowest = distal_mm.min(proximal_mm);
    Contact {
        gap_mm: lowest.max(0.0),
        penetration_mm: (-lowest).max(0.0),
        distal_mm,
        proximal_mm,
        split_mm: 0.0,
        tilt_rad: 0.0,
        iterations: 0,
    }
}
