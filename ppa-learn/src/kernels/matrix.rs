//! Matrix products by the gemm crate, with checked shapes.
#![allow(unsafe_code)]

/// A matrix in row-major order, or its transpose.
#[derive(Clone, Copy)]
pub struct Matrix<'a> {
    values: &'a [f32],
    rows: usize,
    columns: usize,
    transposed: bool,
}

impl<'a> Matrix<'a> {
    /// Makes a matrix from `values` in rows of `columns`.
    pub fn new(values: &'a [f32], columns: usize) -> Self {
        assert!(values.len().is_multiple_of(columns));
        Self {
            values,
            rows: values.len() / columns,
            columns,
            transposed: false,
        }
    }

    pub fn transposed(self) -> Self {
        Self {
            rows: self.columns,
            columns: self.rows,
            transposed: !self.transposed,
            ..self
        }
    }

    /// Returns the strides to the next column and to the next row.
    fn strides(&self) -> (isize, isize) {
        if self.transposed {
            (self.rows as isize, 1)
        } else {
            (1, self.columns as isize)
        }
    }
}

/// Whether a product replaces the output or is added to it.
#[derive(Clone, Copy, PartialEq, Eq)]
pub enum Store {
    Replace,
    Add,
}

/// `out` [left.rows, right.columns] = left * right, or += it.
///
/// # Panics
/// If the shapes do not fit.
pub fn multiply(out: &mut [f32], left: Matrix, right: Matrix, store: Store) {
    assert_eq!(left.columns, right.rows, "inner sizes of a product");
    assert_eq!(out.len(), left.rows * right.columns, "size of a product");
    let (left_column, left_row) = left.strides();
    let (right_column, right_row) = right.strides();
    // SAFETY: `Matrix` holds rows * columns values and the asserts above bind the sizes to one another, so that every
    // offset i * row stride + j * column stride within the sizes given lies in its slice; `out` is borrowed alone.
    unsafe {
        gemm::gemm(
            left.rows,
            right.columns,
            left.columns,
            out.as_mut_ptr(),
            1,
            right.columns as isize,
            store == Store::Add,
            left.values.as_ptr(),
            left_column,
            left_row,
            right.values.as_ptr(),
            right_column,
            right_row,
            1.0,
            1.0,
            false,
            false,
            false,
            gemm::Parallelism::None,
        );
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn products_are_those_of_the_definition(
            (m, n, k) in (1_usize..40, 1_usize..40, 1_usize..40),
            flip in any::<(bool, bool)>(),
            seed in 0_u32..1000,
        ) {
            let value = |i: usize| ((i as u32 * 7919 + seed * 31) % 17) as f32 - 8.0;
            let left: Vec<f32> = (0..m * k).map(value).collect();
            let right: Vec<f32> = (0..k * n).map(value).collect();
            let flipped = |values: &[f32], rows: usize, columns: usize| -> Vec<f32> {
                (0..rows * columns).map(|i| values[i % rows * columns + i / rows]).collect()
            };
            let (left_flipped, right_flipped) = (flipped(&left, m, k), flipped(&right, k, n));
            let left_matrix = if flip.0 { Matrix::new(&left_flipped, m).transposed() } else { Matrix::new(&left, k) };
            let right_matrix = if flip.1 { Matrix::new(&right_flipped, k).transposed() } else { Matrix::new(&right, n) };
            let expected: Vec<f32> = (0..m * n)
                .map(|i| (0..k).map(|j| left[i / n * k + j] * right[j * n + i % n]).sum())
                .collect();
            let mut out = vec![1.0; m * n];
            multiply(&mut out, left_matrix, right_matrix, Store::Replace);
            prop_assert_eq!(&out, &expected); // whole numbers below 2^24: exact
            multiply(&mut out, left_matrix, right_matrix, Store::Add);
            prop_assert!(out.iter().zip(&expected).all(|(out, one)| *out == 2.0 * one));
        }
    }
}
