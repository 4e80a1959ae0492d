//! Long-running work that ends early on request.

use std::sync::atomic::{AtomicBool, Ordering};

/// The work stopped on request before its next step. Finished steps are kept.
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
