//! The image receptor of an exposure, as a user describes it.

use serde::{Deserialize, Serialize};

/// What stands in the detector plane. The default takes the whole energy of every photon.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Receptor {
    /// What turns photons into signal.
    pub model: DetectorModel,
    /// Anti-scatter grid on top.
    pub grid: Option<AntiScatterGrid>,
}

/// Energy that a photon leaves in the detector.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
#[serde(rename_all = "snake_case", deny_unknown_fields)]
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

/// 75 to 80 % is what makers of columnar CsI quote (Zhao, Ristić, Rowlands, Med. Phys. 31 (2004) 2594,
/// doi:10.1118/1.1782676).
fn default_packing() -> f64 {
    0.8
}

/// A linear anti-scatter grid: thin absorbing strips with spacers between them, seen as a mean over the strips' phase,
/// as a moving grid is.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
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
    /// Distance of the line that the strips point to, mm; none for parallel strips. The grid is centred on the detector.
    #[serde(default)]
    pub focus_mm: Option<f64>,
    /// Device axis that the strips run along.
    #[serde(default)]
    pub lines_along: LinesAlong,
}

/// Device axis that the strips of a grid run along.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
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

fn default_interspace() -> String {
    "aluminium".to_owned()
}

/// Why an image receptor cannot be simulated.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum ReceptorError {
    /// A number out of range.
    #[error("{what} is {found}, expected {expected}")]
    Number {
        /// Which number.
        what: &'static str,
        /// What it was.
        found: f64,
        /// What it may be.
        expected: &'static str,
    },
    /// Strips as wide as their spacing.
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
    /// A material that is not in the library.
    #[error("the grid's {part} is of an unknown material: {message}")]
    Material {
        /// Strips or spaces.
        part: &'static str,
        /// What the library said.
        message: String,
    },
}

/// Refuses a number outside a range; NaN is outside.
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
