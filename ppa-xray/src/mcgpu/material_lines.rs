//! Lines of a material file: headlines, numbers after `#`, rows of a table.

use std::path::Path;

use crate::mcgpu::error::McgpuError;
use crate::mcgpu::lines::{Lines, holds, numbers};

/// Reads a material file section by section.
pub(super) struct MaterialFile(Lines);

impl MaterialFile {
    pub fn open(path: &Path) -> Result<Self, McgpuError> {
        Ok(Self(Lines::open(path)?))
    }

    pub fn line(&mut self, expected: &str) -> Result<Vec<u8>, McgpuError> {
        let line = self.0.next()?.map(<[u8]>::to_vec);
        line.ok_or_else(|| self.0.ends(expected))
    }

    /// Skips to the line that contains `headline`.
    pub fn seek(&mut self, headline: &str) -> Result<(), McgpuError> {
        loop {
            match self.0.next()? {
                Some(line) if holds(line, headline) => return Ok(()),
                Some(_) => {}
                None => return Err(self.0.ends(headline)),
            }
        }
    }

    /// Reads a number after `#`.
    pub fn counted(&mut self, expected: &str) -> Result<f64, McgpuError> {
        let line = self.line(expected)?;
        let number = line
            .trim_ascii()
            .strip_prefix(b"#")
            .and_then(numbers::<1>)
            .filter(|[number]| number.is_finite());
        match number {
            Some([number]) => Ok(number),
            None => Err(self.0.unexpected(&line, expected)),
        }
    }

    pub fn count(
        &mut self,
        what: &str,
        range: std::ops::RangeInclusive<usize>,
    ) -> Result<usize, McgpuError> {
        let expected = format!("the number of {what}, {} to {}", range.start(), range.end());
        let found = self.counted(&expected)?;
        let fits = found.fract() == 0.0 && range.contains(&(found as usize));
        if fits {
            Ok(found as usize)
        } else {
            Err(self.0.unexpected(found.to_string().as_bytes(), expected))
        }
    }

    pub fn row<const N: usize>(
        &mut self,
        expected: &str,
        fits: impl FnOnce(&[f64; N]) -> bool,
    ) -> Result<[f64; N], McgpuError> {
        let Some(line) = self.0.next()? else {
            return Err(self.0.ends(expected));
        };
        match numbers(line).filter(fits) {
            Some(row) => Ok(row),
            None => {
                let line = line.to_vec();
                Err(self.0.unexpected(&line, expected))
            }
        }
    }

    /// Returns the error for a line that contains `found`.
    pub fn unexpected(&self, found: &[u8], expected: String) -> McgpuError {
        self.0.unexpected(found, expected)
    }
}
