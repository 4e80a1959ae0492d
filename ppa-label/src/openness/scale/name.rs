//! Names of the scales.

use std::fmt;
use std::str::FromStr;

use serde::Serialize;

/// A name that is not a scale.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error("unknown scale {0:?}, expected graded or strict")]
pub struct UnknownScale(String);

/// A scale of computed labels.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum ScaleName {
    /// By how far the malleoli hide the gutters: as wide as readers' grades.
    #[default]
    Graded,
    /// By how open the worst gutter is.
    Strict,
}

impl fmt::Display for ScaleName {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Graded => "graded",
            Self::Strict => "strict",
        })
    }
}

impl FromStr for ScaleName {
    type Err = UnknownScale;

    fn from_str(name: &str) -> Result<Self, UnknownScale> {
        let all = [Self::Graded, Self::Strict];
        let found = all.into_iter().find(|scale| scale.to_string() == name);
        found.ok_or_else(|| UnknownScale(name.to_owned()))
    }
}
