//! Metatarsals and phalanges of P01: `data/forefoot.toml`.

use std::sync::LazyLock;

use serde::Deserialize;

use super::table_list::exactly;

/// Base, waist and head of a metatarsal.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct Metatarsal {
    pub name: String,
    pub base: [f64; 3],
    pub base_semi: [f64; 3],
    pub head: [f64; 3],
    pub head_semi: [f64; 3],
    /// Radius of the shaft behind the head.
    pub waist: f64,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct Phalanx {
    pub name: String,
    /// Centre of the base.
    pub base: [f64; 3],
    /// Centre of the far end.
    pub end: [f64; 3],
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct Toe {
    /// Radius of the shafts.
    pub waist: f64,
    /// From the base to the tip.
    pub phalanges: Vec<Phalanx>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct Forefoot {
    #[serde(rename = "metatarsal", deserialize_with = "exactly")]
    pub metatarsals: [Metatarsal; 5],
    #[serde(rename = "toe", deserialize_with = "exactly")]
    pub toes: [Toe; 5],
}

pub(super) const TEXT: &str = include_str!("../data/forefoot.toml");

pub(super) static FOREFOOT: LazyLock<Forefoot> =
    LazyLock::new(|| toml::from_str(TEXT).expect("a test reads the file"));
