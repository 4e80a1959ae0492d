//! Conversion of the tally of the analog engine to a radiograph.
//!
//! docs/physics.md, "Analog engine and dose".

use serde::{Deserialize, Serialize};

use crate::beam::detector::Detector;
use crate::detector::open_field::OpenField;
use crate::detector::readout::{Layer, Readout};
use crate::engine::exposure::Exposure;
use crate::image::radiograph::{CategorySums, Engine, Radiograph};
use crate::transport::tally::{Category, Tally};

/// Data that convert the sums of the image to a radiograph.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct ImageSetup {
    pub detector: Detector,
    source_detector_mm: f64,
    open_field_ev_cm2: f64,
    open_field: OpenField,
    readout: Readout,
    pub histories_per_mas: Option<f64>,
}

impl ImageSetup {
    pub fn new(exposure: &Exposure) -> Self {
        let transport = &exposure.transport;
        let projection = transport.projection;
        let (open_field, open_field_ev_cm2) = OpenField::of(transport, &exposure.response);
        Self {
            detector: projection.detector,
            source_detector_mm: projection.source_detector_mm,
            open_field_ev_cm2,
            open_field,
            readout: exposure.readout.clone(),
            histories_per_mas: transport.histories_per_mas(),
        }
    }

    /// The radiograph of `histories` counted in `tally`.
    pub fn radiograph(&self, tally: &Tally, histories: u64, seed: u64) -> Radiograph {
        let n = histories as f64;
        let ev_cm2 = 1e3 / tally.raster.cell_cm2();
        let layers = Category::ALL.map(|category| {
            let (value, sigma) = tally
                .moments(category, histories)
                .iter()
                .map(|pixel| {
                    let sigma = pixel.standard_error_kev(n);
                    ((pixel.mean_kev * ev_cm2) as f32, (sigma * ev_cm2) as f32)
                })
                .unzip();
            Layer { value, sigma }
        });
        let sums = CategorySums::from_kev(|category| {
            let total = tally.total(category, histories);
            (total.mean_kev, total.standard_error_kev(n))
        });
        let layers = self.readout.counted(layers, tally.raster.columns);
        let image = Radiograph {
            detector: self.detector,
            engine: Engine::Analog,
            histories: n,
            histories_per_mas: self.histories_per_mas,
            seed,
            source_detector_mm: self.source_detector_mm,
            open_field_ev_cm2: self.open_field_ev_cm2,
            open_field: self.open_field.clone(),
            layers,
            single_scatter_covariance: Vec::new(),
            electronic: None,
            sums,
            largest_score_share: None,
        };
        let image = image.with_gains(self.readout.gains());
        image.with_electronic_noise(self.readout.electronic_noise_kev())
    }
}
