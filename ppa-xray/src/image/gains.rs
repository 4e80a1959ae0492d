//! Gains of the pixels in a radiograph.

use crate::detector::gains::Gains;
use crate::image::radiograph::Radiograph;

impl Radiograph {
    /// Multiplies the photon layers and their standard errors by the gains of the pixels; the sums over the image stay those of the
    /// arriving energy.
    ///
    /// Electronic noise arises after the pixels and is added later.
    #[must_use]
    pub(crate) fn with_gains(mut self, gains: &Gains) -> Self {
        for layer in &mut self.layers {
            gains.apply(&mut layer.value, 1);
            gains.apply(&mut layer.sigma, 1);
        }
        gains.apply(&mut self.single_scatter_covariance, 2);
        self
    }
}
