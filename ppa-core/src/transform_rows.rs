//! Rigid transforms as rows of numbers in files.

/// A rigid transform as stored in files: the rows of its 4 x 4 matrix, the last of them `0 0 0 1`, lengths in mm.
pub type TransformRows = [[f64; 4]; 4];

/// Largest deviation of RᵀR from the identity that is accepted as rounding in a file.
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
        /// Largest accepted deviation.
        limit: f64,
    },
    /// The upper left block is a reflection.
    #[error("the 4x4 matrix is a reflection (determinant −1), expected a rotation")]
    Mirror,
}

/// Checks that rows form a rigid motion; accepts rounding up to 1e-4 in RᵀR, as of matrices printed with five decimals.
///
/// # Errors
/// [`RigidError`] names the entry or the deviation.
pub fn check_rigid(rows: &TransformRows) -> Result<(), RigidError> {
    for (row, entries) in rows.iter().enumerate() {
        if let Some(column) = entries.iter().position(|entry| !entry.is_finite()) {
            return Err(RigidError::NotFinite {
                row,
                column,
                found: entries[column],
            });
        }
    }
    let [x, y, z, last] = *rows;
    let expected = [0.0, 0.0, 0.0, 1.0];
    if last
        .iter()
        .zip(expected)
        .any(|(found, expected)| (found - expected).abs() > 1e-9)
    {
        return Err(RigidError::LastRow { found: last });
    }
    let product = |a: usize, b: usize| x[a] * x[b] + y[a] * y[b] + z[a] * z[b];
    let deviation = (0..9)
        .map(|n| (n / 3, n % 3))
        .map(|(a, b)| (product(a, b) - f64::from(u8::from(a == b))).abs())
        .fold(0.0, f64::max);
    if deviation > ORTHOGONALITY {
        return Err(RigidError::NotOrthonormal {
            deviation,
            limit: ORTHOGONALITY,
        });
    }
    let minor = |a: usize, b: usize| y[a] * z[b] - y[b] * z[a];
    if x[0] * minor(1, 2) - x[1] * minor(0, 2) + x[2] * minor(0, 1) < 0.0 {
        return Err(RigidError::Mirror);
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A third of a turn about (1, 1, 1), then a translation.
    const TURNED: TransformRows = [
        [0.0, 0.0, 1.0, 10.0],
        [1.0, 0.0, 0.0, -20.0],
        [0.0, 1.0, 0.0, 30.0],
        [0.0, 0.0, 0.0, 1.0],
    ];

    #[test]
    fn matrices_that_are_not_rigid_are_refused() {
        let with = |row: usize, column: usize, value: f64| {
            let mut rows = TURNED;
            rows[row][column] = value;
            check_rigid(&rows)
        };
        assert_eq!(check_rigid(&TURNED), Ok(()));
        assert_eq!(with(0, 2, 1.00004), Ok(()));
        assert!(matches!(
            with(0, 2, 1.01),
            Err(RigidError::NotOrthonormal { .. })
        ));
        assert_eq!(with(0, 2, -1.0), Err(RigidError::Mirror));
        assert!(matches!(
            with(1, 3, f64::NAN),
            Err(RigidError::NotFinite {
                row: 1,
                column: 3,
                ..
            })
        ));
        let transposed = std::array::from_fn(|row| TURNED.map(|entries| entries[row]));
        assert!(matches!(
            check_rigid(&transposed),
            Err(RigidError::LastRow { .. })
        ));
    }
}
