//! Application of a calibration: material index and density of a voxel from its Hounsfield value.

use crate::matter::material::Material;
use crate::phantom::calibration_error::CalibrationError;
use crate::phantom::graded_mixture::GradedMixture;
use crate::phantom::hu::HuCalibration;
use crate::phantom::segment::{Composition, Segment};

/// The materials of a calibration, and their assignment to Hounsfield values.
pub(crate) struct Segmentation<'a> {
    calibration: &'a HuCalibration,
    kinds: Vec<Kind>,
    materials: Vec<Material>,
}

/// Position of a segment's materials in the list.
struct Kind {
    first: usize,
    mixture: Option<GradedMixture>,
}

/// Material and density for a Hounsfield value.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Voxel {
    pub segment: usize,
    /// Index into [`Segmentation::materials`].
    pub material: usize,
    pub density_g_cm3: f32,
}

impl<'a> Segmentation<'a> {
    pub fn new(calibration: &'a HuCalibration) -> Result<Self, CalibrationError> {
        calibration.validate()?;
        let mut materials = Vec::new();
        let mut kinds = Vec::new();
        for segment in &calibration.segments {
            let first = materials.len();
            let (mixture, made) = made(segment)?;
            materials.extend(made);
            kinds.push(Kind { first, mixture });
        }
        Ok(Self {
            calibration,
            kinds,
            materials,
        })
    }

    pub fn materials(&self) -> &[Material] {
        &self.materials
    }

    /// Converts a Hounsfield value; −∞ means outside the patient.
    pub fn voxel(&self, hu: f32) -> Voxel {
        let segment = self.calibration.segment_index(hu);
        let density_g_cm3 = self.calibration.segments[segment].density_g_cm3(hu);
        let Kind { first, mixture } = &self.kinds[segment];
        let level = mixture
            .as_ref()
            .map_or(0, |mixture| mixture.level(density_g_cm3));
        Voxel {
            segment,
            material: first + level,
            density_g_cm3,
        }
    }
}

/// Returns the materials of a segment, and the mixture that selects among them by density if there are several.
fn made(segment: &Segment) -> Result<(Option<GradedMixture>, Vec<Material>), CalibrationError> {
    let constituents = segment.constituents()?;
    let (Composition::Mixture(ends), [first, second]) = (&segment.composition, &constituents[..])
    else {
        return Ok((None, constituents));
    };
    let densities = [ends[0].density_g_cm3, ends[1].density_g_cm3];
    let mixture =
        GradedMixture::new(&segment.name, [first, second], densities).map_err(|source| {
            CalibrationError::Material {
                segment: segment.name.clone(),
                source: Box::new(source),
            }
        })?;
    let levels = mixture.levels.clone();
    Ok((Some(mixture), levels))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn attenuation_mm(hu: f32, energy_kev: f64) -> f64 {
        let calibration = HuCalibration::default();
        let segmentation = Segmentation::new(&calibration).unwrap();
        let voxel = segmentation.voxel(hu);
        let material = &segmentation.materials()[voxel.material];
        material.total_cm2_g(energy_kev).unwrap() * f64::from(voxel.density_g_cm3) / 10.0
    }

    /// HU are attenuation relative to water at the scanner's mean energy, about 70 keV at 120 kV: the calibration
    /// must reproduce them. 2 % for soft tissue; 5 % for bone covers the levels and the differences between scanners.
    #[test]
    fn attenuation_at_ct_energies_is_what_the_hu_say() {
        let water_mm = Material::named("water").unwrap().total_cm2_g(70.0).unwrap() / 10.0;
        for (hu, within) in [
            (-110.0, 0.02),
            (-80.0, 0.02),
            (-30.0, 0.02),
            (0.0, 0.02),
            (60.0, 0.02),
            (120.0, 0.05),
            (200.0, 0.05),
            (300.0, 0.05),
            (500.0, 0.05),
            (800.0, 0.05),
            (1_200.0, 0.05),
            (1_400.0, 0.05),
        ] {
            let expected = water_mm * (1.0 + f64::from(hu) / 1_000.0);
            let ratio = attenuation_mm(hu, 70.0) / expected;
            assert!((ratio - 1.0).abs() < within, "{hu} HU: {ratio:.4}");
        }
    }

    /// No hard edge at the mean energy of a 60 kV beam at the boundary between segments of tissue.
    #[test]
    fn tissues_meet_without_a_step() {
        for hu in [14.0, 100.0] {
            let step = attenuation_mm(hu + 0.5, 36.0) / attenuation_mm(hu - 0.5, 36.0) - 1.0;
            assert!(
                step.abs() < 0.03,
                "a step of {:.1} % at {hu} HU",
                100.0 * step
            );
        }
    }
}
