//! Stopping rules and progress of a run.

use std::time::Duration;

/// Conditions that end a run before all its histories are followed. By default there are none.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Stop {
    /// Wall-clock time limit.
    pub time: Option<Duration>,
    /// Precision to reach: the median over the detector of the relative standard error of the total
    /// reading, blur and electronic noise included, as a fraction. The error of pixels without hits counts as infinite.
    ///
    /// Checked at fixed numbers of histories that grow by a tenth, so that the same seed stops at the same history
    /// on any machine and after any interruption.
    pub relative_error: Option<f64>,
}

/// Why a run ended.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Stopped {
    /// All histories are followed.
    Complete,
    /// The time limit [`Stop::time`] has passed.
    Time,
    /// [`Stop::relative_error`] is reached.
    Precise,
    /// The observer ended the run.
    Interrupted,
}

/// Progress of a run.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Progress {
    /// Histories counted in the tally, those of earlier, interrupted runs included.
    pub histories: u64,
    /// Expected final number of histories, as far as is known.
    pub expected_histories: u64,
    /// Time since the call began.
    pub elapsed: Duration,
    /// Estimated time left, once a rate is known.
    pub remaining: Option<Duration>,
    /// The error compared with [`Stop::relative_error`], as of the last check.
    pub relative_error: Option<f64>,
}

/// First number of histories at which the precision is checked.
const FIRST_CHECK: u64 = 65_536;

/// The next number of histories above `histories` at which the precision is checked.
pub(crate) fn next_check(histories: u64) -> u64 {
    let mut check = FIRST_CHECK;
    while check <= histories {
        check = check.saturating_add(check / 10);
    }
    check
}

/// Whether the precision is checked at this number of histories.
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
