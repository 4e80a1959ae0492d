//! From Hounsfield units to material and mass density.

use serde::{Deserialize, Serialize};

/// Why a calibration cannot be used.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum CalibrationError {
    /// The material thresholds are not increasing.
    #[error(
        "material thresholds must increase: soft tissue {soft_tissue} HU, bone {bone} HU, titanium {titanium} HU"
    )]
    Thresholds {
        /// Lowest HU of soft tissue.
        soft_tissue: f32,
        /// Lowest HU of bone.
        bone: f32,
        /// Lowest HU of titanium.
        titanium: f32,
    },
    /// The density curve is too short.
    #[error("the density curve has {found} knots (HU, g/cm³), expected at least 2")]
    Knots {
        /// Knots given.
        found: usize,
    },
    /// The density curve must rise in HU and never fall in density.
    #[error("knot {knot} of the density curve does not continue it upwards (HU, g/cm³): {found:?}")]
    Curve {
        /// Index of the knot at fault.
        knot: usize,
        /// The knot.
        found: [f32; 2],
    },
    /// A density is not a positive number.
    #[error("the density of {what} is {found} g/cm³, expected a positive number")]
    Density {
        /// Of what.
        what: &'static str,
        /// What it was.
        found: f32,
    },
}

/// What a voxel is made of, as told from its Hounsfield value alone.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub enum Tissue {
    /// Air, inside or outside the patient.
    Air,
    /// Everything between air and bone.
    SoftTissue,
    /// Bone, from spongy to compact: soft tissue and cortical bone mixed by density.
    Bone,
    /// Metal, taken for a titanium implant.
    Titanium,
}

/// Thresholds and density curve that turn HU into material and density.
///
/// The defaults follow the stoichiometric calibration of Schneider, Bortfeld and Schlegel, Phys.
/// Med. Biol. 45 (2000) 459: fat-to-muscle 1.018 + 0.893e-3 HU and bone 1.017 + 0.592e-3 HU. Their
/// step down at 100 HU is replaced by the straight line between both branches, so the
/// density never falls as HU rises. Air has one density whatever the noise in it: the positive mean of clipped
/// noise would add up over a long path. Above 2800 HU, beyond the densest bone, only metal remains.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct HuCalibration {
    /// Lowest HU taken for soft tissue; below is air.
    pub soft_tissue_from_hu: f32,
    /// Lowest HU taken for bone, which begins as soft tissue and ends as cortical bone.
    pub bone_from_hu: f32,
    /// Lowest HU taken for titanium.
    pub titanium_from_hu: f32,
    /// Density of air, g/cm³.
    pub air_g_cm3: f32,
    /// Knots [HU, g/cm³] of the density of soft tissue and bone, straight in between, constant outside.
    pub density_curve: Vec<[f32; 2]>,
    /// Density of titanium, g/cm³.
    pub titanium_g_cm3: f32,
}

impl Default for HuCalibration {
    fn default() -> Self {
        Self {
            soft_tissue_from_hu: -800.0,
            bone_from_hu: 100.0,
            titanium_from_hu: 2_800.0,
            air_g_cm3: 0.001_205,
            density_curve: vec![
                [-1_000.0, 0.001_205],
                [-98.0, 0.930_5],
                [14.0, 1.030_5],
                [100.0, 1.076_2],
                [3_071.0, 2.835],
            ],
            titanium_g_cm3: 4.54,
        }
    }
}

impl HuCalibration {
    /// Checks that thresholds rise, and that the curve rises in HU and never falls in density.
    ///
    /// # Errors
    /// [`CalibrationError`] naming the number at fault.
    pub fn validate(&self) -> Result<(), CalibrationError> {
        let (soft_tissue, bone, titanium) = (
            self.soft_tissue_from_hu,
            self.bone_from_hu,
            self.titanium_from_hu,
        );
        if !(soft_tissue < bone && bone < titanium) {
            return Err(CalibrationError::Thresholds {
                soft_tissue,
                bone,
                titanium,
            });
        }
        let [first, _, ..] = self.density_curve[..] else {
            return Err(CalibrationError::Knots {
                found: self.density_curve.len(),
            });
        };
        for (what, found) in [
            ("air", self.air_g_cm3),
            ("titanium", self.titanium_g_cm3),
            ("the first knot", first[1]),
        ] {
            if !(found.is_finite() && found > 0.0) {
                return Err(CalibrationError::Density { what, found });
            }
        }
        for (knot, pair) in self.density_curve.windows(2).enumerate() {
            let finite = pair.as_flattened().iter().all(|value| value.is_finite());
            let continues = finite && pair[0][0] < pair[1][0] && pair[0][1] <= pair[1][1];
            if !continues {
                return Err(CalibrationError::Curve {
                    knot: knot + 1,
                    found: pair[1],
                });
            }
        }
        Ok(())
    }

    /// The material a Hounsfield value stands for.
    pub fn tissue(&self, hu: f32) -> Tissue {
        if hu < self.soft_tissue_from_hu {
            Tissue::Air
        } else if hu < self.bone_from_hu {
            Tissue::SoftTissue
        } else if hu < self.titanium_from_hu {
            Tissue::Bone
        } else {
            Tissue::Titanium
        }
    }

    /// Mass density in g/cm³ of a Hounsfield value.
    pub fn density_g_cm3(&self, hu: f32) -> f32 {
        match self.tissue(hu) {
            Tissue::Air => self.air_g_cm3,
            Tissue::Titanium => self.titanium_g_cm3,
            Tissue::SoftTissue | Tissue::Bone => self.curve(hu),
        }
    }

    fn curve(&self, hu: f32) -> f32 {
        let knots = &self.density_curve;
        let after = knots.partition_point(|knot| knot[0] <= hu);
        if after == 0 || after == knots.len() {
            return knots[after.saturating_sub(1)][1];
        }
        let ([h0, d0], [h1, d1]) = (knots[after - 1], knots[after]);
        d0 + (d1 - d0) * (hu - h0) / (h1 - h0)
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    #[test]
    fn landmarks_of_the_scale_get_their_density() {
        let calibration = HuCalibration::default();
        calibration.validate().unwrap();
        // Water 1.0, muscle 1.05 and dense cortical bone 1.92 g/cm³ (ICRU 44).
        for (hu, density, within) in [(0.0, 1.0, 0.02), (50.0, 1.05, 0.01), (1_524.0, 1.92, 0.01)] {
            let found = calibration.density_g_cm3(hu);
            assert!((found - density).abs() < within, "{hu} HU: {found}");
        }
        assert_eq!(calibration.tissue(-1_000.0), Tissue::Air);
        assert_eq!(calibration.tissue(8_000.0), Tissue::Titanium);
    }

    proptest! {
        #[test]
        fn material_and_density_never_fall_as_hu_rises(a in -1_100.0..9_000.0_f32, step in 0.0..500.0_f32) {
            let calibration = HuCalibration::default();
            prop_assert!(calibration.tissue(a) <= calibration.tissue(a + step));
            prop_assert!(calibration.density_g_cm3(a) <= calibration.density_g_cm3(a + step));
        }

        /// The steepest branch of the default curve is 1.03e-3 g/cm³ per HU.
        #[test]
        fn density_is_continuous_within_tissue(a in -799.0..2_798.0_f32) {
            let calibration = HuCalibration::default();
            let jump = calibration.density_g_cm3(a + 1.0) - calibration.density_g_cm3(a);
            prop_assert!(jump < 1.1e-3, "{jump}");
        }
    }

    #[test]
    fn a_falling_curve_is_refused_with_the_knot() {
        let mut calibration = HuCalibration::default();
        calibration.density_curve[2][1] = 0.5;
        assert!(matches!(
            calibration.validate(),
            Err(CalibrationError::Curve { knot: 2, .. })
        ));
    }
}
