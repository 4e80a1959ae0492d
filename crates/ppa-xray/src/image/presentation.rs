//! From detector energy to the grey values of a clinical radiograph: bone white, air black.

use serde::{Deserialize, Serialize};

use crate::image::radiograph::Radiograph;

/// Why a presentation cannot be used.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[error("the presentation's {what} is {found}, expected {expected}")]
pub struct PresentationError {
    /// Which parameter.
    pub what: &'static str,
    /// What it was.
    pub found: f64,
    /// What it may be.
    pub expected: &'static str,
}

/// Fixed mapping of a radiograph to grey values; never adapted to the single image.
///
/// A pixel's log exposure is compared with the bare field, a = ln(open / reading), which for the primary alone is
/// the line integral of the attenuation. Detail is lifted by an unsharp mask on a, as clinical processing
/// does, and a sigmoid window (DICOM PS3.3 C.11.2.1.3.1) turns a into grey: 1 / (1 + exp(−4 (a − centre) / width)),
/// stretched so that the bare field is black.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Presentation {
    /// Log exposure shown as middle grey.
    pub centre: f64,
    /// Width of the window in log exposure.
    pub width: f64,
    /// Power applied to the grey value after the window; above 1 darkens soft tissue.
    pub gamma: f64,
    /// Share of the local contrast that is added; 0 leaves the image as it is.
    pub detail: f64,
    /// Radius (standard deviation) of the Gaussian that local contrast is measured against, mm.
    pub detail_radius_mm: f64,
}

impl Default for Presentation {
    /// A limb at 50 to 70 kVp.
    fn default() -> Self {
        Self {
            centre: 2.2,
            width: 3.0,
            gamma: 1.0,
            detail: 0.9,
            detail_radius_mm: 12.0,
        }
    }
}

/// Readings below this share of the bare field count as this share, so that empty pixels stay finite.
const DARKEST: f64 = 1e-5;

impl Presentation {
    /// Checks that every parameter is in range.
    ///
    /// # Errors
    /// [`PresentationError`] naming the parameter.
    pub fn validate(&self) -> Result<(), PresentationError> {
        let positive = |v: f64| v.is_finite() && v > 0.0;
        for (what, found, fine, expected) in [
            ("centre", self.centre, self.centre.is_finite(), "a number"),
            (
                "width",
                self.width,
                positive(self.width),
                "a positive number",
            ),
            (
                "gamma",
                self.gamma,
                positive(self.gamma),
                "a positive number",
            ),
            (
                "detail",
                self.detail,
                self.detail == 0.0 || positive(self.detail),
                "0 or a positive number",
            ),
            (
                "detail radius in mm",
                self.detail_radius_mm,
                positive(self.detail_radius_mm),
                "a positive length",
            ),
        ] {
            if !fine {
                return Err(PresentationError {
                    what,
                    found,
                    expected,
                });
            }
        }
        Ok(())
    }

    fn grey(&self, log_exposure: f64) -> f64 {
        let sigmoid = |a: f64| 1.0 / (1.0 + (-4.0 * (a - self.centre) / self.width).exp());
        let open = sigmoid(0.0);
        ((sigmoid(log_exposure) - open) / (1.0 - open))
            .clamp(0.0, 1.0)
            .powf(self.gamma)
    }
}

impl Radiograph {
    /// Grey values 0 (black, bare field) to 65535 (white), row-major.
    ///
    /// # Errors
    /// [`PresentationError`] when a parameter is out of range.
    pub fn present(&self, presentation: &Presentation) -> Result<Vec<u16>, PresentationError> {
        presentation.validate()?;
        let log_exposure: Vec<f64> = self
            .total()
            .iter()
            .enumerate()
            .map(|(pixel, &reading)| {
                -(f64::from(reading) / self.open_field_at(pixel))
                    .max(DARKEST)
                    .ln()
            })
            .collect();
        let radius_px = presentation.detail_radius_mm / self.detector.pixel_mm;
        let blurred = if presentation.detail > 0.0 {
            gaussian_blur(&log_exposure, self.columns(), radius_px)
        } else {
            log_exposure.clone()
        };
        Ok(log_exposure
            .iter()
            .zip(&blurred)
            .map(|(&a, &base)| {
                let lifted = a + presentation.detail * (a - base);
                (65_535.0 * presentation.grey(lifted)).round() as u16
            })
            .collect())
    }
}

/// Separable Gaussian of standard deviation `sigma_px`, renormalised at the edges.
fn gaussian_blur(image: &[f64], columns: usize, sigma_px: f64) -> Vec<f64> {
    let rows = image.len() / columns;
    let reach = ((3.0 * sigma_px).ceil() as usize).min(rows.max(columns));
    let kernel: Vec<f64> = (0..=reach)
        .map(|d| (-0.5 * (d as f64 / sigma_px).powi(2)).exp())
        .collect();
    let along = |source: &[f64], length: usize, start: usize, stride: usize, target: &mut [f64]| {
        for i in 0..length {
            let (mut sum, mut weight) = (0.0, 0.0);
            for j in i.saturating_sub(reach)..(i + reach + 1).min(length) {
                let share = kernel[i.abs_diff(j)];
                sum += share * source[start + j * stride];
                weight += share;
            }
            target[start + i * stride] = sum / weight;
        }
    };
    let (mut across, mut both) = (vec![0.0; image.len()], vec![0.0; image.len()]);
    for row in 0..rows {
        along(image, columns, row * columns, 1, &mut across);
    }
    for column in 0..columns {
        along(&across, rows, column, columns, &mut both);
    }
    both
}
