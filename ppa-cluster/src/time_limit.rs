//! Time limits of jobs, in the notations of `sbatch --time`.

use std::fmt;
use std::str::FromStr;

use serde::{Deserialize, Serialize};

/// The wall-clock limit of a job in seconds; prints as `1-02:03:04` or `02:03:04`.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(try_from = "String", into = "String")]
pub struct TimeLimit {
    seconds: u64,
}

/// Text that is not a time limit.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error(
    "\"{found}\" is not a time limit; expected minutes, hours:minutes:seconds or days-hours:minutes:seconds, such as 90 or 1:30:00"
)]
pub struct TimeLimitError {
    found: String,
}

impl TimeLimit {
    /// The default limit of a task: two hours.
    pub const DEFAULT: Self = Self::from_seconds(2 * 3600);

    /// A limit of whole seconds.
    pub const fn from_seconds(seconds: u64) -> Self {
        Self { seconds }
    }

    /// The limit in seconds.
    pub const fn seconds(self) -> u64 {
        self.seconds
    }
}

impl fmt::Display for TimeLimit {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let (minutes, seconds) = (self.seconds / 60, self.seconds % 60);
        let (hours, minutes) = (minutes / 60, minutes % 60);
        let (days, hours) = (hours / 24, hours % 24);
        if days > 0 {
            write!(f, "{days}-")?;
        }
        write!(f, "{hours:02}:{minutes:02}:{seconds:02}")
    }
}

impl FromStr for TimeLimit {
    type Err = TimeLimitError;

    fn from_str(text: &str) -> Result<Self, TimeLimitError> {
        let seconds = || {
            let (days, clock) = match text.split_once('-') {
                Some((days, clock)) => (Some(number(days)?), clock),
                None => (None, text),
            };
            let parts: Vec<u64> = clock.split(':').map(number).collect::<Option<_>>()?;
            // The first of one or two numbers is minutes, or hours if days are given.
            let (hours, minutes, seconds) = match (days.is_some(), parts.as_slice()) {
                (false, [minutes]) => (0, *minutes, 0),
                (false, [minutes, seconds]) => (0, *minutes, *seconds),
                (true, [hours]) => (*hours, 0, 0),
                (true, [hours, minutes]) => (*hours, *minutes, 0),
                (_, [hours, minutes, seconds]) => (*hours, *minutes, *seconds),
                _ => return None,
            };
            let hours = days.unwrap_or(0).checked_mul(24)?.checked_add(hours)?;
            let minutes = hours.checked_mul(60)?.checked_add(minutes)?;
            minutes.checked_mul(60)?.checked_add(seconds)
        };
        match seconds() {
            Some(seconds) if seconds > 0 => Ok(Self { seconds }),
            _ => Err(TimeLimitError {
                found: text.to_owned(),
            }),
        }
    }
}

fn number(text: &str) -> Option<u64> {
    let is_number = !text.is_empty() && text.bytes().all(|byte| byte.is_ascii_digit());
    is_number.then(|| text.parse().ok()).flatten()
}

impl TryFrom<String> for TimeLimit {
    type Error = TimeLimitError;

    fn try_from(text: String) -> Result<Self, TimeLimitError> {
        text.parse()
    }
}

impl From<TimeLimit> for String {
    fn from(limit: TimeLimit) -> Self {
        limit.to_string()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn limits_are_read_in_the_notations_of_slurm() {
        for (text, seconds) in [
            ("90", 5400),
            ("1:30", 90),
            ("1:30:00", 5400),
            ("2-3", 183_600),
            ("2-3:30", 185_400),
            ("1-02:03:04", 93_784),
        ] {
            assert_eq!(text.parse(), Ok(TimeLimit::from_seconds(seconds)), "{text}");
        }
        let limit = TimeLimit::from_seconds(93_784);
        assert_eq!(limit.to_string(), "1-02:03:04");
        assert_eq!(limit.to_string().parse(), Ok(limit));
    }

    #[test]
    fn other_texts_are_no_limits() {
        for bad in [
            "",
            "0",
            "-1",
            "+5",
            "1:2:3:4",
            "2h",
            "1-",
            "99999999999999999-0",
            "UNLIMITED",
        ] {
            let said = bad.parse::<TimeLimit>().unwrap_err().to_string();
            assert!(said.contains("is not a time limit"), "{said}");
        }
    }
}
