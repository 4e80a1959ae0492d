//! The last steps of an image: blur of the converter, noise of the electronics.

use serde::{Deserialize, Serialize};

use crate::beam::projection::Detector;
use crate::detector::blur::GaussianSum;
use crate::detector::receptor::{Receptor, ReceptorError, require};
use crate::image::radiograph::{Layer, Radiograph};
use crate::philox::Philox;
use crate::transport::stream::Stream;

/// Blur and electronic noise, ready to be applied.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct Readout {
    blur: Option<GaussianSum>,
    electronic_noise_kev: f64,
}

impl Readout {
    /// # Errors
    /// [`ReceptorError`] naming the number at fault.
    pub fn new(receptor: &Receptor, detector: &Detector) -> Result<Self, ReceptorError> {
        let what = "the electronic noise per pixel in keV";
        let electronic_noise_kev = receptor.electronic_noise_kev;
        require(what, electronic_noise_kev, 0.0..=1e9, "0 to 1e9")?;
        let blur = receptor.blur.as_ref();
        Ok(Self {
            blur: blur
                .map(|blur| GaussianSum::of(blur, detector.pixel_mm))
                .transpose()?,
            electronic_noise_kev,
        })
    }

    /// The image that is read out of a detector in which photons have left `image`.
    ///
    /// Blur spreads what a photon leaves over the pixels, so it acts on every layer and its quantum noise alike; the standard
    /// errors become those of the blurred pixels, taken as independent before and even over the reach of the blur.
    /// Electronic noise comes on top, in a layer of its own; it does not depend on the exposure, so per history it
    /// falls with the histories that the image stands for.
    pub fn read(&self, mut image: Radiograph) -> Radiograph {
        let columns = image.columns();
        if let Some(blur) = &self.blur {
            let gain = blur.noise_gain() as f32;
            for layer in &mut image.layers {
                layer.value = blur.apply(&layer.value, columns);
                let variance: Vec<f32> = layer.sigma.iter().map(|sigma| sigma * sigma).collect();
                layer.sigma = blur.apply(&variance, columns);
                for sigma in &mut layer.sigma {
                    *sigma = (gain * *sigma).max(0.0).sqrt();
                }
            }
        }
        if self.electronic_noise_kev > 0.0 && image.histories.is_finite() {
            let ev_cm2 = 1e3 / image.detector.pixel_cm2() / image.histories;
            let sigma = self.electronic_noise_kev * ev_cm2;
            let draw = |pixel: usize| {
                let mut rng = Philox::new(image.seed, Stream::ElectronicNoise as u32, pixel as u64);
                // Box and Muller; 1 − u lies in (0, 1].
                let radius = (-2.0 * (1.0 - rng.unit()).ln()).sqrt();
                (sigma * radius * (std::f64::consts::TAU * rng.unit()).cos()) as f32
            };
            let pixels = image.detector.pixels();
            image.electronic = Some(Layer {
                value: (0..pixels).map(draw).collect(),
                sigma: vec![sigma as f32; pixels],
            });
        }
        image
    }
}
