//! Sides of the body.

use ppa_core::Side;
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;

/// Parses a side.
pub fn side(text: &str) -> PyResult<Side> {
    match text {
        "l" | "left" => Ok(Side::Left),
        "r" | "right" => Ok(Side::Right),
        _ => Err(PyValueError::new_err(format!(
            "side is {text:?}, expected \"l\" or \"r\""
        ))),
    }
}

/// The letter for a side.
pub fn letter(side: Side) -> &'static str {
    match side {
        Side::Left => "l",
        Side::Right => "r",
    }
}
