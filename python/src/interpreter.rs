//! Only one interpreter per process is supported: the threads and caches of the module belong to it.

use std::sync::atomic::{AtomicI64, Ordering};

use pyo3::exceptions::PyImportError;
use pyo3::{PyResult, Python, ffi};

/// An ID that no interpreter has.
const NONE: i64 = -1;

/// Refuses every interpreter except the first that imports the module. Python 3.12 and later do this themselves.
#[allow(unsafe_code)]
pub fn require_first(_: Python<'_>) -> PyResult<()> {
    static FIRST: AtomicI64 = AtomicI64::new(NONE);
    // SAFETY: this thread is attached to an interpreter, as both functions require.
    let id = unsafe { ffi::PyInterpreterState_GetID(ffi::PyInterpreterState_Get()) };
    match FIRST.compare_exchange(NONE, id, Ordering::Relaxed, Ordering::Relaxed) {
        Ok(_) => Ok(()),
        Err(first) if first == id => Ok(()),
        Err(_) => Err(PyImportError::new_err(
            "ppa was imported by another interpreter of this process, and works in one interpreter only",
        )),
    }
}
