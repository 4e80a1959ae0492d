//! `ppa`: CT scans in, paired depth images and radiographs out.

use std::process::ExitCode;

fn main() -> ExitCode {
    let arguments: Vec<_> = std::env::args_os().collect();
    // Where the system does not say which file runs, the name under which it was started has to do.
    let program = std::env::current_exe().unwrap_or_else(|_| "ppa".into());
    ppa_cli::run_program(&arguments, &program).into()
}
