//! Samples from a dataset in either published layout.

use std::collections::{BTreeMap, BTreeSet};
use std::fmt;
use std::num::NonZeroUsize;
use std::path::{Path, PathBuf};

use ppa_core::Roi;
use ppa_dataset::BodyShape;
use ppa_dataset::labels::{LabelFile, LabelName};
use ppa_dataset::layout::{LimbId, Side, View};
use ppa_dataset::published::{DepthFile, ImagePair, Pose, Published};

use super::correction::set_corrections;
use super::error::DataError;
use super::prepare::check_roi;
use super::sample::{Sample, SampleImage};
use super::size::size_of;

/// Number of frames used per recorded pose, as in the paper: the first ones in time that both cameras have.
pub const FRAMES_PER_POSE: usize = 5;

/// Images that make up a sample.
#[derive(Debug, Clone, Copy, PartialEq, Eq, serde::Serialize, serde::Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Views {
    /// The left camera's images, one per sample: for the paper's network for the first view.
    Left,
    /// The right camera's images, one per sample.
    Right,
    /// Images of both cameras, one per sample: for a network of a unified view.
    Unified,
    /// Both cameras' images of one moment together: for networks that fuse them.
    Pairs,
}

impl fmt::Display for Views {
    /// Writes the name used in configurations.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Left => "left",
            Self::Right => "right",
            Self::Unified => "unified",
            Self::Pairs => "pairs",
        })
    }
}

/// Selection of the samples of a dataset, and how left limbs are shown.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Selection<'a> {
    /// Numbers of the persons; all of them if `None`.
    pub patients: Option<&'a [u32]>,
    /// Body shapes of rotated poses; all of them if `None`.
    pub shapes: Option<&'a [BodyShape]>,
    /// Every n-th angle of each limb's rotated poses, from the smallest; all of them if `None`.
    pub every_pose: Option<NonZeroUsize>,
    /// NAME of the label file `labels.NAME.json`; `labels.json` if `None`.
    pub labels: Option<&'a LabelName>,
    /// Include images without a label, with NaN as their label; otherwise they are an error.
    pub unlabelled: bool,
    /// Cameras whose images make up a sample.
    pub views: Views,
    /// Number of frames used per recorded pose.
    pub frames_per_pose: usize,
    /// Show left limbs as right ones: images mirrored left to right, cameras exchanged. A mirrored left limb in front of mirrored
    /// cameras is a right limb in front of the actual cameras.
    pub mirror: bool,
}

impl Selection<'_> {
    /// Selects all labelled samples of `views`, without mirroring.
    pub fn all(views: Views) -> Self {
        Self {
            patients: None,
            shapes: None,
            every_pose: None,
            labels: None,
            unlabelled: false,
            views,
            frames_per_pose: FRAMES_PER_POSE,
            mirror: false,
        }
    }

    /// Returns whether the images of a limb are mirrored.
    fn mirrors(&self, limb: LimbId) -> bool {
        self.mirror && limb.side == Side::Left
    }
}

/// Returns the selected samples of a dataset, in the order of the dataset.
///
/// # Errors
/// [`DataError`] for a folder that is not a dataset, an image without a label (unless [`Selection::unlabelled`]), without a region or
/// with one outside its camera's images, an image that according to its header is not a 16-bit PNG of the size of the others of its
/// camera, a missing person or body shape, or no image.
pub fn read_samples(root: &Path, selection: &Selection) -> Result<Vec<Sample>, DataError> {
    let Selection {
        patients: persons,
        shapes,
        every_pose,
        labels,
        views,
        frames_per_pose,
        ..
    } = *selection;
    let dataset = Published::read_labelled(root, labels)?;
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
    let angles = EveryAngle::new(&dataset.pairs, every_pose);
    let chosen = |pair: &&ImagePair| {
        let of_shape = |shape| shapes.is_none_or(|s| s.contains(&shape));
        of_person(pair) && shape_of(pair).is_none_or(of_shape) && angles.contain(pair)
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
        labels,
        unlabelled: selection.unlabelled,
        place: root.canonicalize().unwrap_or_else(|_| root.to_owned()),
        sizes: BTreeMap::new(),
    };
    let cameras: &[&[View]] = match views {
        Views::Left => &[&[View::Left]],
        Views::Right => &[&[View::Right]],
        Views::Unified => &[&[View::Left], &[View::Right]],
        Views::Pairs => &[&View::ALL],
    };
    let mut samples = Vec::new();
    let pairs: Vec<&ImagePair> = dataset.pairs.iter().filter(chosen).collect();
    for pose in pairs.chunk_by(|a, b| pose_name(a) == pose_name(b)) {
        let mut taken = vec![0; cameras.len()];
        let mirrored = selection.mirrors(pose[0].limb);
        for &pair in moments(pose) {
            for (&cameras, taken) in cameras.iter().zip(&mut taken) {
                let seeing = |&view: &View| if mirrored { other(view) } else { view };
                let cameras: Vec<View> = cameras.iter().map(seeing).collect();
                if *taken < frames_per_pose && cameras.iter().all(|&v| pair.depth(v).is_some()) {
                    samples.push(reader.sample(pair, &cameras, mirrored, *taken as u32)?);
                    *taken += 1;
                }
            }
        }
    }
    if samples.is_empty() {
        let mut what = format!("to use in {}", root.display());
        if pairs.iter().any(|pair| selection.mirrors(pair.limb)) {
            what += " (with mirror = true, left limbs are shown by the other camera's images)";
        }
        return Err(DataError::Empty(what));
    }
    set_corrections(&mut samples);
    Ok(samples)
}

/// Angles of rotated poses that a selection uses.
struct EveryAngle {
    every: usize,
    /// Steps of each limb's rotated poses.
    steps: BTreeMap<LimbId, BTreeSet<u32>>,
}

impl EveryAngle {
    fn new(pairs: &[ImagePair], every: Option<NonZeroUsize>) -> Self {
        let mut steps: BTreeMap<LimbId, BTreeSet<u32>> = BTreeMap::new();
        for pair in pairs {
            if let Pose::Rotated { step, .. } = pair.pose {
                steps.entry(pair.limb).or_default().insert(step);
            }
        }
        Self {
            every: every.map_or(1, NonZeroUsize::get),
            steps,
        }
    }

    fn contain(&self, pair: &ImagePair) -> bool {
        match pair.pose {
            Pose::Rotated { step, .. } => {
                let place = self.steps[&pair.limb].range(..step).count();
                place.is_multiple_of(self.every)
            }
            Pose::Recorded { .. } => true,
        }
    }
}

fn other(view: View) -> View {
    match view {
        View::Left => View::Right,
        View::Right => View::Left,
    }
}

/// Returns the moments of a pose to take frames from, in order of time: those that both cameras have, so that frames of equal
/// number show one moment; all of them if there is no such moment, as with a single camera.
fn moments<'a>(pose: &'a [&ImagePair]) -> impl Iterator<Item = &'a &'a ImagePair> {
    let both = |pair: &ImagePair| View::ALL.iter().all(|&view| pair.depth(view).is_some());
    let any = pose.iter().any(|pair| both(pair));
    pose.iter().filter(move |pair| !any || both(pair))
}

struct Reader<'a> {
    dataset: &'a Published,
    labels: Option<&'a LabelName>,
    unlabelled: bool,
    /// Canonical path of the dataset's folder, so that persons of one dataset are recognised however the path is written.
    place: PathBuf,
    /// Columns and rows of each camera's first image.
    sizes: BTreeMap<View, [usize; 2]>,
}

impl Reader<'_> {
    /// Returns the sample of the given cameras, all of which must be in the pair.
    fn sample(
        &mut self,
        pair: &ImagePair,
        views: &[View],
        mirrored: bool,
        frame: u32,
    ) -> Result<Sample, DataError> {
        let files = views.iter().filter_map(|&view| pair.depth(view));
        let files: Vec<&DepthFile> = files.collect();
        let path = |file: &DepthFile| self.dataset.root.join(&file.file);
        let (label, label_std) = match &pair.label {
            Some(row) => (row.label, row.std),
            None if self.unlabelled => (f64::NAN, f64::NAN),
            None => {
                return Err(DataError::NoLabel {
                    image: path(files[0]),
                    labels: LabelFile::file_name(self.labels),
                });
            }
        };
        let images = views.iter().zip(&files);
        let images: Result<_, _> = images
            .map(|(&view, file)| self.image(view, file, mirrored))
            .collect();
        Ok(Sample {
            id: files[0].file.clone(),
            images: images?,
            label,
            label_std,
            dataset: self.place.clone(),
            limb: pair.limb,
            camera: views[0],
            pose: pose_name(pair),
            frame,
            angle_deg: match pair.pose {
                Pose::Rotated { step, .. } => Some(f64::from(step) / 2.0),
                Pose::Recorded { .. } => None,
            },
            correction_deg: None,
        })
    }

    fn image(
        &mut self,
        camera: View,
        file: &DepthFile,
        mirrored: bool,
    ) -> Result<SampleImage, DataError> {
        let path = self.dataset.root.join(&file.file);
        let no_roi = || DataError::NoRoi(path.clone());
        let roi = file.roi.as_ref().ok_or_else(no_roi)?;
        let roi = Roi {
            x_start: roi.x_start,
            y_start: roi.y_start,
            size: roi.size,
        };
        let found = size_of(&path)?;
        let size = *self.sizes.entry(camera).or_insert(found);
        if found != size {
            return Err(DataError::Size {
                path,
                found,
                expected: size,
            });
        }
        let [width, height] = size;
        check_roi(&roi, width, height).map_err(|source| DataError::Region {
            path: path.clone(),
            source: Box::new(source),
        })?;
        Ok(SampleImage {
            path,
            camera,
            roi,
            size,
            mirrored,
        })
    }
}

/// Returns the body shape of a rotated pose; recorded poses have none.
fn shape_of(pair: &ImagePair) -> Option<BodyShape> {
    match pair.pose {
        Pose::Rotated { shape, .. } => Some(shape),
        Pose::Recorded { .. } => None,
    }
}

/// Returns person, side and pose as text, without camera and frame.
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
