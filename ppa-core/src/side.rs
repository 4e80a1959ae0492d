//! Sides of the body.

use std::fmt;

use serde::{Deserialize, Serialize};

/// Side of the body, the patient's left or right; `l` or `r` in files.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
pub enum Side {
    /// Left limb.
    #[serde(rename = "l")]
    Left,
    /// Right limb.
    #[serde(rename = "r")]
    Right,
}

impl Side {
    /// Both sides, left first.
    pub const ALL: [Self; 2] = [Self::Left, Self::Right];

    /// `l` or `r`.
    pub fn letter(self) -> &'static str {
        match self {
            Self::Left => "l",
            Self::Right => "r",
        }
    }
}

/// `left` or `right`.
impl fmt::Display for Side {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Left => "left",
            Self::Right => "right",
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn json_holds_the_letter_of_a_side() {
        for side in Side::ALL {
            let json = serde_json::to_string(&side).unwrap();
            assert_eq!(json, format!("\"{}\"", side.letter()));
            assert_eq!(serde_json::from_str::<Side>(&json).unwrap(), side);
        }
    }
}
