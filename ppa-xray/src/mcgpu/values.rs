//! Values and headlines of an input file, line by line.

use std::path::{Path, PathBuf};

use crate::mcgpu::error::McgpuError;
use crate::mcgpu::lines::{Lines, columns, numbers};

/// Returns the headline of a section, shortened; it may be marked as a comment.
fn headline(line: &[u8]) -> Option<String> {
    let marks = |byte: &&u8| matches!(byte, b'#' | b'[' | b' ' | b'\t');
    let text = &line[line.iter().take_while(marks).count()..];
    let shown = || {
        String::from_utf8_lossy(&line[..line.len().min(80)])
            .trim()
            .to_owned()
    };
    text.starts_with(b"SECTION ").then(shown)
}

/// A file named in the input file.
#[derive(Debug, Clone, PartialEq)]
pub struct NamedFile {
    /// Line of the input file, from 1.
    pub line: u64,
    /// The file, resolved against the folder of the input file.
    pub path: PathBuf,
}

/// The lines of an input file that contain values.
pub(super) struct Values {
    pub lines: Lines,
    /// The headline that ended the section, until the next section is searched for.
    headline: Option<String>,
}

impl Values {
    pub fn open(path: &Path) -> Result<Self, McgpuError> {
        Ok(Self {
            lines: Lines::open(path)?,
            headline: None,
        })
    }

    /// Skips to the headline of a section.
    pub fn section(
        &mut self,
        section: &'static str,
        version: Option<&'static str>,
    ) -> Result<(), McgpuError> {
        let name = format!("SECTION {section}");
        loop {
            let found = match self.headline.take() {
                Some(headline) => headline,
                None => match self.lines.next()? {
                    Some(line) => headline(line).unwrap_or_default(),
                    None => {
                        let version = version.unwrap_or_default();
                        return Err(self.lines.ends(format!("[{name} {version}]")));
                    }
                },
            };
            if !found.contains(&name) {
                continue;
            }
            return match version {
                Some(expected) if !found.contains(&format!("{name} {expected}")) => {
                    Err(McgpuError::Version {
                        path: self.lines.path().into(),
                        line: self.lines.number(),
                        section,
                        found,
                        expected,
                    })
                }
                _ => Ok(()),
            };
        }
    }

    /// Returns the next line with content, without comment and outer blanks; `None` at a headline or the end.
    pub fn next(&mut self) -> Result<Option<String>, McgpuError> {
        while let Some(line) = self.lines.next()? {
            self.headline = headline(line);
            if self.headline.is_some() {
                return Ok(None);
            }
            let value = line.split(|&byte| byte == b'#').next().unwrap_or_default();
            let value = value.trim_ascii();
            if !value.is_empty() {
                return Ok(Some(String::from_utf8_lossy(value).into_owned()));
            }
        }
        Ok(None)
    }

    fn value(&mut self, expected: &str) -> Result<String, McgpuError> {
        match (self.next()?, &self.headline) {
            (Some(value), _) => Ok(value),
            (None, Some(headline)) => Err(self.lines.unexpected(headline.as_bytes(), expected)),
            (None, None) => Err(self.lines.ends(expected)),
        }
    }

    /// Parses the first numbers of the next line, which `fits` must accept.
    pub fn number<const N: usize>(
        &mut self,
        expected: &str,
        fits: impl FnOnce([f64; N]) -> bool,
    ) -> Result<[f64; N], McgpuError> {
        let value = self.value(expected)?;
        match numbers(value.as_bytes()) {
            Some(found) if found.iter().all(|n| n.is_finite()) && fits(found) => Ok(found),
            _ => Err(self.lines.unexpected(value.as_bytes(), expected)),
        }
    }

    /// Returns the first word of the next line.
    fn word(&mut self, expected: &str) -> Result<String, McgpuError> {
        let value = self.value(expected)?;
        Ok(columns(value.as_bytes()).next().unwrap_or_default().into())
    }

    pub fn file(&mut self, expected: &str, folder: &Path) -> Result<NamedFile, McgpuError> {
        let path = folder.join(self.word(expected)?);
        let line = self.lines.number();
        Ok(NamedFile { line, path })
    }

    /// Returns the name of a file to write, without its folder, which the caller chooses.
    pub fn output_name(&mut self, expected: &str) -> Result<String, McgpuError> {
        let word = self.word(expected)?;
        match Path::new(&word).file_name() {
            Some(name) => Ok(name.to_string_lossy().into_owned()),
            None => Err(self.lines.unexpected(word.as_bytes(), expected)),
        }
    }

    pub fn yes(&mut self) -> Result<bool, McgpuError> {
        let expected = "YES or NO";
        let value = self.value(expected)?;
        match value.as_bytes() {
            [b'Y' | b'y', b'E' | b'e', ..] => Ok(true),
            [b'N' | b'n', b'O' | b'o', ..] => Ok(false),
            _ => Err(self.lines.unexpected(value.as_bytes(), expected)),
        }
    }
}
