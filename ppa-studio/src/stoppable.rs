//! Work cancelled by a flag: of several requests, only the newest continues.

use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex, PoisonError};

/// One kind of work, cancelled by a flag.
#[derive(Default)]
pub(crate) struct Stoppable(Mutex<Arc<AtomicBool>>);

impl Stoppable {
    /// Ends the current work and returns the flag for the next.
    pub fn begin(&self) -> Arc<AtomicBool> {
        let mut flag = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        flag.store(true, Ordering::Relaxed);
        *flag = Arc::default();
        flag.clone()
    }

    /// Ends the current work.
    pub fn stop(&self) {
        self.begin();
    }
}

/// Ends the work of a request when nobody waits for its answer any more.
pub(crate) struct StopOnDrop(pub Arc<AtomicBool>);

impl Drop for StopOnDrop {
    fn drop(&mut self) {
        self.0.store(true, Ordering::Relaxed);
    }
}
