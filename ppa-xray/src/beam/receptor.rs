//! User-facing description of the image receptor of an exposure.

use serde::{Deserialize, Serialize};

use crate::setters::setters;

/// Image receptor in the detector plane. The default absorbs the whole energy of every photon.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
#[non_exhaustive]
pub struct Receptor {
    /// What turns photons into signal.
    pub model: DetectorModel,
    /// Swank factor of the collection of light or charge, which depends on the depth of an interaction: ⟨ε⟩²/⟨ε²⟩ for photons that deposit
    /// equal energies. 1 adds no noise. Columnar CsI has 0.91 to 0.93: Zhao, Ristić and Rowlands, Med. Phys. 31 (2004) 2594.
    #[serde(skip_serializing_if = "is_one")]
    pub collection_swank: f64,
    /// Anti-scatter grid on top.
    pub grid: Option<AntiScatterGrid>,
    /// Blur of the converter; when left out, pixels are sharp.
    pub blur: Option<Blur>,
    /// Standard deviation of the electronic noise of a pixel, as energy in the converter, keV.
    pub electronic_noise_kev: f64,
    /// Standard deviation of the pixel gains about 1 that remains after calibration, 0 to 0.2; the pattern is the same in every image of a
    /// panel.
    #[serde(skip_serializing_if = "is_zero")]
    pub gain_error: f64,
    /// Serial number of the panel, which selects the gains.
    #[serde(skip_serializing_if = "is_first")]
    pub panel: u32,
}

impl Default for Receptor {
    /// A detector that absorbs the entire energy of every photon, in sharp pixels without noise of its own.
    fn default() -> Self {
        Self {
            model: DetectorModel::default(),
            collection_swank: 1.0,
            grid: None,
            blur: None,
            electronic_noise_kev: 0.0,
            gain_error: 0.0,
            panel: 0,
        }
    }
}

#[expect(
    clippy::trivially_copy_pass_by_ref,
    reason = "serde calls it with a reference"
)]
fn is_one(value: &f64) -> bool {
    *value == 1.0
}

#[expect(
    clippy::trivially_copy_pass_by_ref,
    reason = "serde calls it with a reference"
)]
pub(crate) fn is_zero(value: &f64) -> bool {
    *value == 0.0
}

#[expect(
    clippy::trivially_copy_pass_by_ref,
    reason = "serde calls it with a reference"
)]
pub(crate) fn is_first(panel: &u32) -> bool {
    *panel == 0
}

/// Spread of the signal in the converter: its modulation transfer function, excluding the aperture of the pixels, which
/// is already part of the image.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case", deny_unknown_fields)]
#[non_exhaustive]
pub enum Blur {
    /// 1 / (1 + H f²), as for scintillators.
    ///
    /// H = 0.45 mm² corresponds to 0.6 mm of columnar CsI: with pixels of 0.127 mm, Samei, Image quality in two phosphor-based flat panel
    /// digital radiographic detectors, Med. Phys. 30 (2003) 1747, found a presampled MTF of 0.2 at 2.5/mm and 0.1 at 3.8/mm; this gives
    /// 0.22 and 0.09.
    Lorentzian {
        /// H, mm².
        h_mm2: f64,
        /// H of the noise, mm², 0 to that of the signal: the normalised noise power of the converter is 1 / (1 + H f²)². Less than that of
        /// the signal where the blur depends on the depth of the interaction (Lubberts, J. Opt. Soc. Am. 58 (1968) 1475); the DQE falls by
        /// the ratio of MTF² to noise power. When left out, the H of the signal.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        noise_h_mm2: Option<f64>,
    },
    /// A measured curve: a presampled MTF divided by sinc(f · pixel).
    Mtf {
        /// Frequencies, 1/mm, ascending.
        per_mm: Vec<f64>,
        /// Values, 1 at frequency 0 and falling.
        mtf: Vec<f64>,
        /// Noise transfer at the frequencies: the root of the normalised noise power of the converter, without aperture and aliases.
        /// Nowhere below the MTF. When left out, the MTF.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        noise: Option<Vec<f64>>,
    },
}

impl Blur {
    /// Returns the blur 1 / (1 + H f²) for signal and noise.
    #[must_use]
    pub fn lorentzian(h_mm2: f64) -> Self {
        Self::Lorentzian {
            h_mm2,
            noise_h_mm2: None,
        }
    }
}

/// Energy that a photon deposits in the detector.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
#[serde(rename_all = "snake_case", deny_unknown_fields)]
#[non_exhaustive]
pub enum DetectorModel {
    /// All of it.
    #[default]
    Ideal,
    /// A columnar scintillator of caesium iodide.
    Csi {
        /// Thickness of the layer, µm.
        thickness_um: f64,
        /// Share of the layer that is crystal, the rest being gaps between the columns.
        #[serde(default = "default_packing")]
        packing: f64,
    },
    /// A photoconductor of amorphous selenium.
    Selenium {
        /// Thickness of the layer, µm.
        thickness_um: f64,
    },
}

/// Columns fill about four fifths of a layer.
fn default_packing() -> f64 {
    0.8
}

/// A linear anti-scatter grid: thin absorbing strips separated by spacers.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
#[non_exhaustive]
pub struct AntiScatterGrid {
    /// Height of the strips over the width of the spaces between them.
    pub ratio: f64,
    /// Strips per cm.
    pub lines_per_cm: f64,
    /// Thickness of a strip, mm.
    #[serde(default = "default_strip_mm")]
    pub strip_mm: f64,
    /// Material of the strips.
    #[serde(default = "default_strip")]
    pub strip: String,
    /// Material of the spaces.
    #[serde(default = "default_interspace")]
    pub interspace: String,
    /// Distance of the line that the strips point to, mm; when left out, strips are parallel. The grid is centred on the detector.
    #[serde(default)]
    pub focus_mm: Option<f64>,
    /// Device axis that the strips run along.
    #[serde(default)]
    pub lines_along: LinesAlong,
    /// Whether the grid moves during the exposure, which averages images over the phase of the strips. A stationary grid, with one strip at
    /// the centre of the detector, leaves its lines in the image, and moiré where the pixels do not resolve them.
    #[serde(default = "moves", skip_serializing_if = "is_true")]
    pub moving: bool,
}

setters!(Receptor {
    with_model: model = DetectorModel,
    with_collection_swank: collection_swank = f64,
    with_grid: grid = impl Into<Option<AntiScatterGrid>>,
    with_blur: blur = impl Into<Option<Blur>>,
    with_electronic_noise_kev: electronic_noise_kev = f64,
    with_gain_error: gain_error = f64,
    with_panel: panel = u32,
});

setters!(AntiScatterGrid {
    with_strip_mm: strip_mm = f64,
    with_strip: strip = impl Into<String>,
    with_interspace: interspace = impl Into<String>,
    with_focus_mm: focus_mm = impl Into<Option<f64>>,
    with_ratio: ratio = f64,
    with_lines_per_cm: lines_per_cm = f64,
    with_lines_along: lines_along = LinesAlong,
    with_moving: moving = bool,
});

impl AntiScatterGrid {
    /// A moving grid with parallel strips of 0.05 mm of lead along device y and aluminium spaces, the default of plans.
    #[must_use]
    pub fn new(ratio: f64, lines_per_cm: f64) -> Self {
        Self {
            ratio,
            lines_per_cm,
            strip_mm: default_strip_mm(),
            strip: default_strip(),
            interspace: default_interspace(),
            focus_mm: None,
            lines_along: LinesAlong::default(),
            moving: true,
        }
    }
}

/// Device axis that the strips of a grid run along.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
#[non_exhaustive]
pub enum LinesAlong {
    /// Device x, as rows of pixels.
    X,
    /// Device y, as columns of pixels.
    #[default]
    Y,
}

fn default_strip_mm() -> f64 {
    0.05
}

fn default_strip() -> String {
    "lead".to_owned()
}

fn moves() -> bool {
    true
}

#[expect(
    clippy::trivially_copy_pass_by_ref,
    reason = "serde calls it with a reference"
)]
fn is_true(value: &bool) -> bool {
    *value
}

fn default_interspace() -> String {
    "aluminium".to_owned()
}

/// Why an image receptor cannot be simulated.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum ReceptorError {
    /// A number is out of range.
    #[error("{what} is {found}, expected {expected}")]
    Number {
        /// Name of the number.
        what: &'static str,
        /// Value found.
        found: f64,
        /// Allowed range.
        expected: &'static str,
    },
    /// The strips are as wide as their spacing or wider.
    #[error(
        "grid strips of {strip_mm} mm at {lines_per_cm} lines per cm leave no space between them: they repeat every {pitch_mm} mm"
    )]
    Strips {
        /// Thickness of a strip.
        strip_mm: f64,
        /// Strips per cm.
        lines_per_cm: f64,
        /// Distance from strip to strip.
        pitch_mm: f64,
    },
    /// The frequencies and values of an MTF or noise transfer table are not in pairs.
    #[error(
        "the numbers of frequencies and values of the {curve} table are {frequencies} and {values}, expected equal numbers of at least 1"
    )]
    MtfTable {
        /// The MTF or the noise transfer.
        curve: &'static str,
        /// Number of frequencies.
        frequencies: usize,
        /// Number of values.
        values: usize,
    },
    /// The MTF or noise transfer cannot be that of a converter.
    #[error(
        "the {curve} of {found} at {per_mm}/mm cannot be that of a converter, whose curve falls steadily: the nearest such curve has {nearest:.3} there"
    )]
    Mtf {
        /// The MTF, the noise transfer, or the ratio of both.
        curve: &'static str,
        /// Frequency, 1/mm.
        per_mm: f64,
        /// Value at that frequency.
        found: f64,
        /// Value of the sum of Gaussians that is the best fit to the curve.
        nearest: f64,
    },
    /// The noise is blurred more than the signal.
    #[error(
        "the noise transfer of {noise} at {per_mm}/mm is below the MTF of {mtf} there, expected the MTF or more"
    )]
    NoiseBelowMtf {
        /// Frequency, 1/mm.
        per_mm: f64,
        /// Noise transfer at that frequency.
        noise: f64,
        /// MTF at that frequency.
        mtf: f64,
    },
    /// A material is not in the library.
    #[error("the grid's {part} is of an unknown material: {message}")]
    Material {
        /// Either the strips or the spaces.
        part: &'static str,
        /// Message of the library.
        message: String,
    },
}

/// Returns an error for a number outside a range; NaN is outside.
pub(crate) fn require(
    what: &'static str,
    found: f64,
    range: std::ops::RangeInclusive<f64>,
    expected: &'static str,
) -> Result<(), ReceptorError> {
    if range.contains(&found) {
        Ok(())
    } else {
        Err(ReceptorError::Number {
            what,
            found,
            expected,
        })
    }
}
