//! Rigid motions as rows of a 4x4 matrix, as stored in files.

use nalgebra::{Isometry3, Matrix3, Rotation3, Translation3, UnitQuaternion};
use ppa_core::{RigidError, TransformRows, check_rigid};

/// A rigid motion from row-major rows, translation (mm) in the last column.
///
/// Rounding in the file (up to 1e-4 in RᵀR) is removed: the rotation is the nearest one.
///
/// # Errors
/// [`RigidError`] names the entry or the deviation.
pub fn isometry_from_rows(rows: &TransformRows) -> Result<Isometry3<f64>, RigidError> {
    check_rigid(rows)?;
    let block = Matrix3::from_fn(|row, column| rows[row][column]);
    // Nearest rotation in the Frobenius norm: the orthogonal factor of the polar decomposition, U Vᵀ.
    let factors = block.svd(true, true);
    let (Some(u), Some(v_t)) = (factors.u, factors.v_t) else {
        unreachable!("both factors were asked for");
    };
    let nearest = Rotation3::from_matrix_unchecked(u * v_t);
    let rotation = UnitQuaternion::from_rotation_matrix(&nearest).into_inner();
    let translation = Translation3::new(rows[0][3], rows[1][3], rows[2][3]);
    Ok(Isometry3::from_parts(
        translation,
        UnitQuaternion::new_normalize(rotation),
    ))
}

/// Row-major rows of a rigid motion, translation (mm) in the last column.
pub fn rows_from_isometry(motion: &Isometry3<f64>) -> TransformRows {
    let matrix = motion.to_homogeneous();
    std::array::from_fn(|row| std::array::from_fn(|column| matrix[(row, column)]))
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::Vector3;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn rows_hold_the_motion(t in prop::array::uniform3(-2e3..2e3_f64), r in prop::array::uniform3(-3.0..3.0_f64)) {
            let motion = Isometry3::new(Vector3::from(t), Vector3::from(r));
            let back = isometry_from_rows(&rows_from_isometry(&motion)).unwrap();
            prop_assert!((back.to_homogeneous() - motion.to_homogeneous()).amax() < 1e-9);
        }
    }

    #[test]
    fn rounding_in_the_rows_is_removed() {
        let motion = Isometry3::new(
            Vector3::new(10.0, -20.0, 30.0),
            Vector3::new(0.3, -0.8, 1.1),
        );
        let exact = rows_from_isometry(&motion);
        let rounded = exact.map(|row| row.map(|entry| (entry * 1e5).round() / 1e5));
        let rotation = isometry_from_rows(&rounded)
            .unwrap()
            .rotation
            .to_rotation_matrix();
        let matrix = rotation.matrix();
        assert!((matrix.transpose() * matrix - Matrix3::identity()).amax() < 1e-14);
        assert!(rotation.angle_to(&motion.rotation.to_rotation_matrix()) < 2e-5);
    }
}
