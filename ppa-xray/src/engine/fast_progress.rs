//! Progress of the fast engine, and its cancellation.

use std::ops::{ControlFlow, Range};
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};

use crate::transport::tracking::TransportError;

/// Shares of the work after which the primary and single scatter are done, for the report of progress.
pub(super) const PRIMARY_DONE: f64 = 0.2;
pub(super) const SINGLE_DONE: f64 = 0.6;

/// Receives the share of the work that is done, 0 to 1, and cancels the rest with [`ControlFlow::Break`].
pub(crate) type Observer<'a> = &'a (dyn Fn(f64) -> ControlFlow<()> + Sync);

/// Passes progress on to an observer, and its wish to cancel back to the work.
pub(crate) struct Monitor<'a> {
    observe: Observer<'a>,
    cancelled: AtomicBool,
}

impl<'a> Monitor<'a> {
    pub fn new(observe: Observer<'a>) -> Self {
        Self {
            observe,
            cancelled: AtomicBool::new(false),
        }
    }

    /// A monitor that nobody observes.
    #[cfg(test)]
    pub fn silent() -> Self {
        Self::new(&|_| ControlFlow::Continue(()))
    }

    /// The stretch of the work between two shares of it, in `units` of about equal cost.
    pub fn phase(&self, shares: Range<f64>, units: usize) -> Phase<'_> {
        Phase {
            monitor: self,
            shares,
            units: units.max(1) as f64,
            done: AtomicU64::new(0),
        }
    }

    /// # Errors
    /// [`TransportError::Cancelled`] once the observer has said so.
    pub fn check(&self) -> Result<(), TransportError> {
        if self.cancelled.load(Ordering::Relaxed) {
            return Err(TransportError::Cancelled);
        }
        Ok(())
    }
}

/// A stretch of the work.
pub(crate) struct Phase<'a> {
    monitor: &'a Monitor<'a>,
    shares: Range<f64>,
    units: f64,
    done: AtomicU64,
}

impl Phase<'_> {
    /// Counts one more unit, and reports each whole percent of the work.
    pub fn advance(&self) {
        let before = self.done.fetch_add(1, Ordering::Relaxed) as f64;
        let [before, after] = [before, before + 1.0].map(|done| {
            let Range { start, end } = self.shares;
            start + (done / self.units).min(1.0) * (end - start)
        });
        let percent = |share: f64| (100.0 * share) as u32;
        if percent(before) == percent(after) || self.is_cancelled() {
            return;
        }
        if (self.monitor.observe)(after).is_break() {
            self.monitor.cancelled.store(true, Ordering::Relaxed);
        }
    }

    /// Whether the rest of the work may be left out, because nobody will see its result.
    pub fn is_cancelled(&self) -> bool {
        self.monitor.cancelled.load(Ordering::Relaxed)
    }
}
