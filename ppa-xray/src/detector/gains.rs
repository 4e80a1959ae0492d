//! Gains of the pixels of a panel after flat-field calibration.

use ppa_core::random::Philox;
use rayon::prelude::*;
use serde::{Deserialize, Serialize};

use crate::beam::receptor::{Receptor, ReceptorError, is_first, is_zero, require};
use crate::transport::stream::Stream;

/// Gains by panel and pixel: normally distributed about 1, cut at [`CUT`] standard deviations.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub(crate) struct Gains {
    #[serde(skip_serializing_if = "is_zero")]
    error: f64,
    #[serde(skip_serializing_if = "is_first")]
    panel: u32,
}

/// Cut of the distribution. Gains of the largest error stay above 0.2; the cut reduces the standard deviation by 0.05 %.
const CUT: f64 = 4.0;

impl Gains {
    /// # Errors
    /// [`ReceptorError::Number`] for an error that is out of range.
    pub fn of(receptor: &Receptor) -> Result<Self, ReceptorError> {
        let what = "the relative standard deviation of the pixels' gains";
        require(what, receptor.gain_error, 0.0..=0.2, "0 to 0.2")?;
        if receptor.gain_error == 0.0 {
            return Ok(Self::default());
        }
        Ok(Self {
            error: receptor.gain_error,
            panel: receptor.panel,
        })
    }

    /// Whether all gains are 1.
    pub fn are_even(&self) -> bool {
        self.error == 0.0
    }

    /// The gain of a pixel by its row-major number.
    fn of_pixel(&self, pixel: usize) -> f32 {
        let mut rng = Philox::new(self.panel.into(), Stream::Gain as u32, pixel as u64);
        loop {
            let inside = rng.normals().into_iter().find(|normal| normal.abs() < CUT);
            if let Some(normal) = inside {
                return (1.0 + self.error * normal) as f32;
            }
        }
    }

    /// Multiplies row-major pixels by the given power of their gain.
    pub fn apply(&self, plane: &mut [f32], power: i32) {
        if self.are_even() {
            return;
        }
        plane
            .par_iter_mut()
            .enumerate()
            .for_each(|(pixel, value)| *value *= self.of_pixel(pixel).powi(power));
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn gains(error: f64, panel: u32) -> Vec<f32> {
        let receptor = Receptor::default().with_gain_error(error).with_panel(panel);
        let mut plane = vec![1.0; 200_000];
        Gains::of(&receptor).unwrap().apply(&mut plane, 1);
        plane
    }

    /// 200 000 pixels: the mean within 4.5 standard errors of 1, the standard deviation within 4.5 of its own, 1/√2n; panels differ.
    #[test]
    fn gains_are_normal_about_1_and_differ_by_panel() {
        let n = 200_000.0_f64;
        let [first, second] = [0, 7].map(|panel| gains(0.2, panel));
        let moment = |of: &dyn Fn(usize) -> f64| (0..first.len()).map(of).sum::<f64>() / n;
        let deviation = |gains: &[f32], i: usize| f64::from(gains[i]) - 1.0;
        let mean = moment(&|i| deviation(&first, i));
        let square = moment(&|i| deviation(&first, i).powi(2));
        let product = moment(&|i| deviation(&first, i) * deviation(&second, i));
        assert!(mean.abs() < 4.5 * 0.2 / n.sqrt(), "{mean}");
        let sigma = square.sqrt() / 0.2 / 0.9995;
        assert!((sigma - 1.0).abs() < 4.5 / (2.0 * n).sqrt(), "{sigma}");
        assert!(product.abs() < 4.5 * 0.04 / n.sqrt(), "{product}");
        assert!(first.iter().all(|&gain| (0.2..1.8).contains(&gain)));
        assert_eq!(first, gains(0.2, 0));
    }

    #[test]
    fn errors_out_of_range_are_refused() {
        for error in [-0.1, 0.21, f64::NAN] {
            let receptor = Receptor::default().with_gain_error(error);
            let message = Gains::of(&receptor).unwrap_err().to_string();
            assert!(
                message.contains("gains") && message.contains("0 to 0.2"),
                "{message}"
            );
        }
        assert!(gains(0.0, 3).iter().all(|&gain| gain == 1.0));
    }
}
