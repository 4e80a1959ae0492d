//! T_mat: the axes of the table and of the plane under the limb, and the point of the beam above the table.

use nalgebra::{Matrix3, Point3, Rotation3, UnitQuaternion, Vector3};

use crate::placement::error::PlaceError;
use crate::room::device::XrayDevice;
use crate::room::plane::Plane;

/// Columns x, y, z: across the table, towards the head end, up; in the room.
pub(crate) fn table_axes(table: &Plane, device: &XrayDevice) -> Result<Matrix3<f64>, PlaceError> {
    let up = table.normal.into_inner();
    let head = device.head_direction();
    let y = (head - up * up.dot(&head))
        .try_normalize(1e-6)
        .ok_or(PlaceError::BeamMissesTable)?;
    Ok(Matrix3::from_columns(&[y.cross(&up), y, up]))
}

/// The same triad of the plane under the limb, in the patient frame: y along the limb's axis.
pub(crate) fn plane_axes(under_limb: &Plane) -> Matrix3<f64> {
    let up = under_limb.normal.into_inner();
    let y = (Vector3::z() - up * up.z).normalize();
    Matrix3::from_columns(&[y.cross(&up), y, up])
}

/// The rotation that takes one triad to another.
pub(crate) fn axes_rotation(to: &Matrix3<f64>, from: &Matrix3<f64>) -> UnitQuaternion<f64> {
    let matrix = Rotation3::from_matrix_unchecked(to * from.transpose());
    UnitQuaternion::from_rotation_matrix(&matrix)
}

/// The point of the central beam at a height above the table.
pub(crate) fn on_beam(
    height_mm: f64,
    table: &Plane,
    device: &XrayDevice,
) -> Result<Point3<f64>, PlaceError> {
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
