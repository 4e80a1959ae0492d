//! A range of the Hounsfield scale: its material and density.

use serde::{Deserialize, Serialize};

use crate::matter::material::Material;
use crate::matter::material_error::MaterialError;
use crate::phantom::calibration_error::CalibrationError;

/// A range of the Hounsfield scale with one material or one gradual mixture.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(try_from = "SegmentTable", into = "SegmentTable")]
pub struct Segment {
    /// Name for users; errors and the audit report it.
    pub name: String,
    /// Lowest HU of the segment. `None` only in the first segment, which has no lower end.
    pub from_hu: Option<f32>,
    /// Material or mixture of the segment.
    pub composition: Composition,
    /// Knots [HU, g/cm³] of the density: linear in between, constant outside.
    pub density: Vec<[f32; 2]>,
}

/// Material or mixture of a segment.
///
/// A material is given by a name of the library ([`Material::named`]) or by mass fractions
/// ([`Material::parse_composition`]), which are distinguished by the colon.
#[derive(Debug, Clone, PartialEq)]
pub enum Composition {
    /// One material.
    Pure(String),
    /// A gradual transition from the first material to the second, by density.
    Mixture([Constituent; 2]),
}

/// One end of a gradual mixture.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Constituent {
    /// The material.
    pub material: String,
    /// Density of a voxel of this material alone, g/cm³.
    pub density_g_cm3: f32,
}

impl Segment {
    /// Checks that knots rise, that the density never falls and that every material exists.
    pub(super) fn validate(&self) -> Result<(), CalibrationError> {
        let segment = || self.name.clone();
        let [first, ..] = self.density[..] else {
            return Err(CalibrationError::Knots { segment: segment() });
        };
        let positive = |density: f32| density.is_finite() && density > 0.0;
        if !(first[0].is_finite() && positive(first[1])) {
            return Err(CalibrationError::Curve {
                segment: segment(),
                knot: 1,
                found: first,
            });
        }
        for (index, pair) in self.density.windows(2).enumerate() {
            let finite = pair.as_flattened().iter().all(|value| value.is_finite());
            if !(finite && pair[0][0] < pair[1][0] && pair[0][1] <= pair[1][1]) {
                return Err(CalibrationError::Curve {
                    segment: segment(),
                    knot: index + 2,
                    found: pair[1],
                });
            }
        }
        if let Composition::Mixture([first, second]) = &self.composition {
            let [low, high] = [first.density_g_cm3, second.density_g_cm3];
            if !(positive(low) && positive(high) && low < high) {
                return Err(CalibrationError::Mixture {
                    segment: segment(),
                    found: [low, high],
                });
            }
        }
        self.constituents().map(|_| ())
    }

    /// Mass density in g/cm³ of a Hounsfield value of this segment.
    pub fn density_g_cm3(&self, hu: f32) -> f32 {
        let knots = &self.density;
        let after = knots.partition_point(|knot| knot[0] <= hu);
        if after == 0 || after == knots.len() {
            return knots[after.saturating_sub(1)][1];
        }
        let ([h0, d0], [h1, d1]) = (knots[after - 1], knots[after]);
        d0 + (d1 - d0) * (hu - h0) / (h1 - h0)
    }

    /// The one or two materials of the segment, at their densities in it.
    pub(crate) fn constituents(&self) -> Result<Vec<Material>, CalibrationError> {
        let made = |text: &str, density_g_cm3: f32| -> Result<Material, MaterialError> {
            if text.contains(':') {
                Material::parse_composition(&self.name, f64::from(density_g_cm3), text)
            } else {
                Material::named(text)
            }
        };
        let materials: Result<Vec<_>, _> = match &self.composition {
            Composition::Pure(material) => {
                let densest = self.density[self.density.len() - 1][1];
                [made(material, densest)].into_iter().collect()
            }
            Composition::Mixture(parts) => parts
                .iter()
                .map(|part| made(&part.material, part.density_g_cm3))
                .collect(),
        };
        materials.map_err(|source| CalibrationError::Material {
            segment: self.name.clone(),
            source: Box::new(source),
        })
    }
}

/// A segment as written in a file.
#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct SegmentTable {
    /// Name of the segment in messages.
    name: String,
    /// Lowest HU that belongs to it; left out only in the first segment, which has no lower end.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    from_hu: Option<f32>,
    /// Name of a material of the library, or its mass fractions; either this or `mixture`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    material: Option<String>,
    /// Knots [HU, g/cm³] of the density: linear in between, constant outside.
    density: Vec<[f32; 2]>,
    // Last, since TOML wants tables after plain values.
    /// Two materials: the mixture goes from the first to the second as the density goes from that of the first to that of the second.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    mixture: Option<[Constituent; 2]>,
}

impl TryFrom<SegmentTable> for Segment {
    type Error = String;

    fn try_from(table: SegmentTable) -> Result<Self, String> {
        let composition = match (table.material, table.mixture) {
            (Some(material), None) => Composition::Pure(material),
            (None, Some(mixture)) => Composition::Mixture(mixture),
            _ => {
                return Err(format!(
                    "segment {:?} needs either `material` or `mixture`",
                    table.name
                ));
            }
        };
        Ok(Self {
            name: table.name,
            from_hu: table.from_hu,
            composition,
            density: table.density,
        })
    }
}

impl From<Segment> for SegmentTable {
    fn from(segment: Segment) -> Self {
        let (material, mixture) = match segment.composition {
            Composition::Pure(material) => (Some(material), None),
            Composition::Mixture(mixture) => (None, Some(mixture)),
        };
        Self {
            name: segment.name,
            from_hu: segment.from_hu,
            material,
            density: segment.density,
            mixture,
        }
    }
}
