//! Labels of radiographs that have been regenerated since.

use super::{Layout, Published, PublishedError};
use crate::labels::{LabelFile, LabelName};
use crate::layout::LimbId;
use crate::manifest::Manifest;

/// Labels of a limb whose radiographs differ from those in the manifest.
pub(super) struct Outdated {
    pub limb: LimbId,
    pub steps: Vec<u32>,
}

/// Finds all outdated labels in a dataset's labels of a name, as far as they have hashes; `manifest` is read only if any has one.
pub(super) fn outdated(
    dataset: &Published,
    labels: Option<&LabelName>,
    manifest: impl FnOnce() -> Result<Manifest, PublishedError>,
) -> Result<Vec<Outdated>, PublishedError> {
    if dataset.layout == Layout::Specimen {
        return Ok(Vec::new());
    }
    let mut limbs: Vec<_> = dataset.pairs.iter().map(|pair| pair.limb).collect();
    limbs.dedup();
    let mut bound = Vec::new();
    for limb in limbs {
        let file = LabelFile::read_named(&dataset.root, limb, labels)?;
        bound.extend(file.filter(LabelFile::is_bound).map(|file| (limb, file)));
    }
    if bound.is_empty() {
        return Ok(Vec::new());
    }
    let manifest = manifest()?;
    let of_limb = |(limb, file): (LimbId, LabelFile)| Outdated {
        limb,
        steps: file.outdated(&manifest, limb),
    };
    let all = bound.into_iter().map(of_limb);
    Ok(all.filter(|found| !found.steps.is_empty()).collect())
}
