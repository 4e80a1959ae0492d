//! Coordinate frames as types, and rigid motions that only compose when their frames meet.

use std::fmt;
use std::marker::PhantomData;
use std::ops::Mul;

use nalgebra::{Isometry3, Matrix3, Point3, Rotation3, Translation3, UnitQuaternion, Vector3};
use ppa_core::{RigidError, TransformRows, check_rigid};
use serde::{Deserialize, Serialize};

/// Patient world of the scan: DICOM LPS, mm.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Ct;

/// Limb frame P: x to the patient's right, y anterior, z along the limb towards proximal.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Patient;

/// X-ray device: source at the origin, z along the central beam towards the detector.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Device;

/// X-ray room (the paper's ToF frame): z up, y towards the head, origin where the central beam meets the table.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Room;

/// A depth camera, OpenCV axes: x right, y down, z forward.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Camera;

/// Rigid motion that takes coordinates in `From` to coordinates in `To`; millimetres.
///
/// Values are named `target_from_source`, so that products read as chains, and a product whose
/// inner frames differ does not compile:
///
/// ```
/// # use ppa_scene::{Rigid, Room, Patient, Ct};
/// # let (room_from_patient, patient_from_ct): (Rigid<Room, Patient>, Rigid<Patient, Ct>) =
/// #     (Rigid::identity(), Rigid::identity());
/// let room_from_ct: Rigid<Room, Ct> = room_from_patient * patient_from_ct;
/// ```
///
/// ```compile_fail
/// # use ppa_scene::{Rigid, Room, Patient, Ct};
/// # let (room_from_patient, patient_from_ct): (Rigid<Room, Patient>, Rigid<Patient, Ct>) =
/// #     (Rigid::identity(), Rigid::identity());
/// let swapped = patient_from_ct * room_from_patient;
/// ```
///
/// In files it is a row-major 4x4 matrix.
#[derive(Serialize, Deserialize)]
#[serde(try_from = "TransformRows", into = "TransformRows", bound = "")]
pub struct Rigid<To, From> {
    isometry: Isometry3<f64>,
    frames: PhantomData<fn(From) -> To>,
}

// Written out because a derive would ask the frames, which are only names, for the same traits.
impl<To, From> Clone for Rigid<To, From> {
    fn clone(&self) -> Self {
        *self
    }
}

impl<To, From> Copy for Rigid<To, From> {}

impl<To, From> PartialEq for Rigid<To, From> {
    fn eq(&self, other: &Self) -> bool {
        self.isometry == other.isometry
    }
}

impl<To, From> fmt::Debug for Rigid<To, From> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_tuple("Rigid").field(&self.isometry).finish()
    }
}

impl<To, From> Rigid<To, From> {
    /// Assigns frames to an isometry.
    pub fn new(isometry: Isometry3<f64>) -> Self {
        Self {
            isometry,
            frames: PhantomData,
        }
    }

    /// The identity: both frames coincide.
    pub fn identity() -> Self {
        Self::new(Isometry3::identity())
    }

    /// A motion from the axes of `From` written in `To` (columns) and its origin in `To`.
    ///
    /// `axes` must be a rotation to rounding error.
    pub(crate) fn from_axes(axes: Matrix3<f64>, origin: Point3<f64>) -> Self {
        let rotation =
            UnitQuaternion::from_rotation_matrix(&Rotation3::from_matrix_unchecked(axes));
        Self::new(Isometry3::from_parts(
            Translation3::from(origin),
            UnitQuaternion::new_normalize(rotation.into_inner()),
        ))
    }

    /// The inverse motion.
    pub fn inverse(&self) -> Rigid<From, To> {
        Rigid::new(self.isometry.inverse())
    }

    /// The plain nalgebra isometry, for crates that do not know these frames.
    pub fn isometry(&self) -> &Isometry3<f64> {
        &self.isometry
    }

    /// Rotates a direction; the translation has no effect.
    pub fn rotate(&self, direction: &Vector3<f64>) -> Vector3<f64> {
        self.isometry.rotation * direction
    }

    /// Row-major homogeneous 4x4 matrix, mm, as stored in manifests.
    pub fn to_homogeneous_rows(&self) -> TransformRows {
        let matrix = self.isometry.to_homogeneous();
        std::array::from_fn(|row| std::array::from_fn(|column| matrix[(row, column)]))
    }
}

impl<To, From> TryFrom<TransformRows> for Rigid<To, From> {
    type Error = RigidError;

    /// Removes the rounding that [`check_rigid`] accepts: takes the nearest rotation.
    fn try_from(rows: TransformRows) -> Result<Self, RigidError> {
        check_rigid(&rows)?;
        let linear = Matrix3::from_fn(|row, column| rows[row][column]);
        let origin = Point3::new(rows[0][3], rows[1][3], rows[2][3]);
        // Nearest in the Frobenius norm: the orthogonal factor of the polar decomposition, U Vᵀ.
        let factors = linear.svd(true, true);
        let (Some(u), Some(v_t)) = (factors.u, factors.v_t) else {
            unreachable!("both factors were asked for");
        };
        Ok(Self::from_axes(u * v_t, origin))
    }
}

impl<To, From> std::convert::From<Rigid<To, From>> for TransformRows {
    fn from(rigid: Rigid<To, From>) -> Self {
        rigid.to_homogeneous_rows()
    }
}

impl<A, B, C> Mul<Rigid<B, C>> for Rigid<A, B> {
    type Output = Rigid<A, C>;

    fn mul(self, rhs: Rigid<B, C>) -> Rigid<A, C> {
        Rigid::new(self.isometry * rhs.isometry)
    }
}

impl<To, From> Mul<Point3<f64>> for Rigid<To, From> {
    type Output = Point3<f64>;

    fn mul(self, point: Point3<f64>) -> Point3<f64> {
        self.isometry * point
    }
}
