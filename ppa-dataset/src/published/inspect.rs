//! Decodes every image of a dataset and compares it with the lists.

use std::collections::{BTreeMap, BTreeSet};
use std::path::Path;

use ppa_core::text::error_chain;
use rayon::prelude::*;
use serde::Serialize;
use sha2::{Digest, Sha256};

use super::against_lists::against_lists;
use super::convert::depth_files;
use super::{Flaw, GrayImage16, ImageFileError, Published, PublishedError, Unpaired};
use crate::files::{FileError, hex};
use crate::layout::View;
use crate::manifest::{Manifest, RoiRow};

/// What [`inspect`] found.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
pub struct Inspection {
    /// Persons.
    pub patients: usize,
    /// Limbs.
    pub limbs: usize,
    /// Image pairs.
    pub pairs: usize,
    /// Depth images.
    pub depth_images: usize,
    /// Depth images with a region of interest.
    pub regions: usize,
    /// PNG radiographs.
    pub radiographs: usize,
    /// Image pairs whose pose has a label.
    pub labelled: usize,
    /// Whether hashes were compared with `manifest.jsonl`.
    pub manifest: bool,
    /// The flaws found, in the order of the dataset.
    #[serde(skip)]
    pub flaws: Vec<Flaw>,
}

/// Reads the dataset in `root` in either layout, decodes all PNG files, and compares them with regions of interest, with each
/// other and, if present, with `manifest.jsonl` (tallies too), `dataset.json` and `checksums.sha256`. Changes nothing.
///
/// # Errors
/// [`PublishedError`] for anything that fits no layout; single images are reported as [`Flaw`]s.
pub fn inspect(root: &Path) -> Result<Inspection, PublishedError> {
    let dataset = Published::list(root)?;
    let unpaired = dataset.unpaired.iter().cloned();
    let mut flaws: Vec<_> = unpaired.map(Flaw::Unpaired).collect();
    let mut images: Vec<(&str, u32, Option<&RoiRow>)> = Vec::new();
    let (mut regions, mut depth_images) = (0, 0);
    let mut radiographs = BTreeSet::new();
    let seen: BTreeSet<_> = dataset
        .pairs
        .iter()
        .flat_map(|pair| depth_files(pair).map(|(view, _)| (pair.limb, view)))
        .collect();
    for pair in &dataset.pairs {
        let views: Vec<_> = View::ALL
            .into_iter()
            .filter_map(|view| pair.depth(view))
            .collect();
        // One camera may be missing altogether.
        if let [only] = views[..]
            && View::ALL
                .iter()
                .all(|view| seen.contains(&(pair.limb, *view)))
        {
            let file = only.file.clone();
            flaws.push(Flaw::OneCamera { file });
        }
        for depth in &views {
            images.push((&depth.file, pair.limb.patient, depth.roi.as_ref()));
        }
        depth_images += views.len();
        regions += views.iter().filter(|depth| depth.roi.is_some()).count();
        if let Some(file) = &pair.radiograph
            && radiographs.insert(file.as_str())
        {
            images.push((file, pair.limb.patient, None));
        }
    }
    for unpaired in &dataset.unpaired {
        if let Unpaired::Radiograph { patient, file } = unpaired
            && radiographs.insert(file)
        {
            images.push((file, *patient, None));
        }
    }
    let looked_at = images
        .par_iter()
        .map(|(file, _, roi)| look(root, file, *roi));
    let mut hashes = BTreeMap::new();
    let mut owners: BTreeMap<String, (&str, u32)> = BTreeMap::new();
    for ((file, patient, _), (hash, flaw)) in images.iter().zip(looked_at.collect::<Vec<_>>()) {
        flaws.extend(flaw);
        let Some(hash) = hash else { continue };
        let (first, owner) = *owners.entry(hash.clone()).or_insert((file, *patient));
        if owner != *patient {
            flaws.push(Flaw::SameImage {
                first: first.to_owned(),
                second: (*file).to_owned(),
            });
        }
        hashes.insert(*file, hash);
    }
    flaws.extend(against_lists(&dataset, hashes));
    let mut limbs: Vec<_> = dataset.pairs.iter().map(|pair| pair.limb).collect();
    limbs.dedup();
    Ok(Inspection {
        patients: dataset.patients().len(),
        limbs: limbs.len(),
        pairs: dataset.pairs.len(),
        depth_images,
        regions,
        radiographs: radiographs.len(),
        labelled: dataset
            .pairs
            .iter()
            .filter(|pair| pair.label.is_some())
            .count(),
        manifest: root.join(Manifest::FILE).exists(),
        flaws,
    })
}

/// Hash of an image, if it can be read, and its flaw, if any.
fn look(root: &Path, file: &str, roi: Option<&RoiRow>) -> (Option<String>, Option<Flaw>) {
    let path = root.join(file);
    let bytes = match ppa_core::regular_file::read(&path).map_err(FileError::at("read", &path)) {
        Ok(bytes) => bytes,
        Err(error) => return (None, Some(damaged(&error.into()))),
    };
    let hash = Some(hex(&Sha256::digest(&bytes)));
    match GrayImage16::decode(&bytes, &path) {
        Err(error) => (hash, Some(damaged(&error))),
        Ok(image) => {
            let beyond = |roi: &&RoiRow| {
                roi.x_start.saturating_add(roi.size) > image.width
                    || roi.y_start.saturating_add(roi.size) > image.height
            };
            let flaw = roi.filter(beyond).map(|roi| Flaw::RoiOutside {
                file: file.to_owned(),
                width: image.width,
                height: image.height,
                roi: roi.clone(),
            });
            (hash, flaw)
        }
    }
}

fn damaged(error: &ImageFileError) -> Flaw {
    Flaw::Image(error_chain(error))
}
