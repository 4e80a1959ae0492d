//! WebDataset: tar archives in which consecutive files of one base name form a sample, for training programs that stream their data.

use std::fs::File;
use std::io::BufWriter;
use std::path::{Path, PathBuf};
use std::sync::atomic::AtomicBool;

use serde::Serialize;

use crate::archive::ArchiveWriter;
use crate::files::FileError;
use crate::layout::View;
use crate::published::{ImagePair, Pose, Published, PublishedError};
use crate::split::{Split, SplitError};
use crate::stop::{Stopped, go_on};
use crate::whole_folder::write_whole_folder;

/// Why a dataset cannot be written as archives.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum WebDatasetError {
    /// The dataset.
    #[error(transparent)]
    Published(#[from] PublishedError),
    /// Its split.
    #[error(transparent)]
    Split(#[from] SplitError),
    /// A file.
    #[error(transparent)]
    File(#[from] FileError),
    /// Not all archives were written because a stop was requested.
    #[error("not all archives were written")]
    Stopped(#[from] Stopped),
}

/// What was written.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
pub struct Shards {
    /// Archives.
    pub shards: usize,
    /// Samples: image pairs.
    pub samples: usize,
}

/// Writes the image pairs of the dataset in `root`, in either layout, as archives of `per_shard` samples each into the folder
/// `to`, completely or not at all.
///
/// A sample consists of those of `NAME.left.png`, `NAME.right.png` and `NAME.xray.png` that exist, and `NAME.json` with person,
/// pose, regions and label; `NAME` is `patient_0_r_036_orig` or `patient_1_l_min_0_1000`. With a split, each part has its own
/// archives, such as `train-000000.tar`; otherwise they are `all-000000.tar`. Order, sizes and bytes are reproducible.
///
/// Once `stop` is true, it ends before the next sample and leaves nothing behind.
///
/// # Errors
/// [`WebDatasetError`]; `to` must not exist or must be empty.
pub fn web_dataset(
    root: &Path,
    to: &Path,
    per_shard: usize,
    split: Option<&str>,
    stop: &AtomicBool,
) -> Result<Shards, WebDatasetError> {
    let dataset = Published::read(root)?;
    let split = split
        .map(|name| Split::read(&Split::path(root, name)))
        .transpose()?;
    let parts = match &split {
        None => vec![("all", dataset.pairs.iter().collect())],
        Some(split) => {
            split.check(&dataset.patients())?;
            let of_part = |patients: &Vec<u32>| {
                let pairs = dataset.pairs.iter();
                pairs
                    .filter(|pair| patients.contains(&pair.limb.patient))
                    .collect()
            };
            split
                .parts
                .iter()
                .map(|(name, patients)| (name.as_str(), of_part(patients)))
                .collect()
        }
    };
    write(root, to, per_shard, &parts, stop)
}

fn write(
    root: &Path,
    to: &Path,
    per_shard: usize,
    parts: &[(&str, Vec<&ImagePair>)],
    stop: &AtomicBool,
) -> Result<Shards, WebDatasetError> {
    write_whole_folder(to, |folder| {
        let mut written = Shards {
            shards: 0,
            samples: 0,
        };
        for (part, pairs) in parts {
            for (number, shard) in pairs.chunks(per_shard.max(1)).enumerate() {
                let path = folder.join(format!("{part}-{number:06}.tar"));
                write_shard(root, &path, shard, stop)?;
                written.shards += 1;
                written.samples += shard.len();
            }
        }
        Ok(written)
    })
}

fn write_shard(
    root: &Path,
    path: &Path,
    pairs: &[&ImagePair],
    stop: &AtomicBool,
) -> Result<(), WebDatasetError> {
    let file = File::create(path).map_err(FileError::at("write", path))?;
    let mut archive = ArchiveWriter::new(BufWriter::new(file));
    let mut add = |name: String, bytes: &[u8]| {
        archive
            .add(&name, bytes)
            .map_err(FileError::at("write", path))
    };
    for pair in pairs {
        go_on(stop)?;
        let name = sample_name(pair);
        for (kind, file) in images(pair) {
            let image: PathBuf = root.join(file);
            let bytes =
                ppa_core::regular_file::read(&image).map_err(FileError::at("read", &image))?;
            add(format!("{name}.{kind}.png"), &bytes)?;
        }
        let text = serde_json::to_string(pair).expect("rows hold only JSON values");
        add(format!("{name}.json"), text.as_bytes())?;
    }
    archive.finish().map_err(FileError::at("write", path))?;
    Ok(())
}

fn images(pair: &ImagePair) -> impl Iterator<Item = (&'static str, &str)> {
    let depth = |view| Some(pair.depth(view)?.file.as_str());
    let files = [
        ("left", depth(View::Left)),
        ("right", depth(View::Right)),
        ("xray", pair.radiograph.as_deref()),
    ];
    files
        .into_iter()
        .filter_map(|(kind, file)| Some((kind, file?)))
}

/// Contains no dot: the name of a sample ends at the first one.
fn sample_name(pair: &ImagePair) -> String {
    let (patient, side) = (pair.limb.patient, pair.limb.side_letter());
    match pair.pose {
        Pose::Rotated { step, shape } => format!("{}_{}", pair.limb.unit_name(step), shape.name()),
        Pose::Recorded {
            flexion,
            image_number,
            timestamp,
        } => {
            format!(
                "patient_{patient}_{side}_{}_{image_number}_{timestamp}",
                flexion.name()
            )
        }
    }
}
