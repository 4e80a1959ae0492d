//! Cross-sections of tibia and fibula in P01: `data/tibia_fibula.toml`.

use std::sync::LazyLock;

use serde::Deserialize;

use super::table_list::exactly;

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct TibiaSection {
    /// Height above the joint centre.
    pub station: f64,
    /// (medial, posterior) of: anterolateral tubercle, front, anteromedial, posteromedial, back, posterolateral tubercle, floor of
    /// the fibular incisura.
    #[serde(deserialize_with = "exactly")]
    pub corners: [[f64; 2]; 7],
    /// Radius by which the polygon is grown.
    pub round: f64,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct FibulaSection {
    /// Height above the joint centre.
    pub station: f64,
    /// (medial, posterior).
    pub centre: [f64; 2],
    pub semi_axes: [f64; 2],
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct TibiaFibula {
    #[serde(deserialize_with = "exactly")]
    pub tibia: [TibiaSection; 8],
    #[serde(deserialize_with = "exactly")]
    pub fibula: [FibulaSection; 8],
}

pub(super) const TEXT: &str = include_str!("../data/tibia_fibula.toml");

pub(super) static TIBIA_FIBULA: LazyLock<TibiaFibula> =
    LazyLock::new(|| toml::from_str(TEXT).expect("a test reads the file"));
