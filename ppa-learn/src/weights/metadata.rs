//! Metadata of weight files.

use std::collections::BTreeMap;
use std::path::Path;

use safetensors::SafeTensors;

use super::WeightsError;
use crate::network::{CORRECTION_UNIT_DEG, Targets};

/// Key of [`WeightsMetadata::mirror`] in safetensors and ONNX.
const MIRROR: &str = "mirror";
/// Key of the unit of corrections in safetensors and ONNX.
const CORRECTION_UNIT: &str = "correction_unit_deg";

/// Information that users of a weight file need in addition to its values, stored in the metadata of safetensors and ONNX.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
#[non_exhaustive]
pub struct WeightsMetadata {
    /// Whether the network was trained with left limbs shown as right ones: images mirrored left to right, cameras exchanged. It must
    /// see left limbs in the same way. Written as `mirror` = `true`, and omitted if false.
    pub mirror: bool,
    /// Targets of the network. Corrections are written as `correction_unit_deg` = `30`: degrees per unit of the second output.
    pub targets: Targets,
}

impl WeightsMetadata {
    /// Makes the metadata of a network.
    pub fn new(mirror: bool, targets: Targets) -> Self {
        Self { mirror, targets }
    }

    /// Reads the metadata of a weight file; the default for files other than safetensors.
    ///
    /// # Errors
    /// If the file cannot be read, or its corrections have another unit.
    pub fn read(path: &Path) -> Result<Self, WeightsError> {
        if path
            .extension()
            .is_none_or(|extension| extension != "safetensors")
        {
            return Ok(Self::default());
        }
        let unreadable = |source: Box<dyn std::error::Error + Send + Sync>| WeightsError::Read {
            path: path.to_owned(),
            source,
        };
        let bytes = ppa_core::regular_file::read(path).map_err(|error| unreadable(error.into()))?;
        let header =
            SafeTensors::read_metadata(&bytes).map_err(|error| unreadable(error.into()))?;
        let entry = |key| header.1.metadata().as_ref().and_then(|all| all.get(key));
        let targets = match entry(CORRECTION_UNIT) {
            None => Targets::Quality,
            Some(unit) if *unit == CORRECTION_UNIT_DEG.to_string() => Targets::QualityAndCorrection,
            Some(unit) => {
                let message =
                    format!("{CORRECTION_UNIT} is {unit:?}, expected \"{CORRECTION_UNIT_DEG}\"");
                return Err(unreadable(message.into()));
            }
        };
        Ok(Self {
            mirror: entry(MIRROR).is_some_and(|value| value == "true"),
            targets,
        })
    }

    /// Returns names and values, sorted so that the same metadata give the same bytes.
    pub(super) fn entries(self) -> BTreeMap<String, String> {
        let mirror = self.mirror.then(|| (MIRROR.to_owned(), "true".to_owned()));
        let unit = (self.targets == Targets::QualityAndCorrection)
            .then(|| (CORRECTION_UNIT.to_owned(), CORRECTION_UNIT_DEG.to_string()));
        mirror.into_iter().chain(unit).collect()
    }
}
