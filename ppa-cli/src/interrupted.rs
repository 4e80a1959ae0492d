//! The error of a command that was stopped by a signal.

use std::fmt;

/// Offset that a shell adds to a signal's number in an exit status.
pub const BY_SIGNAL: i32 = 128;

/// A command was stopped by a signal.
#[derive(Debug)]
pub struct Interrupted {
    pub signal: i32,
    /// What is kept, and how to resume.
    pub how: String,
}

impl Interrupted {
    /// Exit code of the program: 130 after Ctrl-C, 143 after TERM.
    pub fn exit_code(&self) -> u8 {
        u8::try_from(BY_SIGNAL + self.signal).unwrap_or(1)
    }
}

impl fmt::Display for Interrupted {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "stopped {}", self.how)
    }
}

impl std::error::Error for Interrupted {}
