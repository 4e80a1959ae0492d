//! Names of label sets that a dataset stores in addition to `labels.json`.

use std::fmt;
use std::str::FromStr;

use serde::{Deserialize, Serialize};

/// Name of the labels in `labels.NAME.json`: 1 to 40 lowercase letters, digits and hyphens, beginning with a letter.
#[derive(Debug, Clone, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
#[serde(try_from = "String", into = "String")]
pub struct LabelName(String);

/// A text that is not a valid name for labels.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error(
    "{0:?} is not a valid name for labels: expected 1 to 40 lowercase letters, digits and hyphens, beginning with a letter"
)]
pub struct LabelNameError(String);

const MOST_LETTERS: usize = 40;

impl LabelName {
    /// The name as text.
    pub fn as_str(&self) -> &str {
        &self.0
    }
}

impl TryFrom<String> for LabelName {
    type Error = LabelNameError;

    fn try_from(name: String) -> Result<Self, LabelNameError> {
        let allowed = |c: char| c.is_ascii_lowercase() || c.is_ascii_digit() || c == '-';
        let fine = name.starts_with(|c: char| c.is_ascii_lowercase())
            && name.chars().all(allowed)
            && name.len() <= MOST_LETTERS;
        if fine {
            Ok(Self(name))
        } else {
            Err(LabelNameError(name))
        }
    }
}

impl FromStr for LabelName {
    type Err = LabelNameError;

    fn from_str(name: &str) -> Result<Self, LabelNameError> {
        name.to_owned().try_into()
    }
}

impl From<LabelName> for String {
    fn from(name: LabelName) -> Self {
        name.0
    }
}

impl fmt::Display for LabelName {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.0)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_name_is_part_of_one_file_name() {
        let long = "a".repeat(40);
        for fine in ["strict", "reader-b2", "x", &long] {
            assert_eq!(fine.parse::<LabelName>().unwrap().as_str(), fine);
        }
        let longer = "a".repeat(41);
        for wrong in [
            "", "2nd", "-a", "Strict", "a/b", "..", "a.b", "a b", "ä", &longer,
        ] {
            let error = wrong.parse::<LabelName>().unwrap_err().to_string();
            assert!(error.contains("is not a valid name for labels"), "{error}");
        }
    }
}
