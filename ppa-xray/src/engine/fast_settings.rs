//! Settings of the fast engine.

use serde::{Deserialize, Serialize};

use crate::beam::detector::Detector;
use crate::engine::raytrace::check_samples;
use crate::matter::compton::ComptonModel;
use crate::setters::setters;
use crate::transport::tracking::TransportError;

/// Effort of the fast engine, and the exposure that its image represents.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
#[non_exhaustive]
pub struct FastSettings {
    /// Histories whose quantum noise the image has; infinite gives the expected image.
    pub dose_histories: f64,
    /// Histories followed for multiple scatter; they start from half as many recorded first collisions, from which single scatter is
    /// summed. The error of the scatter falls with the square root of this number.
    pub scatter_histories: u64,
    /// Largest spacing of the points at which scatter is computed, mm.
    pub scatter_pixel_mm: f64,
    /// Largest number of primary rays per pixel side, where the image has edges.
    pub samples_per_side: u32,
    /// Model of Compton scattering.
    pub compton_model: ComptonModel,
    /// Seed of the image.
    pub seed: u64,
}

impl Default for FastSettings {
    /// The 2e10 histories of Laufer et al. 2026, section 3.3.
    fn default() -> Self {
        Self {
            dose_histories: 2e10,
            scatter_histories: 320_000,
            scatter_pixel_mm: 20.0,
            samples_per_side: 8,
            compton_model: ComptonModel::default(),
            seed: 0,
        }
    }
}

setters!(FastSettings {
    with_dose_histories: dose_histories = f64,
    with_scatter_histories: scatter_histories = u64,
    with_scatter_pixel_mm: scatter_pixel_mm = f64,
    with_samples_per_side: samples_per_side = u32,
    with_compton_model: compton_model = ComptonModel,
    with_seed: seed = u64,
});

impl FastSettings {
    /// Upper limit of a finite `dose_histories`: a tube load of 3e7 mAs.
    const MOST_DOSE: f64 = 1e18;

    /// Upper limit of the histories for scatter: their first collisions take about 5 GB.
    const MOST_SCATTER: u64 = 100_000_000;

    /// Upper limit of the number of scatter points before refinement; a point and those around it take about 2 kB.
    const MOST_NODES: f64 = 1e5;

    /// Checks the settings for an image on `detector`.
    ///
    /// # Errors
    /// [`TransportError::Setting`] naming the invalid number.
    pub fn check(&self, detector: &Detector) -> Result<(), TransportError> {
        let [width, height] = detector.field().size_mm();
        let along = |size_mm: f64| (size_mm / self.scatter_pixel_mm).ceil() + 1.0;
        let distance_mm = self.scatter_pixel_mm;
        for (what, found, fine, expected) in [
            (
                "the number of histories for the noise",
                self.dose_histories,
                self.dose_histories >= 1.0
                    && (self.dose_histories <= Self::MOST_DOSE
                        || self.dose_histories == f64::INFINITY),
                "1 to 1e18, or infinite for none",
            ),
            (
                "the number of histories for the scatter",
                self.scatter_histories as f64,
                (1..=Self::MOST_SCATTER).contains(&self.scatter_histories),
                "1 to 1e8",
            ),
            (
                "the distance of the scatter points in mm",
                distance_mm,
                distance_mm > 0.0
                    && distance_mm.is_finite()
                    && along(width) * along(height) <= Self::MOST_NODES,
                "a positive length that sets at most 100000 points on the detector",
            ),
        ] {
            if !fine {
                return Err(TransportError::Setting {
                    what,
                    found,
                    expected,
                });
            }
        }
        check_samples(self.samples_per_side)
    }
}
