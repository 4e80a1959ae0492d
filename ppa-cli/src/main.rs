//! `ppa`: paired depth images and radiographs from CT scans.

use std::process::ExitCode;

fn main() -> ExitCode {
    let arguments: Vec<_> = std::env::args_os().collect();
    // If the system does not provide the path of the executable, the name must do.
    let program = std::env::current_exe().unwrap_or_else(|_| "ppa".into());
    ppa_cli::run_program(&arguments, &program).into()
}
