//! The radiograph as log exposure relative to the bare field, with reduced latitude and lifted detail, and as grey values.

use crate::image::enhancement::{Lift, lifted};
use crate::image::presentation::{Presentation, PresentationError};
use crate::image::pyramid::Plane;
use crate::image::radiograph::Radiograph;

/// Lower limit of readings as a share of the bare field, which keeps empty pixels finite.
const DARKEST: f64 = 1e-5;

/// Standard error of the log exposure of a pixel without hits.
const EMPTY_SIGMA: f64 = 1.0;

impl Radiograph {
    /// Grey values 0 (black, bare field) to 65535 (white), row-major.
    ///
    /// # Errors
    /// [`PresentationError`] if a parameter is out of range, or if a layer does not have a value per pixel.
    pub fn present(&self, presentation: &Presentation) -> Result<Vec<u16>, PresentationError> {
        let enhanced = self.enhanced_log_exposure(presentation)?;
        let grey = presentation.grey();
        Ok(enhanced
            .iter()
            .enumerate()
            .map(|(pixel, &t)| {
                if self.in_field(pixel) {
                    (65_535.0 * grey(f64::from(t))).round() as u16
                } else {
                    0
                }
            })
            .collect())
    }

    /// Log exposure after latitude reduction and lifting of detail, before the window; outside the field, that of the bare field.
    pub(crate) fn enhanced_log_exposure(
        &self,
        presentation: &Presentation,
    ) -> Result<Vec<f32>, PresentationError> {
        presentation.validate()?;
        self.check_layers()?;
        let reduction = presentation.reduction();
        let (image, sigma): (Vec<f32>, Vec<f32>) = self
            .total()
            .iter()
            .zip(self.sigma())
            .enumerate()
            .map(|(pixel, (&reading, sigma))| {
                if self.in_field(pixel) {
                    let open = self.open_field_at(pixel);
                    let (a, sigma) = log_exposure(f64::from(reading), f64::from(sigma), open);
                    let t = reduction.reduced(a);
                    (t as f32, (sigma / reduction.divisor(t)) as f32)
                } else {
                    (0.0, 0.0)
                }
            })
            .unzip();
        if presentation.detail == 0.0 && presentation.latitude_reduction == 0.0 {
            return Ok(image);
        }
        let image = Plane {
            columns: self.columns(),
            rows: self.rows(),
            values: image,
        };
        let lift = Lift {
            reduction,
            detail: presentation.detail,
            size_px: presentation.detail_mm / self.detector.pixel_mm,
            edge: presentation.edge,
        };
        Ok(lifted(&image, &sigma, &lift))
    }
}

/// ln(open / reading) and its standard error.
fn log_exposure(reading: f64, sigma: f64, open: f64) -> (f64, f64) {
    let (share, sigma) = (reading / open, sigma / open);
    if share <= DARKEST {
        return (-DARKEST.ln(), EMPTY_SIGMA);
    }
    (-share.ln(), sigma / share)
}
