//! Skin of P01, cross-sections of shank and foot, and the toes: `data/lower_leg_skin.toml`.

use std::sync::LazyLock;

use serde::Deserialize;

use super::table_list::exactly;

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct ShankSection {
    /// Height above the joint.
    pub station: f64,
    pub centre: [f64; 2],
    /// Radii every 30° from medial over posterior.
    #[serde(deserialize_with = "exactly")]
    pub radii: [f64; 12],
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct FootSection {
    /// Distance in front of the joint.
    pub station: f64,
    /// x, height above the sole.
    pub corners: Vec<[f64; 2]>,
    /// Radius by which the polygon is grown.
    pub round: f64,
}

/// Ball of a toe and its tip: x, y, height above the sole.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct Toe {
    pub ball: [f64; 3],
    pub ball_radius: f64,
    pub tip: [f64; 3],
    pub tip_radius: f64,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct Skin {
    #[serde(deserialize_with = "exactly")]
    pub shank: [ShankSection; 9],
    #[serde(deserialize_with = "exactly")]
    pub foot: [FootSection; 8],
    #[serde(rename = "toe", deserialize_with = "exactly")]
    pub toes: [Toe; 5],
}

pub(super) const TEXT: &str = include_str!("../data/lower_leg_skin.toml");

pub(super) static SKIN: LazyLock<Skin> =
    LazyLock::new(|| toml::from_str(TEXT).expect("a test reads the file"));
