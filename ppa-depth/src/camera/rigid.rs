//! Rigid motions as rows of a 4x4 matrix, the way files hold them.

use nalgebra::{Isometry3, Matrix3, Rotation3, Translation3, UnitQuaternion};

/// Largest deviation of RᵀR from the identity that is read as rounding in a file.
const ORTHOGONALITY: f64 = 1e-4;

/// Why a 4x4 matrix is not a rigid motion.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum RigidError {
    /// An entry is infinite or NaN.
    #[error("entry ({row}, {column}) of the 4x4 matrix is {found}, expected a finite number")]
    NotFinite {
        /// Row, from 0.
        row: usize,
        /// Column, from 0.
        column: usize,
        /// The value.
        found: f64,
    },
    /// The last row is not 0 0 0 1 (a transposed matrix has its translation there).
    #[error(
        "last row of the 4x4 matrix is {found:?}, expected [0, 0, 0, 1] (row-major, translation in the last column)"
    )]
    LastRow {
        /// The row.
        found: [f64; 4],
    },
    /// Scale or shear: the upper left block is not a rotation.
    #[error(
        "the 4x4 matrix is not rigid: its axes deviate from orthonormal by {deviation:.2e}, expected below {limit:.0e}"
    )]
    NotOrthonormal {
        /// Largest entry of |RᵀR − 1|.
        deviation: f64,
        /// What is accepted.
        limit: f64,
    },
    /// The upper left block mirrors.
    #[error("the 4x4 matrix mirrors (determinant −1), expected a rotation")]
    Mirror,
}

/// A rigid motion from row-major rows, translation (mm) in the last column.
///
/// Rounding in the file (up to 1e-4 in RᵀR) is removed: the rotation is the nearest one.
///
/// # Errors
/// [`RigidError`] names the entry or the deviation.
pub fn isometry_from_rows(rows: &[[f64; 4]; 4]) -> Result<Isometry3<f64>, RigidError> {
    for (row, entries) in rows.iter().enumerate() {
        if let Some(column) = entries.iter().position(|entry| !entry.is_finite()) {
            return Err(RigidError::NotFinite {
                row,
                column,
                found: entries[column],
            });
        }
    }
    let expected = [0.0, 0.0, 0.0, 1.0];
    if rows[3]
        .iter()
        .zip(expected)
        .any(|(found, expected)| (found - expected).abs() > 1e-9)
    {
        return Err(RigidError::LastRow { found: rows[3] });
    }
    let block = Matrix3::from_fn(|row, column| rows[row][column]);
    let deviation = (block.transpose() * block - Matrix3::identity()).amax();
    if deviation > ORTHOGONALITY {
        return Err(RigidError::NotOrthonormal {
            deviation,
            limit: ORTHOGONALITY,
        });
    }
    if block.determinant() < 0.0 {
        return Err(RigidError::Mirror);
    }
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
pub fn rows_from_isometry(motion: &Isometry3<f64>) -> [[f64; 4]; 4] {
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
    fn rounding_is_removed_and_anything_worse_is_refused() {
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

        let mut scaled = exact;
        scaled[0][0] *= 1.01;
        assert!(matches!(
            isometry_from_rows(&scaled),
            Err(RigidError::NotOrthonormal { .. })
        ));
        let transposed =
            std::array::from_fn(|row| std::array::from_fn(|column| exact[column][row]));
        assert!(matches!(
            isometry_from_rows(&transposed),
            Err(RigidError::LastRow { .. })
        ));
        let mirrored = exact.map(|[x, y, z, t]| [-x, y, z, t]);
        assert_eq!(isometry_from_rows(&mirrored), Err(RigidError::Mirror));
        let mut broken = exact;
        broken[1][3] = f64::NAN;
        assert!(matches!(
            isometry_from_rows(&broken),
            Err(RigidError::NotFinite {
                row: 1,
                column: 3,
                ..
            })
        ));
    }
}
