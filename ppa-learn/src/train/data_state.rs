//! Fingerprint of the training samples in a checkpoint.

use serde::{Deserialize, Serialize};
use sha2::{Digest, Sha256};

use crate::data::{Sample, SampleImage};

/// Number of samples, and hashes of their properties before any image is decoded, without the location of the dataset.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub(super) struct DataState {
    samples: usize,
    names: String,
    labels: String,
    regions: String,
    sizes: String,
}

impl DataState {
    /// Computes the state of training samples in their order, on which batches depend.
    pub fn of(samples: &[Sample]) -> Self {
        let each = |image: fn(&SampleImage) -> String| {
            hash(samples.iter().flat_map(|s| &s.images).map(image))
        };
        Self {
            samples: samples.len(),
            names: hash(samples.iter().map(|sample| {
                let files = sample.images.iter().map(|image| image.path.file_name());
                format!("{} {:?}", sample.id, files.collect::<Vec<_>>())
            })),
            labels: hash(samples.iter().map(|sample| sample.label.to_string())),
            regions: each(|image| format!("{:?}", image.roi)),
            sizes: each(|image| format!("{:?}", image.size)),
        }
    }

    /// Describes the difference from the samples of a checkpoint; `None` if there is none.
    pub fn differs(&self, before: &Self) -> Option<String> {
        if self.samples != before.samples {
            let (now, then) = (self.samples, before.samples);
            return Some(format!(
                "there are {now} training samples, but it was written with {then}"
            ));
        }
        let different = [
            ("files", self.names != before.names),
            ("labels", self.labels != before.labels),
            ("regions of interest", self.regions != before.regions),
            ("sizes of images", self.sizes != before.sizes),
        ];
        let different = different.iter().filter(|part| part.1).map(|part| part.0);
        let different = different.collect::<Vec<_>>().join(", ");
        (!different.is_empty())
            .then(|| format!("the training data have changed since: {different} differ"))
    }
}

fn hash(parts: impl Iterator<Item = String>) -> String {
    let mut hash = Sha256::new();
    for part in parts {
        hash.update(part + "\n");
    }
    let bytes = hash.finalize();
    bytes.iter().map(|byte| format!("{byte:02x}")).collect()
}
