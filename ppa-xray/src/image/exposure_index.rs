//! Exposure index of IEC 62494-1:2008.

use nalgebra::Vector3;

use crate::beam::receptor::{Receptor, ReceptorError};
use crate::beam::spectrum::Spectrum;
use crate::beam::tube::TubeSpec;
use crate::detector::response::Response;
use crate::image::radiograph::Radiograph;

/// Exposure index of 1 µGy under the calibration beam (IEC 62494-1:2008).
const INDEX_PER_UGY: f64 = 100.0;

/// Pixels below this share of the open field belong to the limb: 1 cm of soft tissue at 60 kVp transmits 0.8.
const LIMB_BELOW: f64 = 0.8;

/// Smallest share of the field that counts as a limb; anything less is noise.
const LEAST_LIMB: f64 = 0.01;

impl Radiograph {
    /// Exposure index EI = 100 K, where K in µGy is the air kerma of the calibration beam RQA5 that gives the value of interest
    /// on the receptor (IEC 62494-1:2008). `None` for the expected image, which has no exposure, and if nothing is read.
    ///
    /// The value of interest is the median reading over the relevant image region: pixels in the collimated field that read less
    /// than 0.8 of the open field, or the whole field if these are fewer than 1 % of it. The calibration is without a grid,
    /// which affects only the image.
    ///
    /// # Errors
    /// [`ReceptorError`] for an invalid receptor.
    pub fn exposure_index(&self, receptor: &Receptor) -> Result<Option<f64>, ReceptorError> {
        let per_history = self.exposure_index_per_history(receptor)?;
        Ok(per_history
            .map(|index| self.histories * index)
            .filter(|index| index.is_finite()))
    }

    /// Exposure index of one history; `None` if nothing is read.
    pub(crate) fn exposure_index_per_history(
        &self,
        receptor: &Receptor,
    ) -> Result<Option<f64>, ReceptorError> {
        let kerma_ugy = self.value_of_interest_ev_cm2() / signal_ev_cm2_per_ugy(receptor)?;
        let index = INDEX_PER_UGY * kerma_ugy;
        Ok((index.is_finite() && index > 0.0).then_some(index))
    }

    /// Median reading over the relevant image region, eV/cm² per history.
    fn value_of_interest_ev_cm2(&self) -> f64 {
        let readings = self.total();
        let field: Vec<usize> = (0..readings.len()).filter(|&p| self.in_field(p)).collect();
        let is_limb =
            |pixel: &usize| f64::from(readings[*pixel]) < LIMB_BELOW * self.open_field_at(*pixel);
        let limb: Vec<usize> = field.iter().copied().filter(is_limb).collect();
        let region = match limb.len() as f64 >= LEAST_LIMB * field.len() as f64 {
            true => limb,
            false => field,
        };
        let mut values: Vec<f32> = region.into_iter().map(|pixel| readings[pixel]).collect();
        if values.is_empty() {
            return f64::NAN;
        }
        let middle = values.len() / 2;
        f64::from(*values.select_nth_unstable_by(middle, f32::total_cmp).1)
    }
}

/// Deviation index 10 lg(EI / EI_T) of IEC 62494-1:2008.
pub fn deviation_index(exposure_index: f64, target_exposure_index: f64) -> f64 {
    10.0 * (exposure_index / target_exposure_index).log10()
}

/// Reading of a receptor without grid under RQA5 at normal incidence, eV/cm² per µGy of air kerma.
fn signal_ev_cm2_per_ugy(receptor: &Receptor) -> Result<f64, ReceptorError> {
    let without_grid = Receptor {
        grid: None,
        ..receptor.clone()
    };
    let response = Response::new(&without_grid, [0.0; 2])?;
    let beam = rqa5();
    let signal_ev: f64 = beam
        .bins()
        .map(|(energy_kev, photons)| {
            let left = response.moments(energy_kev, [0.0; 2], &Vector3::z());
            1e3 * photons * left.mean_kev
        })
        .sum();
    Ok(signal_ev / (1e6 * beam.kerma_gy_cm2()))
}

/// The radiation quality RQA5 of IEC 61267:2005: 70 kV, with 21 mm of aluminium added to a tube filtered by 2.5 mm.
fn rqa5() -> Spectrum {
    let tube = TubeSpec {
        kvp: 70.0,
        anode_angle_deg: 12.0,
        filters: vec!["Al:23.5".parse().expect("a filter")],
    };
    Spectrum::tungsten(&tube).expect("inside the table of spectra")
}

#[cfg(test)]
mod tests {
    use super::*;

    /// IEC 61267 requires 6.8 mm Al; IEC 62220-1 states 30 174 photons per mm² and µGy.
    #[test]
    fn rqa5_has_the_half_value_layer_and_fluence_of_iec() {
        let beam = rqa5();
        assert!((beam.hvl1_mm_al() / 6.8 - 1.0).abs() < 0.02);
        let per_mm2_ugy = 1e-8 / beam.kerma_gy_cm2();
        assert!((per_mm2_ugy / 30_174.0 - 1.0).abs() < 0.03, "{per_mm2_ugy}");
    }
}
