//! The two depth cameras.

use serde::{Deserialize, Serialize};

/// One of the two depth cameras on the tube housing.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
pub enum View {
    /// V1 in the paper.
    #[serde(rename = "cam_left")]
    Left,
    /// V2 in the paper.
    #[serde(rename = "cam_right")]
    Right,
}

impl View {
    /// Both cameras, left first.
    pub const ALL: [Self; 2] = [Self::Left, Self::Right];

    /// The camera's name in file names and JSON.
    pub fn name(self) -> &'static str {
        match self {
            Self::Left => "cam_left",
            Self::Right => "cam_right",
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn json_holds_the_name_of_a_view() {
        for view in View::ALL {
            let json = serde_json::to_string(&view).unwrap();
            assert_eq!(json, format!("\"{}\"", view.name()));
            assert_eq!(serde_json::from_str::<View>(&json).unwrap(), view);
        }
    }
}
