//! Published means and spreads of the dimensions, and the phantoms P01 to P17: `data/family.toml`.

use std::sync::LazyLock;

use serde::Deserialize;

use super::parameters::Sex;
use super::table_list::exactly;

/// Distribution of a dimension among adults.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct Dimension {
    pub name: String,
    /// Mean and standard deviation of men.
    pub men: [f64; 2],
    /// Mean and standard deviation of women, if sources distinguish them.
    pub women: Option<[f64; 2]>,
    /// Whether the numbers above apply to a foot of P01's size and are multiplied by the size.
    #[serde(default)]
    pub grows: bool,
    /// Smallest and largest value drawn, in the units of the numbers above.
    #[serde(default = "unlimited")]
    pub range: [f64; 2],
}

fn unlimited() -> [f64; 2] {
    [f64::NEG_INFINITY, f64::INFINITY]
}

impl Dimension {
    pub(super) fn mean_and_deviation(&self, sex: Sex) -> [f64; 2] {
        match (sex, self.women) {
            (Sex::Female, Some(women)) => women,
            _ => self.men,
        }
    }
}

/// One value per entry of [`Family::dimensions`]; mm, degrees, HU, or a share.
pub(super) type Dimensions = [f64; 31];

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct Phantom {
    pub name: String,
    pub sex: Sex,
    #[serde(deserialize_with = "exactly")]
    pub values: Dimensions,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct Family {
    /// The dimensions of a phantom; the index of each is part of the address of its random numbers.
    #[serde(rename = "dimension", deserialize_with = "exactly")]
    pub dimensions: [Dimension; 31],
    #[serde(rename = "phantom", deserialize_with = "exactly")]
    pub phantoms: [Phantom; 17],
}

pub(super) const TEXT: &str = include_str!("../data/family.toml");

pub(super) static FAMILY: LazyLock<Family> =
    LazyLock::new(|| toml::from_str(TEXT).expect("a test reads the file"));
