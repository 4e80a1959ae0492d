//! Conversion of detector energy to the grey values of a clinical radiograph: bone white, air black.

use serde::{Deserialize, Serialize};

use crate::image::latitude::LatitudeReduction;
use crate::image::radiograph::Radiograph;

/// Why a presentation cannot be used.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum PresentationError {
    /// A parameter is out of range.
    #[error("the presentation's {what} is {found}, expected {expected}")]
    Parameter {
        /// Name of the parameter.
        what: &'static str,
        /// Value found.
        found: f64,
        /// Allowed range.
        expected: &'static str,
    },
    /// No protocol has the given name.
    #[error("no presentation is named {found:?}; known presentations are {}", known.join(", "))]
    Protocol {
        /// Name given.
        found: String,
        /// Names of all protocols.
        known: Vec<&'static str>,
    },
    /// A layer has more or fewer pixels than the detector.
    #[error("layer {layer} has {found} values, expected {expected}, one per pixel")]
    Pixels {
        /// Name of the layer.
        layer: &'static str,
        /// Number of values or standard errors in the layer.
        found: usize,
        /// Pixels of the detector.
        expected: usize,
    },
}

/// Fixed mapping of a radiograph to grey values, never adapted to a single image.
///
/// A pixel's log exposure is relative to the bare field, a = ln(open / reading), which for the primary alone is
/// the line integral of the attenuation. Its range from skin to hindfoot is too large to display with the contrast of a joint space. As in
/// clinical multi-scale processing (Vuylsteke and Schoeters, Proc. SPIE 2167 (1994) 551; Stahl, Aach and Dippel, Med. Phys. 27
/// (2000) 56), large areas and fine detail are therefore treated separately:
///
/// 1. Latitude reduction: a becomes t = ln(1 + r a) / r, which divides contrast by 1 + r a. The bare field stays 0, and t increases
///    monotonically with attenuation.
/// 2. In the bands of a Laplacian pyramid of t, faint detail above the noise regains the contrast lost in step 1, and is increased by the
///    share `detail`. The noise is known from the standard errors of the radiograph. Large areas and strong edges stay as reduced.
/// 3. A sigmoid window (DICOM PS3.3 C.11.2.1.3.1) over the t of its ends turns t into grey: 1 / (1 + exp(−4 (t − middle) / (high − low))),
///    stretched so that the bare field is black. Pixels outside the field are black.
///
/// In a file it is a table of these numbers, or a protocol and the values that differ: `{ protocol = "ankle_lateral", width = 4.5 }`.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(try_from = "PresentationTable")]
#[non_exhaustive]
pub struct Presentation {
    /// Middle of the window in log exposure.
    pub centre: f64,
    /// Width of the window in log exposure.
    pub width: f64,
    /// Latitude reduction: contrast of large areas and strong edges is divided by 1 + this × log exposure; 0 leaves it as it is.
    pub latitude_reduction: f64,
    /// Share by which the contrast of faint detail is increased; 0 leaves it as it is in log exposure.
    pub detail: f64,
    /// Size above which detail gets less than half of the enhancement, mm.
    pub detail_mm: f64,
    /// Local contrast (root mean square) in log exposure above which detail gets less than half of the enhancement, so that strong edges
    /// get no halo.
    pub edge: f64,
}

/// A limb at 50 to 70 kVp.
const LIMB: Presentation = Presentation {
    centre: 2.1,
    width: 5.8,
    latitude_reduction: 0.5,
    detail: 1.5,
    detail_mm: 8.0,
    edge: 0.12,
};

/// Fixed presentations by name. The hindfoot is thicker from the front than from the side.
const PROTOCOLS: &[(&str, Presentation)] = &[
    ("limb", LIMB),
    (
        "ankle_ap",
        Presentation {
            centre: 2.3,
            width: 6.2,
            ..LIMB
        },
    ),
    (
        "ankle_mortise",
        Presentation {
            centre: 2.2,
            width: 6.0,
            ..LIMB
        },
    ),
    (
        "ankle_lateral",
        Presentation {
            centre: 1.9,
            width: 5.2,
            ..LIMB
        },
    ),
];

/// A presentation as written in a file: a protocol, and the values that differ from it.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct PresentationTable {
    /// Name of a fixed presentation, such as `limb` or `ankle_lateral`; the other keys replace its values. `limb` by default.
    protocol: Option<String>,
    /// Middle of the window in log exposure.
    centre: Option<f64>,
    /// Width of the window in log exposure.
    width: Option<f64>,
    /// Latitude reduction: contrast of large areas and strong edges is divided by 1 + this × log exposure; 0 leaves it as it is.
    latitude_reduction: Option<f64>,
    /// Share by which the contrast of faint detail is increased; 0 leaves it as it is in log exposure.
    detail: Option<f64>,
    /// Size above which detail gets less than half of the enhancement, mm.
    detail_mm: Option<f64>,
    /// Local contrast (root mean square) in log exposure above which detail gets less than half of the enhancement.
    edge: Option<f64>,
}

impl TryFrom<PresentationTable> for Presentation {
    type Error = PresentationError;

    fn try_from(table: PresentationTable) -> Result<Self, PresentationError> {
        let base = table
            .protocol
            .map_or(Ok(LIMB), |name| Self::protocol(&name))?;
        Ok(Self {
            centre: table.centre.unwrap_or(base.centre),
            width: table.width.unwrap_or(base.width),
            latitude_reduction: table.latitude_reduction.unwrap_or(base.latitude_reduction),
            detail: table.detail.unwrap_or(base.detail),
            detail_mm: table.detail_mm.unwrap_or(base.detail_mm),
            edge: table.edge.unwrap_or(base.edge),
        })
    }
}

impl Default for Presentation {
    /// The protocol `limb`.
    fn default() -> Self {
        LIMB
    }
}

/// Log exposure above which a pixel counts as covered when a window is fitted.
const COVERED: f64 = 0.1;

/// Share of the covered pixels that a fitted window cuts off at either end.
const TAIL: f64 = 0.02;

impl Presentation {
    /// Names of the fixed presentations.
    pub fn protocols() -> impl Iterator<Item = &'static str> {
        PROTOCOLS.iter().map(|(name, _)| *name)
    }

    /// A fixed presentation by name.
    ///
    /// # Errors
    /// [`PresentationError::Protocol`] with the names of all protocols.
    pub fn protocol(name: &str) -> Result<Self, PresentationError> {
        let found = PROTOCOLS.iter().find(|(known, _)| *known == name);
        found
            .map(|(_, presentation)| *presentation)
            .ok_or_else(|| PresentationError::Protocol {
                found: name.to_owned(),
                known: Self::protocols().collect(),
            })
    }

    /// The same presentation with a window fitted to one image, for viewing unknown images: from the 2nd to the 98th percentile of the
    /// covered pixels. Use a fixed window for images that are to be compared or used for training.
    ///
    /// # Errors
    /// [`PresentationError`] if a parameter is out of range, or if the image is bare or uniform, so that no window fits it.
    pub fn fitted(&self, radiograph: &Radiograph) -> Result<Self, PresentationError> {
        let reduction = self.reduction();
        let mut covered = radiograph.enhanced_log_exposure(self)?;
        covered.retain(|t| f64::from(*t) > reduction.reduced(COVERED));
        covered.sort_unstable_by(f32::total_cmp);
        let percentile = |share: f64| -> f64 {
            let index = (share * covered.len().saturating_sub(1) as f64).round() as usize;
            let shown = covered.get(index).copied().map_or(0.0, f64::from);
            reduction.restored(shown)
        };
        let (low, high) = (percentile(TAIL), percentile(1.0 - TAIL));
        let fitted = Self {
            centre: 0.5 * (low + high),
            width: high - low,
            ..*self
        };
        fitted.validate()?;
        Ok(fitted)
    }

    /// Checks that every parameter is in range.
    ///
    /// # Errors
    /// [`PresentationError::Parameter`] naming the parameter.
    pub fn validate(&self) -> Result<(), PresentationError> {
        let positive = |v: f64| v.is_finite() && v > 0.0;
        let positive_number = "a positive number";
        for (what, found, fine, expected) in [
            ("centre", self.centre, self.centre.is_finite(), "a number"),
            ("width", self.width, positive(self.width), positive_number),
            (
                "latitude reduction",
                self.latitude_reduction,
                (0.0..=10.0).contains(&self.latitude_reduction),
                "0 to 10",
            ),
            (
                "detail",
                self.detail,
                (0.0..=10.0).contains(&self.detail),
                "0 to 10",
            ),
            (
                "detail size in mm",
                self.detail_mm,
                positive(self.detail_mm),
                "a positive length",
            ),
            ("edge", self.edge, positive(self.edge), positive_number),
        ] {
            if !fine {
                return Err(PresentationError::Parameter {
                    what,
                    found,
                    expected,
                });
            }
        }
        Ok(())
    }

    pub(super) fn reduction(&self) -> LatitudeReduction {
        LatitudeReduction(self.latitude_reduction)
    }

    /// Grey value, 0 (black, bare field) to 1 (white), of a log exposure after latitude reduction.
    pub(super) fn grey(&self) -> impl Fn(f64) -> f64 {
        let reduction = self.reduction();
        let [low, high] = [-0.5, 0.5].map(|end| reduction.reduced(self.centre + end * self.width));
        let sigmoid =
            move |t: f64| 1.0 / (1.0 + (-4.0 * (t - 0.5 * (low + high)) / (high - low)).exp());
        let open = sigmoid(0.0);
        move |reduced| ((sigmoid(reduced) - open) / (1.0 - open)).clamp(0.0, 1.0)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_table_names_a_protocol_and_what_differs() {
        let read = toml::from_str::<Presentation>;
        assert_eq!(read("").unwrap(), Presentation::default());
        let lateral = Presentation::protocol("ankle_lateral").unwrap();
        let read_lateral = read("protocol = \"ankle_lateral\"\nwidth = 3.0").unwrap();
        assert_eq!(
            read_lateral,
            Presentation {
                width: 3.0,
                ..lateral
            }
        );
        let text = toml::to_string(&lateral).unwrap();
        assert_eq!(read(&text).unwrap(), lateral);
        let error = read("protocol = \"knee\"").unwrap_err();
        assert!(error.message().contains("ankle_mortise"), "{error}");
        assert!(read("gamma = 1.0").is_err());
        for name in Presentation::protocols() {
            Presentation::protocol(name).unwrap().validate().unwrap();
        }
    }

    /// A file written before the latitude reduction was introduced.
    #[test]
    fn a_file_without_latitude_reduction_takes_the_default() {
        let old = "centre = 2.4\nwidth = 4.0\ndetail = 2.0\ndetail_mm = 8.0\nedge = 0.12";
        let read: Presentation = toml::from_str(old).unwrap();
        assert_eq!(read.latitude_reduction, LIMB.latitude_reduction);
        assert_eq!((read.centre, read.width), (2.4, 4.0));
    }

    /// A rim of soft tissue, log exposure 0.25, and the hindfoot from the front, log exposure 5, are between black and white.
    #[test]
    fn skin_and_hindfoot_are_grey_in_every_protocol() {
        for (name, presentation) in PROTOCOLS {
            let shown = presentation.grey();
            let grey = |a: f64| shown(presentation.reduction().reduced(a));
            assert_eq!(grey(0.0), 0.0, "{name}");
            let (skin, hindfoot) = (grey(0.25), grey(5.0));
            assert!(skin > 0.06 && hindfoot < 0.9, "{name}: {skin} {hindfoot}");
            assert!((1..600).all(|i| grey(0.01 * f64::from(i)) > grey(0.01 * f64::from(i - 1))));
        }
    }

    #[test]
    fn parameters_out_of_range_are_refused() {
        for (what, broken) in [
            (
                "centre",
                Presentation {
                    centre: f64::NAN,
                    ..LIMB
                },
            ),
            ("width", Presentation { width: 0.0, ..LIMB }),
            (
                "latitude",
                Presentation {
                    latitude_reduction: -0.1,
                    ..LIMB
                },
            ),
            (
                "latitude",
                Presentation {
                    latitude_reduction: f64::NAN,
                    ..LIMB
                },
            ),
            (
                "detail",
                Presentation {
                    detail: -1.0,
                    ..LIMB
                },
            ),
            (
                "detail",
                Presentation {
                    detail: 11.0,
                    ..LIMB
                },
            ),
            (
                "size",
                Presentation {
                    detail_mm: 0.0,
                    ..LIMB
                },
            ),
            (
                "edge",
                Presentation {
                    edge: f64::INFINITY,
                    ..LIMB
                },
            ),
        ] {
            let message = broken.validate().unwrap_err().to_string();
            assert!(message.contains(what), "{message}");
        }
    }
}
