//! The poses of a dataset as rows, with their outliers: the data of the page, for interactive views.

use std::collections::BTreeMap;
use std::path::Path;

use ppa_dataset::BodyShape;
use ppa_dataset::layout::{LimbId, View};
use ppa_dataset::manifest::{FileKind, FileRow, Manifest};
use ppa_dataset::published::{Label, Pose, Published};
use serde::Serialize;

use super::curves::{COURSES, Course, course};
use super::error::QaError;
use super::scene::Scene;

/// One body shape of a limb in a pose.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct PoseRow {
    /// Person and side.
    #[serde(flatten)]
    pub limb: LimbId,
    /// Variant of the skin.
    pub shape: BodyShape,
    /// Half degrees of medial rotation.
    pub step: u32,
    /// Medial rotation, degrees.
    pub angle_deg: f64,
    /// Height of the joint above the table, mm.
    pub height_mm: f64,
    /// Angle of the limb's axis away from the table, degrees.
    pub tilt_deg: f64,
    /// Largest share of the region of interest of an image of the pose that shows a cut face, 0 to 1.
    pub cut_share: f64,
    /// Quality of the pose.
    pub label: Option<Label>,
    /// Quantities that are outliers relative to neighbouring poses.
    pub stands_out: Vec<&'static str>,
}

/// The poses seen by the left camera in the dataset `root`, by limb, body shape and angle, with the outliers of the quality report.
///
/// # Errors
/// [`QaError`] naming the file at fault.
pub fn pose_rows(root: &Path) -> Result<Vec<PoseRow>, QaError> {
    let manifest = Manifest::read(root)?;
    let scene = Scene::read(root)?;
    let labels = labels(&Published::list(root)?);
    let mut cuts: BTreeMap<(LimbId, BodyShape, u32), f64> = BTreeMap::new();
    let mut sweeps: BTreeMap<(LimbId, BodyShape), Vec<&FileRow>> = BTreeMap::new();
    for row in manifest
        .files
        .iter()
        .filter(|row| row.kind == FileKind::Depth)
    {
        let largest = cuts.entry((row.limb, row.shape, row.step)).or_default();
        *largest = largest.max(row.cut_share.unwrap_or(0.0));
        if row.camera == Some(View::Left) {
            sweeps.entry((row.limb, row.shape)).or_default().push(row);
        }
    }
    let mut poses = Vec::new();
    for ((limb, shape), mut rows) in sweeps {
        rows.sort_by_key(|row| row.step);
        let courses = COURSES.map(|[what, _]| what);
        let found: [Course; 2] = [0, 1].map(|quantity| course(&scene, &rows, quantity));
        for (at, row) in rows.iter().enumerate() {
            let odd = courses
                .iter()
                .zip(&found)
                .filter(|(_, course)| course.odd.contains(&at));
            let [height_mm, tilt_deg] = [0, 1].map(|quantity| found[quantity].points[at][1]);
            poses.push(PoseRow {
                limb,
                shape,
                step: row.step,
                angle_deg: row.angle_deg,
                height_mm,
                tilt_deg,
                cut_share: cuts[&(limb, shape, row.step)],
                label: labels.get(&(limb, row.step)).cloned(),
                stands_out: odd.map(|(what, _)| *what).collect(),
            });
        }
    }
    Ok(poses)
}

/// The label of each pose; the same for all body shapes.
fn labels(dataset: &Published) -> BTreeMap<(LimbId, u32), Label> {
    let pairs = dataset.pairs.iter().filter_map(|pair| match pair.pose {
        Pose::Rotated { step, .. } => Some(((pair.limb, step), pair.label.clone()?)),
        Pose::Recorded { .. } => None,
    });
    pairs.collect()
}
