//! What users of a weight file must know beside its values.

use std::collections::HashMap;
use std::path::Path;

use safetensors::SafeTensors;

use super::WeightsError;

/// Key of [`WeightsMetadata::mirror`] in safetensors and ONNX.
const MIRROR: &str = "mirror";

/// What users of a weight file must know beside its values; in the metadata of safetensors and ONNX.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
#[non_exhaustive]
pub struct WeightsMetadata {
    /// The network was trained with left limbs shown as right ones: images mirrored left to right, cameras exchanged. It must see
    /// left limbs in the same way. Written as `mirror` = `true`, and not at all otherwise.
    pub mirror: bool,
}

impl WeightsMetadata {
    /// That of a network whose left limbs are shown as right ones, or not.
    pub fn new(mirror: bool) -> Self {
        Self { mirror }
    }

    /// That of a weight file: nothing but in safetensors.
    ///
    /// # Errors
    /// If the file cannot be read.
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
        let entry = header.1.metadata().as_ref().and_then(|all| all.get(MIRROR));
        Ok(Self {
            mirror: entry.is_some_and(|value| value == "true"),
        })
    }

    /// Names and values.
    pub(super) fn entries(self) -> Option<HashMap<String, String>> {
        self.mirror
            .then(|| HashMap::from([(MIRROR.to_owned(), "true".to_owned())]))
    }
}
