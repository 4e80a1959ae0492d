//! Readout of the pixels: blur of the converter and the size of the electronic noise.

use serde::{Deserialize, Serialize};

use crate::beam::detector::Detector;
use crate::beam::receptor::{Receptor, ReceptorError, require};
use crate::detector::blur::Spread;
use crate::detector::gains::Gains;
use crate::detector::lubberts::Displacement;
use crate::transport::tally::Moments;

/// Blur and electronic noise, ready to be applied.
///
/// Blur acts on every layer and on its quantum noise, see [`Spread`]. Then each pixel's gain is applied and electronic noise is added.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct Readout {
    blur: Option<Spread>,
    electronic_noise_kev: f64,
    #[serde(default, skip_serializing_if = "Gains::are_even")]
    gains: Gains,
}

/// One image plane, row-major, eV/cm² per history.
#[derive(Debug, Clone, PartialEq)]
pub struct Layer {
    /// Energy that arrives at the pixel, per area and per history.
    pub value: Vec<f32>,
    /// Standard error of `value`.
    pub sigma: Vec<f32>,
}

/// A layer whose noise was drawn pixel by pixel before blur; eV/cm² per history.
pub(crate) struct DrawnLayer {
    /// Expected signal.
    pub expected: Vec<f32>,
    /// Standard error of the expected signal, correlated between neighbouring pixels.
    pub shared_sigma: Vec<f32>,
    /// Quantum noise and its variance, independent from pixel to pixel; `None` for the expected image.
    pub noise: Option<[Vec<f32>; 2]>,
}

impl Readout {
    /// # Errors
    /// [`ReceptorError`] naming the invalid number.
    pub fn new(receptor: &Receptor, detector: &Detector) -> Result<Self, ReceptorError> {
        let what = "the electronic noise per pixel in keV";
        let electronic_noise_kev = receptor.electronic_noise_kev;
        require(what, electronic_noise_kev, 0.0..=1e9, "0 to 1e9")?;
        let blur = receptor.blur.as_ref();
        Ok(Self {
            blur: blur
                .map(|blur| Spread::of(blur, detector.pixel_mm))
                .transpose()?,
            electronic_noise_kev,
            gains: Gains::of(receptor)?,
        })
    }

    /// Gains of the pixels.
    pub fn gains(&self) -> &Gains {
        &self.gains
    }

    /// Side in pixels of the square over which each counted photon is spread; 0 without blur.
    pub fn spot_pixels(&self) -> f64 {
        self.blur.as_ref().map_or(0.0, Spread::spot_pixels)
    }

    /// Signal transfer of the blur at a frequency in cycles per pixel; `None` without blur.
    pub fn transfer(&self, frequency: f64) -> Option<f64> {
        self.blur.as_ref().map(|blur| blur.transfer(frequency))
    }

    /// Displacement applied to photons before they are counted; `None` if they are not displaced.
    pub fn displacement(&self) -> Option<&Displacement> {
        self.blur.as_ref().and_then(Spread::displacement)
    }

    /// Expected moments of displaced photons, from the moments without displacement; `None` where both are the same.
    pub fn displaced(&self, moments: &[Moments], columns: usize) -> Option<Vec<Moments>> {
        let kernel = self.blur.as_ref()?.of_displacement()?;
        let spread = |of: fn(&Moments) -> f64| {
            let plane: Vec<f32> = moments.iter().map(|pixel| of(pixel) as f32).collect();
            kernel.apply(&plane, columns)
        };
        let mean_kev = spread(|pixel| pixel.mean_kev);
        let square_kev2 = spread(|pixel| pixel.square_kev2);
        // Next to sharp edges the kernel rings to just below 0, where the ratio of both would be arbitrary.
        let quanta_kev = moments.iter().filter(|pixel| pixel.mean_kev > 0.0);
        let quanta_kev = quanta_kev.map(|pixel| pixel.square_kev2 / pixel.mean_kev);
        let [least_kev, most_kev] = quanta_kev.fold([f64::MAX, 0.0], |[least, most], kev| {
            [kev.min(least), kev.max(most)]
        });
        let displaced = mean_kev.into_iter().zip(square_kev2).map(|(mean, square)| {
            let (mean_kev, square_kev2) = (f64::from(mean), f64::from(square));
            if mean_kev <= 0.0 {
                return Moments::default();
            }
            let quantum_kev = (square_kev2 / mean_kev).max(least_kev).min(most_kev);
            Moments {
                mean_kev,
                square_kev2: mean_kev * quantum_kev,
            }
        });
        Some(displaced.collect())
    }

    /// Reads out pixels that counted photons one by one; standard errors come from the squares they counted.
    pub fn counted(&self, layers: [Layer; 4], columns: usize) -> [Layer; 4] {
        let Some(blur) = &self.blur else {
            return layers;
        };
        let [kernel, squares] = blur.of_counts();
        layers.map(|layer| {
            let variance: Vec<f32> = layer.sigma.iter().map(|sigma| sigma * sigma).collect();
            Layer {
                value: kernel.apply(&layer.value, columns),
                sigma: roots(squares.apply(&variance, columns)),
            }
        })
    }

    /// Reads out pixels whose noise was drawn.
    ///
    /// The error of the expected signal is correlated over more than the width of the blur, so the blur leaves it unchanged.
    pub fn drawn(&self, layers: [DrawnLayer; 4], columns: usize) -> [Layer; 4] {
        let kernels = self.blur.as_ref().map(|blur| {
            let noise = blur.of_white_noise();
            let variance = noise.squared(noise.noise_gain());
            (blur.of_signal(), noise, variance)
        });
        layers.map(|layer| {
            let DrawnLayer {
                mut expected,
                shared_sigma,
                mut noise,
            } = layer;
            if let Some((of_signal, of_noise, of_variance)) = &kernels {
                expected = of_signal.apply(&expected, columns);
                noise = noise.map(|[deviation, variance]| {
                    [
                        of_noise.apply(&deviation, columns),
                        of_variance.apply(&variance, columns),
                    ]
                });
            }
            let Some([deviation, mut variance]) = noise else {
                return Layer {
                    value: expected,
                    sigma: shared_sigma,
                };
            };
            for ((value, deviation), (variance, sigma)) in expected
                .iter_mut()
                .zip(deviation)
                .zip(variance.iter_mut().zip(shared_sigma))
            {
                *value += deviation;
                *variance += sigma * sigma;
            }
            Layer {
                value: expected,
                sigma: roots(variance),
            }
        })
    }

    /// Standard deviation of the electronic noise of a pixel, keV.
    pub fn electronic_noise_kev(&self) -> f64 {
        self.electronic_noise_kev
    }
}

/// Square roots of the variances. Rounding may leave a variance just below 0.
fn roots(mut variance: Vec<f32>) -> Vec<f32> {
    for value in &mut variance {
        *value = value.max(0.0).sqrt();
    }
    variance
}
