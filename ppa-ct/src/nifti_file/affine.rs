//! Conversion between NIfTI header fields and the affine.

use nalgebra::{Affine3, Matrix3, Matrix4, Quaternion, Rotation3, UnitQuaternion, Vector3};
use nifti::NiftiHeader;

/// Millimetres per unit of the header's world coordinates (`xyzt_units`, lower three bits).
fn mm_per_unit(header: &NiftiHeader) -> f64 {
    match header.xyzt_units & 0b111 {
        1 => 1000.0, // metre
        3 => 1e-3,   // micrometre
        _ => 1.0,
    }
}

/// Converts world axes from RAS to LPS, or back.
fn flip_x_y(matrix: &Matrix4<f64>) -> Matrix4<f64> {
    Matrix4::from_diagonal(&nalgebra::Vector4::new(-1.0, -1.0, 1.0, 1.0)) * matrix
}

/// Voxel-to-LPS affine, and whether the header states an orientation at all.
///
/// The sform takes precedence over the qform, and that over bare spacings (methods 3, 2 and 1 of `nifti1.h`).
pub(super) fn ct_from_voxel(header: &NiftiHeader) -> Result<(Affine3<f64>, bool), String> {
    let ras = if header.sform_code > 0 {
        sform(header)
    } else {
        let spacing = spacing(header)?;
        if header.qform_code > 0 {
            qform(header, spacing)
        } else {
            Matrix3::from_diagonal(&spacing).to_homogeneous()
        }
    };
    let mut scale = Matrix4::identity() * mm_per_unit(header);
    scale[(3, 3)] = 1.0;
    let oriented = header.sform_code > 0 || header.qform_code > 0;
    let lps = Affine3::from_matrix_unchecked(flip_x_y(&(scale * ras)));
    Ok((lps, oriented))
}

fn sform(header: &NiftiHeader) -> Matrix4<f64> {
    let rows = [
        header.srow_x,
        header.srow_y,
        header.srow_z,
        [0.0, 0.0, 0.0, 1.0],
    ];
    Matrix4::from_fn(|row, column| f64::from(rows[row][column]))
}

fn spacing(header: &NiftiHeader) -> Result<Vector3<f64>, String> {
    let spacing = Vector3::from_fn(|axis, _| f64::from(header.pixdim[1 + axis]));
    if spacing.iter().all(|s| *s > 0.0 && s.is_finite()) {
        return Ok(spacing);
    }
    Err(format!(
        "voxel spacing {}, expected positive numbers",
        ppa_core::text::numbers(spacing.iter().copied())
    ))
}

fn qform(header: &NiftiHeader, spacing: Vector3<f64>) -> Matrix4<f64> {
    let bcd = Vector3::new(header.quatern_b, header.quatern_c, header.quatern_d).map(f64::from);
    // a is not stored; if rounding leaves nothing for it, the rotation is by 180 degrees.
    let a = (1.0 - bcd.norm_squared()).max(0.0).sqrt();
    let turn = UnitQuaternion::new_normalize(Quaternion::from_parts(a, bcd));
    let qfac = if header.pixdim[0] < 0.0 { -1.0 } else { 1.0 };
    let scale = Matrix3::from_diagonal(&Vector3::new(spacing.x, spacing.y, spacing.z * qfac));
    let mut matrix = (turn.to_rotation_matrix().into_inner() * scale).to_homogeneous();
    let shift = [header.quatern_x, header.quatern_y, header.quatern_z];
    for (row, v) in shift.into_iter().enumerate() {
        matrix[(row, 3)] = f64::from(v);
    }
    matrix
}

/// Writes the affine to the sform, and to the qform if that can represent it (no shear).
pub(super) fn set_affine(header: &mut NiftiHeader, ct_from_voxel: &Affine3<f64>) {
    /// Code of scanner coordinates.
    const SCANNER: i16 = 1;
    let ras = flip_x_y(ct_from_voxel.matrix());
    let row = |row: usize| [0, 1, 2, 3].map(|column| ras[(row, column)] as f32);
    header.sform_code = SCANNER;
    [header.srow_x, header.srow_y, header.srow_z] = [row(0), row(1), row(2)];

    let linear = ras.fixed_view::<3, 3>(0, 0).into_owned();
    let spacing = Vector3::from_fn(|axis, _| linear.column(axis).norm());
    let qfac = linear.determinant().signum();
    header.pixdim[0] = qfac as f32;
    for axis in 0..3 {
        header.pixdim[1 + axis] = spacing[axis] as f32;
    }
    let axes = linear * Matrix3::from_diagonal(&spacing.map(f64::recip));
    let sheared = (axes.tr_mul(&axes) - Matrix3::identity()).amax() > 1e-6;
    header.qform_code = if sheared { 0 } else { SCANNER };
    if sheared {
        return;
    }
    let proper = axes * Matrix3::from_diagonal(&Vector3::new(1.0, 1.0, qfac));
    let turn = UnitQuaternion::from_rotation_matrix(&Rotation3::from_matrix_unchecked(proper));
    // Both signs are the same rotation; the format requires a >= 0.
    let turn = if turn.w < 0.0 { -*turn } else { *turn };
    [header.quatern_b, header.quatern_c, header.quatern_d] =
        [turn.i as f32, turn.j as f32, turn.k as f32];
    [header.quatern_x, header.quatern_y, header.quatern_z] =
        [0, 1, 2].map(|row| ras[(row, 3)] as f32);
}
