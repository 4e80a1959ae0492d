//! Noise of the detector's electronics.

use ppa_core::random::Philox;

use crate::detector::readout::Layer;
use crate::image::radiograph::Radiograph;
use crate::transport::stream::Stream;

impl Radiograph {
    /// Adds electronic noise with the standard deviation `noise_kev` per pixel, as a separate layer.
    ///
    /// It does not depend on the exposure, so per history it decreases with the histories that the image represents.
    #[must_use]
    pub(crate) fn with_electronic_noise(mut self, noise_kev: f64) -> Self {
        if noise_kev > 0.0 && self.histories.is_finite() {
            let ev_cm2 = 1e3 / self.detector.pixel_cm2() / self.histories;
            let sigma = noise_kev * ev_cm2;
            let seed = self.seed;
            let draw = |pixel: usize| {
                let mut rng = Philox::new(seed, Stream::ElectronicNoise as u32, pixel as u64);
                (sigma * rng.normals()[0]) as f32
            };
            let pixels = self.detector.pixels();
            self.electronic = Some(Layer {
                value: (0..pixels).map(draw).collect(),
                sigma: vec![sigma as f32; pixels],
            });
        }
        self
    }
}
