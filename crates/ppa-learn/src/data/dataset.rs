//! Samples from a dataset in either published layout.

use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};

use ppa_dataset::BodyShape;
use ppa_dataset::layout::View;
use ppa_dataset::published::{DepthFile, GrayImage16, ImagePair, Pose, Published};

use super::error::DataError;
use super::prepare::Roi;
use super::sample::{Sample, SampleImage};

/// Frames that are used of a recorded pose, the first ones in time: the paper's number.
pub const FRAMES_PER_POSE: usize = 5;

/// Which images make a sample.
#[derive(Debug, Clone, Copy, PartialEq, Eq, serde::Serialize, serde::Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Views {
    /// The left camera's images, one per sample: for the paper's network of the first view.
    Left,
    /// The right camera's images, one per sample.
    Right,
    /// Images of both cameras, one per sample: a network of a unified view.
    Unified,
    /// The images of both cameras of one moment together: for networks that fuse both.
    Pairs,
}

/// The labelled samples of some persons of a dataset, or of all persons, in the order of the dataset. Of rotated poses only
/// some body shapes, or all.
///
/// # Errors
/// [`DataError`] for a folder that is no dataset, an image without label, without region or with one outside its camera's images, a
/// person or body shape that is not there, or no image.
pub fn read_samples(
    root: &Path,
    persons: Option<&[u32]>,
    shapes: Option<&[BodyShape]>,
    views: Views,
    frames_per_pose: usize,
) -> Result<Vec<Sample>, DataError> {
    let dataset = Published::read(root)?;
    let there = dataset.patients();
    if let Some(missing) = persons
        .iter()
        .copied()
        .flatten()
        .find(|p| !there.contains(p))
    {
        let root = root.display();
        return Err(DataError::Empty(format!("of patient {missing} in {root}")));
    }
    let of_person = |pair: &&ImagePair| persons.is_none_or(|p| p.contains(&pair.limb.patient));
    let chosen = |pair: &&ImagePair| {
        let of_shape = |shape| shapes.is_none_or(|s| s.contains(&shape));
        of_person(pair) && shape_of(pair).is_none_or(of_shape)
    };
    let of_persons = dataset.pairs.iter().filter(of_person);
    let found: BTreeSet<BodyShape> = of_persons.filter_map(shape_of).collect();
    if !found.is_empty()
        && let Some(missing) = shapes
            .iter()
            .copied()
            .flatten()
            .find(|s| !found.contains(s))
    {
        let (name, root) = (missing.name(), root.display());
        return Err(DataError::Empty(format!("of body shape {name} in {root}")));
    }
    let mut reader = Reader {
        dataset: &dataset,
        place: root.canonicalize().unwrap_or_else(|_| root.to_owned()),
        frames_per_pose,
        sizes: BTreeMap::new(),
        frames: BTreeMap::new(),
    };
    let mut samples = Vec::new();
    for pair in dataset.pairs.iter().filter(chosen) {
        match views {
            Views::Left => samples.extend(reader.sample(pair, &[View::Left])?),
            Views::Right => samples.extend(reader.sample(pair, &[View::Right])?),
            Views::Unified => {
                samples.extend(reader.sample(pair, &[View::Left])?);
                samples.extend(reader.sample(pair, &[View::Right])?);
            }
            Views::Pairs => samples.extend(reader.sample(pair, &View::ALL)?),
        }
    }
    if samples.is_empty() {
        return Err(DataError::Empty(format!("to use in {}", root.display())));
    }
    Ok(samples)
}

struct Reader<'a> {
    dataset: &'a Published,
    /// The one path of the dataset's folder, however it was spelled: persons of one dataset must be known again.
    place: PathBuf,
    frames_per_pose: usize,
    /// Columns and rows of each camera's first image.
    sizes: BTreeMap<View, [usize; 2]>,
    /// Frames taken so far, by pose and first camera.
    frames: BTreeMap<(String, View), usize>,
}

impl Reader<'_> {
    /// The sample of some cameras; None if the pair lacks one of them or enough frames of the pose were taken.
    fn sample(&mut self, pair: &ImagePair, views: &[View]) -> Result<Option<Sample>, DataError> {
        let files: Option<Vec<&DepthFile>> = views.iter().map(|&v| pair.depth(v)).collect();
        let Some(files) = files else {
            return Ok(None);
        };
        let pose = pose_name(pair);
        let taken = self.frames.entry((pose.clone(), views[0])).or_default();
        if *taken == self.frames_per_pose {
            return Ok(None);
        }
        let frame = *taken as u32;
        *taken += 1;
        let path = |file: &DepthFile| self.dataset.root.join(&file.file);
        let no_label = || DataError::NoLabel(path(files[0]));
        let label = pair.label.as_ref().ok_or_else(no_label)?.label;
        let images = views.iter().zip(&files);
        let images: Result<_, _> = images.map(|(&view, file)| self.image(view, file)).collect();
        Ok(Some(Sample {
            id: files[0].file.clone(),
            images: images?,
            label,
            dataset: self.place.clone(),
            limb: pair.limb,
            camera: views[0],
            pose,
            frame,
            angle_deg: match pair.pose {
                Pose::Rotated { step, .. } => Some(f64::from(step) / 2.0),
                Pose::Recorded { .. } => None,
            },
        }))
    }

    fn image(&mut self, camera: View, file: &DepthFile) -> Result<SampleImage, DataError> {
        let path = self.dataset.root.join(&file.file);
        let no_roi = || DataError::NoRoi(path.clone());
        let roi = file.roi.as_ref().ok_or_else(no_roi)?;
        let roi = Roi {
            x: roi.x_start,
            y: roi.y_start,
            size: roi.size,
        };
        let size = match self.sizes.get(&camera) {
            Some(&size) => size,
            None => {
                let first = GrayImage16::read(&path)?;
                let size = [first.width as usize, first.height as usize];
                *self.sizes.entry(camera).or_insert(size)
            }
        };
        let [width, height] = size;
        roi.check(width, height)
            .map_err(|source| DataError::Region {
                path: path.clone(),
                source: Box::new(source),
            })?;
        Ok(SampleImage {
            path,
            camera,
            roi,
            size,
        })
    }
}

/// The body shape of a rotated pose; recorded ones have none.
fn shape_of(pair: &ImagePair) -> Option<BodyShape> {
    match pair.pose {
        Pose::Rotated { shape, .. } => Some(shape),
        Pose::Recorded { .. } => None,
    }
}

/// Person, side and pose, without camera and frame.
fn pose_name(pair: &ImagePair) -> String {
    let limb = format!("patient_{}/{}", pair.limb.patient, pair.limb.side_letter());
    match pair.pose {
        Pose::Rotated { step, shape } => format!("{limb}/{}/{step}", shape.name()),
        Pose::Recorded {
            flexion,
            image_number,
            ..
        } => format!("{limb}/{}/{image_number}", flexion.name()),
    }
}
