//! Equal parts of a run or shards of a dataset, `k/n`.

use std::fmt;
use std::ops::Range;
use std::str::FromStr;

/// One of `count` equal parts of a run or of a dataset, `index` counted from 1; parses from and prints as `2/8`.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Part {
    index: u64,
    count: u64,
}

/// Invalid text of a part.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error("\"{found}\" is not a valid part of a run; expected k/n with k from 1 to n, such as 2/8")]
pub struct PartError {
    found: String,
}

impl Part {
    /// The only part of a run.
    pub const WHOLE: Self = Self { index: 1, count: 1 };

    /// Number of the part, counted from 1.
    pub fn index(&self) -> u64 {
        self.index
    }

    /// Returns the part's share of `total` items; consecutive parts follow each other without gaps.
    pub fn share(&self, total: u64) -> Range<u64> {
        let bound =
            |index: u64| (u128::from(total) * u128::from(index) / u128::from(self.count)) as u64;
        bound(self.index - 1)..bound(self.index)
    }
}

impl fmt::Display for Part {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}/{}", self.index, self.count)
    }
}

impl FromStr for Part {
    type Err = PartError;

    fn from_str(text: &str) -> Result<Self, PartError> {
        let parse = || {
            let (index, count) = text.split_once('/')?;
            let part = Self {
                index: index.trim().parse().ok()?,
                count: count.trim().parse().ok()?,
            };
            (1..=part.count).contains(&part.index).then_some(part)
        };
        parse().ok_or_else(|| PartError {
            found: text.to_owned(),
        })
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    proptest! {
        #[test]
        fn parts_cover_the_run_once(histories in 1..=u64::MAX, count in 1..200_u64) {
            let mut at = 0;
            for index in 1..=count {
                let share = Part { index, count }.share(histories);
                prop_assert_eq!(share.start, at);
                at = share.end;
            }
            prop_assert_eq!(at, histories);
        }
    }

    #[test]
    fn parts_are_read() {
        let part = Part { index: 2, count: 8 };
        assert_eq!("2/8".parse(), Ok(part));
        assert_eq!(part.to_string(), "2/8");
        for bad in ["", "0/3", "4/3", "1/0", "-1/2", "1", "a/b", "1/2/3"] {
            assert!(
                bad.parse::<Part>().unwrap_err().to_string().contains("k/n"),
                "{bad}"
            );
        }
    }
}
