//! Merging the parts of a run.

use std::ops::Range;
use std::path::{Path, PathBuf};

use crate::run::analog_tally::AnalogTally;
use crate::run::tally_error::TallyError;

impl AnalogTally {
    /// Merges the files of the parts of a run, in any order, into one tally with the same bytes as that of an undivided run.
    ///
    /// Holds two tallies and the bytes of one in memory, for any number of files.
    ///
    /// # Errors
    /// [`TallyError`] naming the file if a part cannot be read, is unfinished or belongs to another run; naming the histories
    /// if parts overlap or leave a gap.
    pub fn merge(paths: &[impl AsRef<Path>]) -> Result<Self, TallyError> {
        let (first_path, others) = paths.split_first().ok_or(TallyError::Nothing)?;
        let mut all = Self::read(first_path.as_ref())?;
        let mut parts = vec![finished(&all, first_path.as_ref())?];
        for path in others {
            let path = path.as_ref();
            let part = Self::read(path)?;
            all.check_same_run(&part, path)?;
            parts.push(finished(&part, path)?);
            all.add(&part).ok_or_else(|| TallyError::Damaged {
                path: path.into(),
                what: "its sums overflow".to_owned(),
            })?;
        }
        check_cover(parts, all.setup.histories)?;
        all.part = 0..all.setup.histories;
        all.done = all.part.clone();
        Ok(all)
    }

    fn check_same_run(&self, other: &Self, path: &Path) -> Result<(), TallyError> {
        if other.setup.key != self.setup.key {
            return Err(TallyError::Key {
                path: path.into(),
                found: other.setup.key.clone(),
                expected: self.setup.key.clone(),
            });
        }
        if other.setup.histories != self.setup.histories {
            return Err(TallyError::Histories {
                path: path.into(),
                found: other.setup.histories,
                expected: self.setup.histories,
            });
        }
        if other.setup != self.setup {
            return Err(TallyError::Damaged {
                path: path.into(),
                what: "its header differs from that of other tallies with the same key".to_owned(),
            });
        }
        Ok(())
    }

    /// Adds the other sums; `None` on overflow.
    fn add(&mut self, other: &Self) -> Option<()> {
        self.image.add_bytes(&other.image.to_bytes())?;
        if let (Some(dose), Some(other)) = (&mut self.dose, &other.dose) {
            dose.add_bytes(&other.to_bytes())?;
        }
        Some(())
    }
}

/// Returns the histories of a part, or an error if they are not all counted.
fn finished(tally: &AnalogTally, path: &Path) -> Result<(Range<u64>, PathBuf), TallyError> {
    if tally.done != tally.part {
        return Err(TallyError::Unfinished {
            path: path.into(),
            done: tally.done.clone(),
            part: tally.part.clone(),
        });
    }
    Ok((tally.part.clone(), path.into()))
}

/// Checks that the parts cover `0..histories` exactly once.
fn check_cover(mut parts: Vec<(Range<u64>, PathBuf)>, histories: u64) -> Result<(), TallyError> {
    parts.retain(|(part, _)| !part.is_empty());
    parts.sort_by_key(|(part, _)| (part.start, part.end));
    for pair in parts.windows(2) {
        let [(first, first_path), (second, second_path)] = pair else {
            unreachable!("windows of two")
        };
        if second.start < first.end {
            return Err(TallyError::Overlap {
                first_path: first_path.clone(),
                first: first.clone(),
                second_path: second_path.clone(),
                second: second.clone(),
            });
        }
    }
    let mut at = 0;
    for bound in parts
        .into_iter()
        .map(|(part, _)| part)
        .chain(std::iter::once(histories..histories))
    {
        if at < bound.start {
            return Err(TallyError::Hole {
                missing: at..bound.start,
                histories,
            });
        }
        at = bound.end;
    }
    Ok(())
}
