//! Conversion from one published layout to the other.

use std::collections::{BTreeMap, BTreeSet};
use std::fs;
use std::path::Path;
use std::sync::atomic::AtomicBool;

use serde::Serialize;

use super::specimen::{depth_file_name, flexion_folder, radiograph_name};
use super::{DepthFile, Flexion, ImagePair, Layout, Pose, Published, Unpaired};
use crate::body_shape::BodyShape;
use crate::files::FileError;
use crate::labels::LabelError;
use crate::layout::{LimbId, View};
use crate::stop::{Stopped, go_on};
use crate::whole_folder::write_whole_folder;

/// Why a dataset cannot be converted.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum ConvertError {
    /// A file of either dataset.
    #[error(transparent)]
    File(#[from] FileError),
    /// A label that the other layout cannot hold, for example of a pose whose number is not a step.
    #[error("limb {side} of patient {patient}")]
    Label {
        /// Person.
        patient: u32,
        /// `l` or `r`.
        side: &'static str,
        /// What is wrong.
        source: LabelError,
    },
    /// The dataset was not converted because a stop was requested.
    #[error("the dataset was not converted")]
    Stopped(#[from] Stopped),
    /// No pose has the requested flexion.
    #[error("{0} holds no images of flexion {1}")]
    NoFlexion(String, &'static str),
}

/// Counts of what was converted and left out.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize)]
pub struct Converted {
    /// Depth images in the new dataset.
    pub depth_images: usize,
    /// Radiographs in the new dataset.
    pub radiographs: usize,
    /// Labelled poses in the new dataset.
    pub labels: usize,
    /// Depth images left out: of other flexions, or later ones of a pose.
    pub left_out: usize,
    /// Radiographs left out: of other flexions, or of poses without depth images.
    pub radiographs_left_out: usize,
    /// Labels left out, for the same reasons.
    pub labels_left_out: usize,
}

/// Writes the dataset in the other layout to the folder `to`, completely or not at all.
///
/// *Synthetic to specimen*: all poses are filed under `flexion`, since a scan does not show it; the step becomes the image
/// number, the body shape the time stamp (0 `orig`, 1 `big`, 2 `small`, 3 `bumps_a`, 4 `bumps_b`). The other flexions get empty
/// lists, because the authors' loader fails without them.
///
/// *Specimen to synthetic*: only the poses of `flexion`; the image number becomes the step, so the "angle" of a recorded pose is
/// only half its number. Time stamps become body shapes if all are 0 to 4; otherwise the earliest image of a pose becomes `orig` and
/// the later ones are left out.
///
/// Once `stop` is true, it ends before the next image and leaves nothing behind.
///
/// Tallies (EXR), `manifest.jsonl` and `dataset.json` are not copied.
///
/// # Errors
/// [`ConvertError`]; `to` must not exist or must be empty.
pub fn convert(
    from: &Published,
    to: &Path,
    flexion: Flexion,
    stop: &AtomicBool,
) -> Result<Converted, ConvertError> {
    write_whole_folder(to, |root| {
        let mut limbs: BTreeMap<LimbId, Vec<Moved>> = BTreeMap::new();
        let of_other_layout = match from.layout {
            Layout::Synthetic => recorded(&from.pairs, flexion),
            Layout::Specimen => rotated(from, flexion)?,
        };
        for moved in of_other_layout {
            limbs.entry(moved.pair.limb).or_default().push(moved);
        }
        let mut converted = Converted::default();
        for (&limb, moved) in &limbs {
            let copy = Copy {
                from,
                root,
                limb,
                stop,
            };
            converted.radiographs += copy.radiographs(moved)?;
            converted.depth_images += copy.depth_images(moved)?;
            converted.labels += match from.layout {
                Layout::Synthetic => copy.specimen_lists(moved, flexion)?,
                Layout::Specimen => copy.synthetic_lists(moved)?,
            };
        }
        let all = Converted::all_of(from);
        converted.left_out = all.depth_images - converted.depth_images;
        converted.radiographs_left_out = all.radiographs - converted.radiographs;
        converted.labels_left_out = all.labels - converted.labels;
        Ok(converted)
    })
}

impl Converted {
    /// What there is to convert.
    fn all_of(from: &Published) -> Self {
        let mut all = Self::default();
        let (mut radiographs, mut labels) = (BTreeSet::new(), BTreeSet::new());
        for pair in &from.pairs {
            all.depth_images += depth_files(pair).count();
            radiographs.extend(pair.radiograph.as_deref());
            if pair.label.is_some() {
                let pose = match pair.pose {
                    Pose::Rotated { step, .. } => (None, step),
                    Pose::Recorded {
                        flexion,
                        image_number,
                        ..
                    } => (Some(flexion), image_number),
                };
                labels.insert((pair.limb, pose));
            }
        }
        let unpaired = |of: fn(&Unpaired) -> bool| from.unpaired.iter().filter(|u| of(u)).count();
        all.radiographs =
            radiographs.len() + unpaired(|u| matches!(u, Unpaired::Radiograph { .. }));
        all.labels = labels.len() + unpaired(|u| matches!(u, Unpaired::Label { .. }));
        all
    }
}

/// An image pair and its pose in the other layout.
pub(super) struct Moved<'a> {
    pub pair: &'a ImagePair,
    pub pose: Pose,
}

fn recorded(pairs: &[ImagePair], flexion: Flexion) -> Vec<Moved<'_>> {
    let moved = pairs.iter().filter_map(|pair| match pair.pose {
        Pose::Rotated { step, shape } => Some(Moved {
            pair,
            pose: Pose::Recorded {
                flexion,
                image_number: step,
                timestamp: shape as u64,
            },
        }),
        Pose::Recorded { .. } => None,
    });
    moved.collect()
}

fn rotated(from: &Published, wanted: Flexion) -> Result<Vec<Moved<'_>>, ConvertError> {
    let of_flexion = |pair: &ImagePair| match pair.pose {
        Pose::Recorded {
            flexion,
            image_number,
            timestamp,
        } if flexion == wanted => Some((image_number, timestamp)),
        _ => None,
    };
    let found: Vec<_> = from
        .pairs
        .iter()
        .filter_map(|pair| Some((pair, of_flexion(pair)?)))
        .collect();
    if found.is_empty() {
        return Err(ConvertError::NoFlexion(
            from.root.display().to_string(),
            wanted.name(),
        ));
    }
    let shape_of = |timestamp: u64| {
        BodyShape::ALL
            .into_iter()
            .find(|&shape| shape as u64 == timestamp)
    };
    let are_shapes = found
        .iter()
        .all(|(_, (_, timestamp))| shape_of(*timestamp).is_some());
    let mut seen = BTreeSet::new();
    let mut moved = Vec::new();
    for (pair, (step, timestamp)) in found {
        let shape = if are_shapes {
            shape_of(timestamp)
        } else {
            None
        };
        let first = seen.insert((pair.limb, step));
        if let Some(shape) = shape.or(first.then_some(BodyShape::Orig)) {
            moved.push(Moved {
                pair,
                pose: Pose::Rotated { step, shape },
            });
        }
    }
    Ok(moved)
}

/// One limb being copied to the new dataset.
pub(super) struct Copy<'a> {
    pub from: &'a Published,
    pub root: &'a Path,
    pub limb: LimbId,
    pub stop: &'a AtomicBool,
}

impl Copy<'_> {
    fn file(&self, from: &str, to: &str) -> Result<(), ConvertError> {
        go_on(self.stop)?;
        let (from, to) = (self.from.root.join(from), self.root.join(to));
        let folder = to.parent().expect("files lie in folders of the dataset");
        fs::create_dir_all(folder).map_err(FileError::at("create folder", folder))?;
        // `fs::copy` would wait forever on a named pipe without a writer.
        drop(ppa_core::regular_file::open(&from).map_err(FileError::at("copy", &from))?);
        fs::copy(&from, &to).map_err(FileError::at("copy", &from))?;
        Ok(())
    }

    fn radiographs(&self, moved: &[Moved]) -> Result<usize, ConvertError> {
        let mut copied = BTreeSet::new();
        for Moved { pair, pose } in moved {
            let to = match *pose {
                Pose::Rotated { step, .. } => self.limb.radiograph_png(step),
                Pose::Recorded {
                    flexion,
                    image_number,
                    ..
                } => {
                    let folder = flexion_folder(self.limb, flexion);
                    format!("{folder}/xray/{}", radiograph_name(image_number))
                }
            };
            if let Some(from) = &pair.radiograph
                && !copied.contains(&to)
            {
                self.file(from, &to)?;
                copied.insert(to);
            }
        }
        Ok(copied.len())
    }

    fn depth_images(&self, moved: &[Moved]) -> Result<usize, ConvertError> {
        let mut copied = 0;
        for Moved { pair, pose } in moved {
            for (view, depth) in depth_files(pair) {
                let to = match *pose {
                    Pose::Rotated { step, shape } => self.limb.depth(shape, view, step),
                    Pose::Recorded {
                        flexion,
                        image_number,
                        timestamp,
                    } => format!(
                        "{}/depth/{}",
                        flexion_folder(self.limb, flexion),
                        depth_file_name(view, image_number, timestamp)
                    ),
                };
                self.file(&depth.file, &to)?;
                copied += 1;
            }
        }
        Ok(copied)
    }
}

pub(super) fn depth_files(pair: &ImagePair) -> impl Iterator<Item = (View, &DepthFile)> {
    View::ALL
        .into_iter()
        .filter_map(|view| Some((view, pair.depth(view)?)))
}
