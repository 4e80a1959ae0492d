//! Computed labels of a dataset: every radiograph of a limb graded by how open its joint space lies.

use std::path::PathBuf;

use nalgebra::{Isometry3, Point3};
use ppa_depth::isometry_from_rows;
use ppa_scene::LimbKind;
use serde::Serialize;

use super::computation::Computation;
use super::described::Described;
use super::file::{LabelFile, LabelFileError};
use super::label::{LabelError, LabelRow, LabelSource};
use super::openness::{
    BoneFile, BoneFileError, Exposure, GradeThresholds, JointSpace, JointSpaceError, ReadBones,
    ThresholdError,
};
use super::table::write_table;
use super::tallies::TalliesError;
use crate::case::Case;
use crate::files::{FileError, write_whole};
use crate::layout::LimbId;
use crate::manifest::{FileKind, FileRow, Manifest, Rows};

/// What was computed for one radiograph; a row of `openness.csv`.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct ComputedRow {
    /// The radiograph, from the dataset's root.
    pub image: String,
    /// Half degrees of medial rotation.
    pub step: u32,
    /// Degrees of medial rotation.
    pub angle_deg: f64,
    /// Openness of the medial gutter, 0 to 1.
    pub medial: f64,
    /// Of the superior one.
    pub superior: f64,
    /// Of the lateral one.
    pub lateral: f64,
    /// Openness of the worst, as the thresholds scale it.
    pub worst: f64,
    /// Grade from 1 to 3 in half steps.
    pub label: f64,
    /// Half the range that other tolerances and thresholds give.
    pub std: f64,
    /// See [`Overlaps`](super::Overlaps), as the next six.
    pub tibiofibular_overlap_mm: Option<f64>,
    /// Floor of the incisura to fibula.
    pub tibiofibular_clear_space_mm: Option<f64>,
    /// Talus to medial malleolus.
    pub medial_clear_space_mm: Option<f64>,
    /// Trochlea to plafond.
    pub superior_clear_space_mm: Option<f64>,
    /// Medial malleolus over talus.
    pub medial_malleolus_overlap_mm: Option<f64>,
    /// Lateral malleolus over talus.
    pub lateral_malleolus_overlap_mm: Option<f64>,
    /// Medial above lateral crest of the trochlea.
    pub talar_crest_offset_mm: f64,
    /// How well the radiograph shows the medial gutter, see [`Visibility`](super::Visibility); as the next two.
    pub medial_visibility: f64,
    /// The superior one.
    pub superior_visibility: f64,
    /// The lateral one.
    pub lateral_visibility: f64,
}

/// What [`ComputedLabels::write`] did.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct LabelledLimb {
    /// The limb.
    #[serde(flatten)]
    pub limb: LimbId,
    /// Radiographs that were graded.
    pub radiographs: usize,
    /// How many of them are diagnostic, below 2.5.
    pub diagnostic: usize,
    /// Rotation at which the worst gutter is most open: the middle of what reaches nine tenths of the best.
    pub best_angle_deg: f64,
    /// Whether `labels.json` holds readers' labels and was left as it is.
    pub readers_kept: bool,
}

/// Why a limb cannot be labelled.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum AutoLabelError {
    /// The case is one of a knee.
    #[error("the case of {0} is a knee, but computed labels grade the joint space of ankles")]
    Knee(LimbId),
    /// The case names no bones.
    #[error(
        "the case of {0} names no bones: write it again with `ppa prepare --bones` or `--segment-bones`"
    )]
    NoBones(LimbId),
    /// The dataset shows no radiographs of the limb.
    #[error("{} lists no radiographs of {limb}", root.display())]
    NoRadiographs {
        /// The dataset.
        root: PathBuf,
        /// The limb.
        limb: LimbId,
    },
    /// The dataset was made from another scan.
    #[error("the radiographs of {0} were not made from the scan of the case")]
    OtherScan(LimbId),
    /// A radiograph without a pose of the device, or with one that is none.
    #[error("{file} has no usable {what} in the manifest")]
    Pose {
        /// The radiograph.
        file: String,
        /// `ct_from_device` or `patient_from_ct`.
        what: &'static str,
    },
    /// The bones.
    #[error(transparent)]
    Bones(#[from] BoneFileError),
    /// Their joint space.
    #[error("bones of {limb}")]
    JointSpace {
        /// The limb.
        limb: LimbId,
        /// What is wrong with it.
        source: JointSpaceError,
    },
    /// The tallies of a radiograph.
    #[error(transparent)]
    Tallies(#[from] TalliesError),
    /// The thresholds.
    #[error(transparent)]
    Thresholds(#[from] ThresholdError),
    /// A file.
    #[error(transparent)]
    File(#[from] FileError),
    /// Labels that are there are none.
    #[error(transparent)]
    Labels(#[from] LabelFileError),
    /// A label off the grid.
    #[error(transparent)]
    Label(#[from] LabelError),
}

/// Labels of a limb that are computed and not written yet.
#[derive(Debug, Clone)]
pub struct ComputedLabels<'a> {
    manifest: &'a Manifest,
    limb: LimbId,
    rows: Vec<ComputedRow>,
    labels: LabelFile,
    computation: String,
    readers_kept: bool,
}

/// Grades every radiograph of a limb from the bones that its case names.
///
/// # Errors
/// [`AutoLabelError`].
pub fn compute_labels<'a>(
    manifest: &'a Manifest,
    limb: LimbId,
    case: &Case,
    thresholds: &GradeThresholds,
) -> Result<ComputedLabels<'a>, AutoLabelError> {
    let before = LabelFile::read(&manifest.root, limb)?;
    let readers_kept =
        before.is_some_and(|labels| !labels.source.is_some_and(LabelSource::is_computed));
    thresholds.check()?;
    if case.choices.limb == Some(LimbKind::Knee) {
        return Err(AutoLabelError::Knee(limb));
    }
    let file = case.bones.as_ref().ok_or(AutoLabelError::NoBones(limb))?;
    let (rows, bones_sha256) = computed_rows(manifest, limb, case, file, thresholds)?;
    let computation = Computation::new(file, &bones_sha256, thresholds);
    let labels = rows.iter().map(|row| LabelRow {
        label: row.label,
        std: row.std,
        step: row.step,
    });
    let labels = LabelFile::new(computation.label_source, labels)?;
    Ok(ComputedLabels {
        manifest,
        limb,
        labels: labels.of_radiographs(manifest, limb),
        computation: computation.to_json(),
        rows,
        readers_kept,
    })
}

impl ComputedLabels<'_> {
    /// Writes `openness.csv`, `openness.json` (what it was computed with) and `labels.json` beside the limb's regions of interest.
    /// Labels of readers, and labels that do not tell their source, stay as they are.
    ///
    /// # Errors
    /// [`AutoLabelError`] if a file cannot be written.
    pub fn write(&self) -> Result<LabelledLimb, AutoLabelError> {
        let (root, limb) = (&self.manifest.root, self.limb);
        let regions = root.join(limb.roi_file());
        write_table(&regions.with_file_name("openness.csv"), &self.rows)?;
        write_whole(
            &regions.with_file_name("openness.json"),
            self.computation.as_bytes(),
        )?;
        if !self.readers_kept {
            self.labels.write(root, limb)?;
        }
        Ok(LabelledLimb {
            limb,
            radiographs: self.rows.len(),
            diagnostic: self.rows.iter().filter(|row| row.label < 2.5).count(),
            best_angle_deg: best_angle_deg(&self.rows),
            readers_kept: self.readers_kept,
        })
    }
}

fn computed_rows(
    manifest: &Manifest,
    limb: LimbId,
    case: &Case,
    file: &BoneFile,
    thresholds: &GradeThresholds,
) -> Result<(Vec<ComputedRow>, String), AutoLabelError> {
    let radiographs: Vec<&FileRow> = manifest
        .files
        .iter()
        .filter(|row| row.kind == FileKind::Radiograph && row.limb == limb)
        .collect();
    let Some(first) = radiographs.first() else {
        return Err(AutoLabelError::NoRadiographs {
            root: manifest.root.clone(),
            limb,
        });
    };
    let described = Described::read(manifest)?;
    if described.scan_of(limb) != Some(&case.source.volume_sha256) {
        return Err(AutoLabelError::OtherScan(limb));
    }
    let patient_from_ct = pose(first, "patient_from_ct", Some(&first.patient_from_ct))?;
    let ct_from_patient = patient_from_ct.inverse();
    let joint = ct_from_patient * Point3::origin();
    let devices: Vec<Isometry3<f64>> = radiographs
        .iter()
        .map(|row| pose(row, "ct_from_device", row.ct_from_device.as_ref()))
        .collect::<Result<_, AutoLabelError>>()?;
    let exposures: Vec<Exposure> = devices
        .iter()
        .map(|device| Exposure::of_device(device, joint))
        .collect();
    let of_limb = |source| AutoLabelError::JointSpace { limb, source };
    let ReadBones { bones, sha256 } = file.read(&joint)?;
    let space = JointSpace::new(bones, &ct_from_patient).map_err(of_limb)?;
    let openness = space.openness(&exposures).map_err(of_limb)?;
    let rows = radiographs
        .iter()
        .zip(&devices)
        .zip(exposures.iter().zip(&openness));
    let rows = rows.map(|((row, device), (exposure, openness))| {
        let visibility = described.visibility(manifest, row, device, &space)?;
        let grade = thresholds.grade(openness);
        let overlaps = space.overlaps(exposure);
        Ok(ComputedRow {
            image: row.file.clone(),
            step: row.step,
            angle_deg: row.angle_deg,
            medial: openness.medial[1],
            superior: openness.superior,
            lateral: openness.lateral[1],
            worst: thresholds.scaled(openness)[1],
            label: grade.label,
            std: grade.std,
            tibiofibular_overlap_mm: overlaps.tibiofibular_overlap_mm,
            tibiofibular_clear_space_mm: overlaps.tibiofibular_clear_space_mm,
            medial_clear_space_mm: overlaps.medial_clear_space_mm,
            superior_clear_space_mm: overlaps.superior_clear_space_mm,
            medial_malleolus_overlap_mm: overlaps.medial_malleolus_overlap_mm,
            lateral_malleolus_overlap_mm: overlaps.lateral_malleolus_overlap_mm,
            talar_crest_offset_mm: overlaps.talar_crest_offset_mm,
            medial_visibility: visibility.medial,
            superior_visibility: visibility.superior,
            lateral_visibility: visibility.lateral,
        })
    });
    let rows: Result<_, AutoLabelError> = rows.collect();
    Ok((rows?, sha256))
}

fn pose(
    row: &FileRow,
    what: &'static str,
    rows: Option<&Rows>,
) -> Result<Isometry3<f64>, AutoLabelError> {
    let usable = rows.and_then(|rows| isometry_from_rows(rows).ok());
    usable.ok_or_else(|| AutoLabelError::Pose {
        file: row.file.clone(),
        what,
    })
}

/// The middle of the rotations at which the worst gutter shows at least nine tenths of the most: both flanks are steep.
fn best_angle_deg(rows: &[ComputedRow]) -> f64 {
    let most = rows.iter().map(|row| row.worst).fold(0.0, f64::max);
    let near = rows.iter().filter(|row| row.worst >= 0.9 * most);
    let angles: Vec<f64> = near.map(|row| row.angle_deg).collect();
    angles.iter().sum::<f64>() / angles.len() as f64
}
