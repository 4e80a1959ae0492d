//! Progress of the fast engine, and its cancellation.

use std::ops::{ControlFlow, Range};
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::time::Instant;

use crate::transport::tracking::TransportError;

/// Completed shares of the work after the primary and after single scatter, for progress reports.
pub(super) const PRIMARY_DONE: f64 = 0.2;
pub(super) const SINGLE_DONE: f64 = 0.6;

/// Longest time between two reports while units are completed, and so the longest wait of an observer that cancels.
const REPORT_EVERY_MS: u64 = 100;

/// Receives the completed share of the work, 0 to 1, and cancels the rest with [`ControlFlow::Break`].
pub(crate) type Observer<'a> = &'a (dyn Fn(f64) -> ControlFlow<()> + Sync);

/// Reports progress to an observer, and passes its cancellation to the work.
pub(crate) struct Monitor<'a> {
    observe: Observer<'a>,
    cancelled: AtomicBool,
    begun: Instant,
    /// Time of the last report, since the beginning.
    reported_ms: AtomicU64,
}

impl<'a> Monitor<'a> {
    pub fn new(observe: Observer<'a>) -> Self {
        Self {
            observe,
            cancelled: AtomicBool::new(false),
            begun: Instant::now(),
            reported_ms: AtomicU64::new(0),
        }
    }

    /// A monitor without an observer.
    #[cfg(test)]
    pub fn silent() -> Self {
        Self::new(&|_| ControlFlow::Continue(()))
    }

    /// The phase of the work between two shares, in `units` of about equal cost.
    pub fn phase(&self, shares: Range<f64>, units: usize) -> Phase<'_> {
        Phase {
            monitor: self,
            shares,
            units: units.max(1) as f64,
            done: AtomicU64::new(0),
        }
    }

    /// Whether a report is due; true for one thread only, which then reports.
    fn is_due(&self) -> bool {
        let now = self.begun.elapsed().as_millis() as u64;
        let last = self.reported_ms.load(Ordering::Relaxed);
        now >= last + REPORT_EVERY_MS
            && self
                .reported_ms
                .compare_exchange(last, now, Ordering::Relaxed, Ordering::Relaxed)
                .is_ok()
    }

    /// # Errors
    /// [`TransportError::Cancelled`] once the observer has cancelled.
    pub fn check(&self) -> Result<(), TransportError> {
        if self.cancelled.load(Ordering::Relaxed) {
            return Err(TransportError::Cancelled);
        }
        Ok(())
    }
}

/// A phase of the work.
pub(crate) struct Phase<'a> {
    monitor: &'a Monitor<'a>,
    shares: Range<f64>,
    units: f64,
    done: AtomicU64,
}

impl Phase<'_> {
    /// Counts one more unit. Reports each percent of the work, and also after some time without a report.
    pub fn advance(&self) {
        let before = self.done.fetch_add(1, Ordering::Relaxed) as f64;
        let [before, after] = [before, before + 1.0].map(|done| {
            let Range { start, end } = self.shares;
            start + (done / self.units).min(1.0) * (end - start)
        });
        let percent = |share: f64| (100.0 * share) as u32;
        let whole = percent(before) != percent(after);
        if self.is_cancelled() || !(self.monitor.is_due() || whole) {
            return;
        }
        if (self.monitor.observe)(after).is_break() {
            self.monitor.cancelled.store(true, Ordering::Relaxed);
        }
    }

    /// Whether the rest of the work may be skipped because its result will not be used.
    pub fn is_cancelled(&self) -> bool {
        self.monitor.cancelled.load(Ordering::Relaxed)
    }
}

#[cfg(test)]
mod tests {
    use std::thread::sleep;
    use std::time::Duration;

    use super::*;

    /// One percent of a long exposure takes minutes.
    #[test]
    fn an_observer_can_cancel_within_a_percent() {
        let reports = AtomicU64::new(0);
        let observe = |_: f64| {
            reports.fetch_add(1, Ordering::Relaxed);
            ControlFlow::Break(())
        };
        let monitor = Monitor::new(&observe);
        let phase = monitor.phase(0.0..1.0, 1_000_000);
        sleep(Duration::from_millis(REPORT_EVERY_MS));
        phase.advance();
        assert_eq!(reports.load(Ordering::Relaxed), 1);
        assert!(phase.is_cancelled());
        assert_eq!(monitor.check(), Err(TransportError::Cancelled));
    }
}
