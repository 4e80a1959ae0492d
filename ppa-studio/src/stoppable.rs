//! Work that a flag cancels: of several requests, only the newest continues.

use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex, PoisonError};

/// One kind of work that a flag ends.
#[derive(Default)]
pub(crate) struct Stoppable(Mutex<Arc<AtomicBool>>);

impl Stoppable {
    /// Ends the work under way; the flag of the next one.
    pub fn begin(&self) -> Arc<AtomicBool> {
        let mut flag = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        flag.store(true, Ordering::Relaxed);
        *flag = Arc::default();
        flag.clone()
    }

    /// Ends the work under way.
    pub fn stop(&self) {
        self.begin();
    }
}

/// Ends the work of a request whose answer nobody waits for any more.
pub(crate) struct StopOnDrop(pub Arc<AtomicBool>);

impl Drop for StopOnDrop {
    fn drop(&mut self) {
        self.0.store(true, Ordering::Relaxed);
    }
}
