//! Progress of long calls: a function or a progress bar.

use pyo3::prelude::*;
use pyo3::types::PyBool;

/// The function to call with done and total: the given one, a tqdm progress bar for True, none for False and None.
pub fn observer<'py>(
    py: Python<'py>,
    progress: Option<&Bound<'py, PyAny>>,
) -> PyResult<Option<Bound<'py, PyAny>>> {
    match progress {
        Some(asked) if asked.is_instance_of::<PyBool>() => match asked.extract()? {
            true => Ok(Some(py.import("ppa._progress")?.call_method0("bar")?)),
            false => Ok(None),
        },
        given => Ok(given.cloned()),
    }
}
