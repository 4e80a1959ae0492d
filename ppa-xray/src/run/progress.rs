//! Stopping rules, and progress.

use std::time::Duration;

/// When a run ends before all its histories are followed. The default is: never.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Stop {
    /// After this wall-clock time.
    pub time: Option<Duration>,
    /// When the median pixel is this precise: the median over the detector of the relative standard error of the total
    /// reading, blur and electronic noise included, as a fraction. Pixels that nothing has reached count as infinitely wrong.
    ///
    /// Looked at at fixed numbers of histories that grow by a tenth, so that the same seed stops at the same history
    /// on any machine and after any interruption.
    pub relative_error: Option<f64>,
}

/// Why following ended.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Stopped {
    /// All histories are followed.
    Complete,
    /// [`Stop::time`] is over.
    Time,
    /// [`Stop::relative_error`] is reached.
    Precise,
    /// The observer said so.
    Interrupted,
}

/// How far a run is.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Progress {
    /// Histories counted in the tally, those of earlier, interrupted runs included.
    pub histories: u64,
    /// Histories that will be counted in the end, as far as is known.
    pub expected_histories: u64,
    /// Time since the call began.
    pub elapsed: Duration,
    /// Estimated time left, once a rate is known.
    pub remaining: Option<Duration>,
    /// The error that [`Stop::relative_error`] is compared with, when last looked at.
    pub relative_error: Option<f64>,
}

/// First number of histories at which the precision is looked at.
const FIRST_CHECK: u64 = 65_536;

/// The next number of histories above `histories` at which the precision is looked at.
pub(crate) fn next_check(histories: u64) -> u64 {
    let mut check = FIRST_CHECK;
    while check <= histories {
        check = check.saturating_add(check / 10);
    }
    check
}

/// Whether the precision is looked at here.
pub(crate) fn is_check(histories: u64) -> bool {
    histories > 0 && next_check(histories - 1) == histories
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn checks_do_not_depend_on_where_a_run_was_interrupted() {
        let mut check = next_check(0);
        for _ in 0..200 {
            assert!(is_check(check) && !is_check(check + 1));
            let next = next_check(check);
            assert!(next > check && next <= check + check / 10);
            assert_eq!(next_check((check + next) / 2), next);
            check = next;
        }
    }
}
