//! The program `ppa`, run in the Python interpreter.

use std::ffi::OsString;
use std::path::PathBuf;

use pyo3::prelude::*;

/// Run a command line of the program ``ppa``, including its name, and return the exit code.
///
/// Called once per process by the script that the package installs.
#[pyfunction]
pub fn run_program(py: Python<'_>, arguments: Vec<OsString>, program: PathBuf) -> u8 {
    py.detach(|| ppa_cli::run_program(&arguments, &program))
}
