//! Every image of a published dataset decoded and compared with what the lists say of it.

use std::collections::{BTreeMap, BTreeSet};
use std::path::Path;

use rayon::prelude::*;
use serde::Serialize;
use sha2::{Digest, Sha256};

use super::{GrayImage16, ImageFileError, Published, PublishedError};
use crate::files::{FileError, hex};
use crate::layout::View;
use crate::manifest::{FileKind, Manifest, RoiRow};

/// Something in a dataset that a training program would stumble over, or never notice.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum Flaw {
    /// An image that is missing, damaged, or of other pixels.
    #[error("{0}")]
    Image(String),
    /// A region that reaches beyond its image.
    #[error(
        "{file} has {width} x {height} pixels, its region reaches to column {} and row {}",
        roi.x_start.saturating_add(roi.size), roi.y_start.saturating_add(roi.size)
    )]
    RoiOutside {
        /// The depth image.
        file: String,
        /// Its columns.
        width: u32,
        /// Its rows.
        height: u32,
        /// Its region.
        roi: RoiRow,
    },
    /// A pose that only one camera saw.
    #[error("{file} has no counterpart of the other camera")]
    OneCamera {
        /// The only depth image.
        file: String,
    },
    /// Two persons with one image: one of them is the other, or a copy.
    #[error("{first} and {second} are the same image, but of different persons")]
    SameImage {
        /// An image.
        first: String,
        /// The image of another person.
        second: String,
    },
    /// An image that is not the one in `manifest.jsonl`.
    #[error("{file} is altered: its hash is not that in manifest.jsonl")]
    Altered {
        /// The image.
        file: String,
    },
    /// An image without a row, or a row without an image.
    #[error("{file} stands {where}")]
    Unlisted {
        /// The image.
        file: String,
        /// In which of both.
        r#where: &'static str,
    },
    /// The manifest as a whole.
    #[error("{0}")]
    Manifest(String),
}

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
    /// Radiographs that are PNG.
    pub radiographs: usize,
    /// Image pairs whose pose has a label.
    pub labelled: usize,
    /// Whether hashes were compared with `manifest.jsonl`.
    pub manifest: bool,
    /// What is wrong, in the order of the dataset.
    #[serde(skip)]
    pub flaws: Vec<Flaw>,
}

/// Reads the dataset in `root` in either layout, decodes all PNG files, and compares them with regions of interest, with each
/// other and, where there is one, with `manifest.jsonl`. Changes nothing.
///
/// # Errors
/// [`PublishedError`] for what fits no layout; single images are told as [`Flaw`]s.
pub fn inspect(root: &Path) -> Result<Inspection, PublishedError> {
    let dataset = Published::read(root)?;
    let mut flaws = Vec::new();
    let mut images: Vec<(&str, u32, Option<&RoiRow>)> = Vec::new();
    let (mut regions, mut depth_images) = (0, 0);
    let mut radiographs = BTreeSet::new();
    for pair in &dataset.pairs {
        let views: Vec<_> = View::ALL
            .into_iter()
            .filter_map(|view| pair.depth(view))
            .collect();
        if let [only] = views[..] {
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
    let manifest = root.join(Manifest::FILE).exists();
    if manifest {
        flaws.extend(against_manifest(root, &hashes));
    }
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
        manifest,
        flaws,
    })
}

/// Hash of an image, if it can be read, and what is wrong with it.
fn look(root: &Path, file: &str, roi: Option<&RoiRow>) -> (Option<String>, Option<Flaw>) {
    let path = root.join(file);
    let bytes = match std::fs::read(&path).map_err(FileError::at("read", &path)) {
        Ok(bytes) => bytes,
        Err(error) => return (None, Some(told(&error.into()))),
    };
    let hash = Some(hex(&Sha256::digest(&bytes)));
    match GrayImage16::decode(&bytes, &path) {
        Err(error) => (hash, Some(told(&error))),
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

/// An error with its causes in one line.
fn told(error: &ImageFileError) -> Flaw {
    let mut text = error.to_string();
    let mut cause = std::error::Error::source(error);
    while let Some(source) = cause {
        text += &format!(": {source}");
        cause = source.source();
    }
    Flaw::Image(text)
}

fn against_manifest(root: &Path, hashes: &BTreeMap<&str, String>) -> Vec<Flaw> {
    let manifest = match Manifest::read(root) {
        Ok(manifest) => manifest,
        Err(error) => {
            let cause = std::error::Error::source(&error);
            let cause = cause.map(|cause| format!(": {cause}")).unwrap_or_default();
            return vec![Flaw::Manifest(format!("{error}{cause}"))];
        }
    };
    let mut flaws = Vec::new();
    let mut listed = BTreeSet::new();
    for row in manifest
        .files
        .iter()
        .filter(|row| row.kind != FileKind::RadiographTallies)
    {
        let file = row.file.clone();
        if !listed.insert(row.file.as_str()) {
            flaws.push(Flaw::Unlisted {
                file,
                r#where: "twice in manifest.jsonl",
            });
            continue;
        }
        match hashes.get(row.file.as_str()) {
            None => flaws.push(Flaw::Unlisted {
                file,
                r#where: "in manifest.jsonl, but is not there",
            }),
            Some(hash) if *hash != row.sha256 => flaws.push(Flaw::Altered { file }),
            Some(_) => {}
        }
    }
    for file in hashes.keys().filter(|file| !listed.contains(*file)) {
        let file = (*file).to_owned();
        flaws.push(Flaw::Unlisted {
            file,
            r#where: "not in manifest.jsonl",
        });
    }
    flaws
}
