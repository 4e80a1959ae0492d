//! Integer arguments: values out of range raise an error that states the range.

use pyo3::exceptions::{PyOverflowError, PyValueError};
use pyo3::prelude::*;

/// Largest number of threads.
const MOST_THREADS: usize = 1024;

/// Extracts non-negative integers that fit in `BITS` bits: one, a list of them, or None.
pub fn whole<'py, const BITS: u32, T: FromPyObjectOwned<'py>>(
    object: &Bound<'py, PyAny>,
) -> PyResult<T> {
    let py = object.py();
    object
        .extract()
        .map_err(Into::into)
        .map_err(|error: PyErr| {
            if !error.is_instance_of::<PyOverflowError>(py) {
                return error;
            }
            let most = u64::MAX >> (u64::BITS - BITS);
            match object.repr() {
                Ok(found) => PyValueError::new_err(format!(
                    "found {found}, expected whole numbers from 0 to {most}"
                )),
                Err(error) => error,
            }
        })
}

/// Extracts a number of threads; None means one per core.
pub fn threads_of(object: &Bound<'_, PyAny>) -> PyResult<Option<usize>> {
    let refused = |found: String| {
        PyValueError::new_err(format!(
            "threads is {found}, expected 1 to {MOST_THREADS}, or None for one per core"
        ))
    };
    match object.extract::<Option<usize>>() {
        Ok(Some(found)) if !(1..=MOST_THREADS).contains(&found) => Err(refused(found.to_string())),
        Err(error) if error.is_instance_of::<PyOverflowError>(object.py()) => {
            Err(refused(object.str()?.to_string()))
        }
        found => found,
    }
}
