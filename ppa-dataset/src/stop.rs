//! Long-running work that ends early on request.

use std::sync::atomic::{AtomicBool, Ordering};

/// Work was asked to stop and did so before its next step. What was finished before stays.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
#[error("stopped on request")]
pub struct Stopped;

/// Fails once `stop` is true.
pub fn go_on(stop: &AtomicBool) -> Result<(), Stopped> {
    match stop.load(Ordering::Relaxed) {
        true => Err(Stopped),
        false => Ok(()),
    }
}
