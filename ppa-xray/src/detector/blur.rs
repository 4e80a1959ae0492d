//! Blur of a converter: spread of light over the pixels, in the signal and in its noise.
//!
//! A photon's light is spread by the converter's MTF T and collected by square pixels. The signal of a structure that the
//! pixels resolve is thus multiplied by T, as the pixels' aperture is already part of the image. The noise power spectrum of
//! independent photons is that of white noise times
//!
//! Σ T²(f + k) sinc²(fx + kx) sinc²(fy + ky) over all k, f in cycles per pixel.
//!
//! Blurring pixels that have counted entire photons would give T² instead, which is too much noise below the Nyquist frequency. So an
//! image whose noise is drawn has noise and signal spread separately, and in one whose photons are counted each photon is first spread
//! over a small square.
//!
//! If the blur depends on the depth of the interaction, noise is blurred less than the signal: by N instead of T in the sum above, see
//! [`Lubberts`].

use std::f64::consts::TAU;

use nalgebra::DMatrix;
use serde::{Deserialize, Serialize};

use crate::beam::receptor::{Blur, ReceptorError};
use crate::detector::kernel::{Kernel, frequencies};
use crate::detector::lubberts::{Displacement, Lubberts};
use crate::detector::mtf::{Mtf, sinc};

/// The blur of a converter on pixels of one size.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct Spread {
    mtf: Mtf,
    /// Difference between noise and signal; `None` if there is none.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    lubberts: Option<Lubberts>,
    /// Side of the square over which counted photons are spread, in pixels; at most 1.
    spot_pixels: f64,
}

impl Spread {
    /// # Errors
    /// [`ReceptorError`] for invalid numbers, and for a curve that is not that of a converter.
    pub fn of(blur: &Blur, pixel_mm: f64) -> Result<Self, ReceptorError> {
        let mtf = Mtf::of(blur, pixel_mm)?;
        let lubberts = Lubberts::of(blur, pixel_mm)?;
        let noise = lubberts.as_ref().map_or(&mtf, |lubberts| &lubberts.noise);
        let spot_pixels = spot_with_the_right_variance(noise);
        Ok(Self {
            mtf,
            lubberts,
            spot_pixels,
        })
    }

    /// Side of the square over which counted photons are spread, in pixels.
    pub fn spot_pixels(&self) -> f64 {
        self.spot_pixels
    }

    /// Transfer of the signal at a frequency in cycles per pixel.
    pub fn transfer(&self, frequency: f64) -> f64 {
        self.mtf.at(frequency)
    }

    /// Displacement of photons before they are counted; `None` if they are not displaced.
    pub fn displacement(&self) -> Option<&Displacement> {
        self.lubberts
            .as_ref()
            .map(|lubberts| &lubberts.displacement)
    }

    /// The kernel for the expected signal of pixels.
    pub fn of_signal(&self) -> Kernel {
        Kernel::of_transfer(self.reach(), |f| self.mtf.plane(f))
    }

    /// The kernel from the expected signal of pixels to their counts of displaced photons; `None` if photons are not displaced.
    pub fn of_displacement(&self) -> Option<Kernel> {
        let displacement = self.displacement()?;
        Some(Kernel::of_transfer(self.reach(), |f| displacement.plane(f)))
    }

    /// The kernel that converts white noise to that of the detector.
    pub fn of_white_noise(&self) -> Kernel {
        Kernel::of_transfer(self.reach(), |f| self.noise().noise_power(f).map(f64::sqrt))
    }

    /// The kernel for pixels that have counted photons spread over the spot, and the kernel for the squares they counted.
    pub fn of_counts(&self) -> [Kernel; 2] {
        let spot = |f: f64| sinc(self.spot_pixels * f);
        let kernel = Kernel::of_transfer(self.reach(), |f| {
            let plane = self.noise().plane(f);
            plane.map_with_location(|i, j, value| value / (spot(f[i]) * spot(f[j])))
        });
        let power = counted_power(self.noise(), self.spot_pixels, &frequencies(FREQUENCIES));
        let squares = kernel.squared(power.mean());
        [kernel, squares]
    }

    /// Transfer of a photon's light, the same for all photons, after their displacement.
    fn noise(&self) -> &Mtf {
        self.lubberts
            .as_ref()
            .map_or(&self.mtf, |lubberts| &lubberts.noise)
    }

    /// Radius of the kernels. Their transfer functions have a kink at Nyquist, so they extend slightly beyond the light.
    fn reach(&self) -> usize {
        self.mtf.reach().max(12)
    }
}

/// Frequencies along each axis at which the variance of a pixel is summed.
const FREQUENCIES: usize = 32;

/// Side of the spot for which pixels have the variance of the detector: from 0, a sharp spot, to 1.
fn spot_with_the_right_variance(mtf: &Mtf) -> f64 {
    let frequencies = frequencies(FREQUENCIES);
    let expected = mtf.noise_power(&frequencies).mean();
    let (mut low, mut high) = (0.0, 1.0);
    for _ in 0..20 {
        let middle = 0.5 * (low + high);
        if counted_power(mtf, middle, &frequencies).mean() > expected {
            low = middle;
        } else {
            high = middle;
        }
    }
    high
}

/// Noise power of photons that are spread over a spot, counted by pixels, and blurred by T over the spot's MTF.
///
/// The photons shared by two pixels follow from the triangle of a pixel with itself, smoothed by that of the spot of side w:
/// 1 − w/3 for the same pixel, w/6 for neighbours.
fn counted_power(mtf: &Mtf, spot: f64, frequencies: &[f64]) -> DMatrix<f64> {
    let along = |f: f64| (1.0 - spot / 3.0 * (1.0 - (TAU * f).cos())) / sinc(spot * f).powi(2);
    let plane = mtf.plane(frequencies);
    plane.map_with_location(|i, j, value| {
        value * value * along(frequencies[i]) * along(frequencies[j])
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Spread photons have the noise power of the detector: the variance of a pixel to 1 %, and the power at every frequency
    /// to 3 % for blurs for which a spot of a pixel is sufficient; for stronger ones up to 12 % too much, where little is left.
    #[test]
    fn counted_photons_have_nearly_the_noise_power_of_the_detector() {
        for (h_mm2, pixel_mm, most) in [
            (0.005, 0.15, 1.03),
            (0.02, 0.15, 1.03),
            (0.45, 1.0, 1.03),
            (0.45, 0.5, 1.03),
            (0.45, 0.2, 1.08),
            (0.45, 0.15, 1.11),
            (0.45, 0.1, 1.13),
        ] {
            let spread = Spread::of(&Blur::lorentzian(h_mm2), pixel_mm).unwrap();
            let frequencies = frequencies(FREQUENCIES);
            let expected = spread.mtf.noise_power(&frequencies);
            let found = counted_power(&spread.mtf, spread.spot_pixels, &frequencies);
            let plain = spread.mtf.plane(&frequencies).map(|t| t * t);
            let ratio = found.component_div(&expected);
            println!(
                "H {h_mm2} mm², {pixel_mm} mm: spot {:.3}, power {:.3} to {:.3}, variance {:.3}; without spot {:.2}, {:.3}",
                spread.spot_pixels,
                ratio.min(),
                ratio.max(),
                found.mean() / expected.mean(),
                plain.component_div(&expected).max(),
                plain.mean() / expected.mean(),
            );
            assert!((found.mean() / expected.mean() - 1.0).abs() < 0.011);
            assert!(ratio.min() > 0.96 && ratio.max() < most);
        }
    }

    /// The sums of squares of the kernels agree with their powers.
    #[test]
    fn kernels_have_the_gain_of_their_power() {
        let spread = Spread::of(&Blur::lorentzian(0.45), 0.3).unwrap();
        let power = spread.mtf.noise_power(&frequencies(64)).mean();
        let gain = spread.of_white_noise().noise_gain();
        assert!((gain / power - 1.0).abs() < 2e-3, "{gain} {power}");
        let signal = spread.of_signal().noise_gain();
        let expected = spread.mtf.plane(&frequencies(64)).map(|t| t * t).mean();
        assert!(
            (signal / expected - 1.0).abs() < 2e-3,
            "{signal} {expected}"
        );
    }
}
