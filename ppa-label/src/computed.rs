//! Computed labels of a dataset: a grade for every radiograph of a limb from the openness of its joint space.

use std::path::PathBuf;

use nalgebra::{Isometry3, Point3};
use ppa_core::TransformRows;
use ppa_dataset::checksums::Checksums;
use ppa_dataset::files::{FileError, write_whole};
use ppa_dataset::labels::{BoneFile, LabelError, LabelFile, LabelFileError, LabelName, LabelRow};
use ppa_dataset::layout::LimbId;
use ppa_dataset::manifest::{FileKind, FileRow, Manifest};
use ppa_depth::isometry_from_rows;
use ppa_scene::LimbKind;
use serde::Serialize;

use super::computation::Computation;
use super::described::Described;
use super::openness::{
    BoneFileError, Exposure, JointSpace, JointSpaceError, LabelScale, ReadBones, ScaleError,
    read_bones,
};
use super::table::table_bytes;
use super::tallies::TalliesError;

/// Results for one radiograph; a row of `openness.csv`.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct ComputedRow {
    /// Path of the radiograph from the dataset's root.
    pub image: String,
    /// Half degrees of medial rotation.
    pub step: u32,
    /// Degrees of medial rotation.
    pub angle_deg: f64,
    /// Openness of the medial gutter, 0 to 1.
    pub medial: f64,
    /// Openness of the superior gutter.
    pub superior: f64,
    /// Openness of the lateral gutter.
    pub lateral: f64,
    /// Share of the medial gutter's height over which the malleolus covers the talus, see [`Hidden`](super::Hidden).
    pub medial_hidden_share: f64,
    /// Width of that overlap, median over the gutter's height, mm.
    pub medial_hidden_mm: f64,
    /// The same share for the lateral gutter.
    pub lateral_hidden_share: f64,
    /// The same width for the lateral gutter.
    pub lateral_hidden_mm: f64,
    /// Grade of the medial gutter alone.
    pub medial_grade: f64,
    /// Grade of the superior gutter alone.
    pub superior_grade: f64,
    /// Grade of the lateral gutter alone.
    pub lateral_grade: f64,
    /// Quality of the worst gutter before grading, 0 to 1.
    pub worst: f64,
    /// Grade from 1 to 3 in half steps.
    pub label: f64,
    /// Half the range of grades under other tolerances and thresholds.
    pub std: f64,
    /// See [`Overlaps`](super::Overlaps) for this and the next six.
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
    /// Height of the medial above the lateral crest of the trochlea.
    pub talar_crest_offset_mm: f64,
    /// Visibility of the medial gutter in the radiograph, see [`Visibility`](super::Visibility).
    pub medial_visibility: f64,
    /// Visibility of the superior gutter.
    pub superior_visibility: f64,
    /// Visibility of the lateral gutter.
    pub lateral_visibility: f64,
}

/// Summary of [`ComputedLabels::write`].
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct LabelledLimb {
    /// The limb.
    #[serde(flatten)]
    pub limb: LimbId,
    /// Radiographs that were graded.
    pub radiographs: usize,
    /// Number of diagnostic ones, below 2.5.
    pub diagnostic: usize,
    /// Rotation at which the worst gutter is best: the mean of the rotations that reach nine tenths of the best.
    pub best_angle_deg: f64,
    /// Radiographs whose label in `labels.json` comes from readers.
    pub of_readers: usize,
    /// Whether `labels.json` contains labels without a source and was left unchanged.
    pub unnamed_kept: bool,
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
        "the case of {0} does not specify bones: create it again with `ppa prepare --bones` or `--segment-bones`"
    )]
    NoBones(LimbId),
    /// The dataset lists no radiographs of the limb.
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
    /// A radiograph with a missing or invalid pose of the device.
    #[error("{file} has no usable {what} in the manifest")]
    Pose {
        /// The radiograph.
        file: String,
        /// `ct_from_device` or `patient_from_ct`.
        what: &'static str,
    },
    /// Results of an earlier computation that differ from the new ones.
    #[error(
        "{} holds other computed labels, or was computed with other settings: give --replace to replace it",
        .0.display()
    )]
    Differs(PathBuf),
    /// The bones.
    #[error(transparent)]
    Bones(#[from] BoneFileError),
    /// The bones have no usable joint space.
    #[error("bones of {limb}")]
    JointSpace {
        /// The limb.
        limb: LimbId,
        /// The error.
        source: JointSpaceError,
    },
    /// The tallies of a radiograph.
    #[error(transparent)]
    Tallies(#[from] TalliesError),
    /// The thresholds.
    #[error(transparent)]
    Scale(#[from] ScaleError),
    /// A name of labels that is reserved for the file of all computed labels.
    #[error("labels.computed.json belongs to labels.json: choose a name other than {0}")]
    ReservedName(LabelName),
    /// A file.
    #[error(transparent)]
    File(#[from] FileError),
    /// The existing labels are invalid.
    #[error(transparent)]
    Labels(#[from] LabelFileError),
    /// A label off the grid.
    #[error(transparent)]
    Label(#[from] LabelError),
}

/// Computed labels of a limb that are not written yet.
#[derive(Debug, Clone)]
pub struct ComputedLabels<'a> {
    manifest: &'a Manifest,
    limb: LimbId,
    rows: Vec<ComputedRow>,
    labels: LabelFile,
    computation: String,
    target: Target,
}

/// Where labels are written.
#[derive(Debug, Clone)]
enum Target {
    /// `labels.json` as it was found, with `labels.computed.json` next to it.
    Default(LabelFile),
    /// `labels.NAME.json`.
    Named(LabelName),
}

/// The parts of a limb's case that computed labels need.
#[derive(Debug, Clone, Copy)]
pub struct CaseBones<'a> {
    /// The kind of limb, if the case states it.
    pub limb_kind: Option<LimbKind>,
    /// The file that labels its bones.
    pub file: Option<&'a BoneFile>,
    /// Hash of its scan.
    pub volume_sha256: &'a str,
}

/// Grades every radiograph of a limb from the bones of its case, for `labels.json` or, with a name, for `labels.NAME.json`.
///
/// # Errors
/// [`AutoLabelError`].
pub fn compute_labels<'a>(
    manifest: &'a Manifest,
    limb: LimbId,
    case: &CaseBones,
    scale: &LabelScale,
    name: Option<&LabelName>,
) -> Result<ComputedLabels<'a>, AutoLabelError> {
    let target = match name {
        None => Target::Default(LabelFile::read(&manifest.root, limb)?.unwrap_or_default()),
        Some(name) if name.as_str() == "computed" => {
            return Err(AutoLabelError::ReservedName(name.clone()));
        }
        Some(name) => Target::Named(name.clone()),
    };
    scale.check()?;
    if case.limb_kind == Some(LimbKind::Knee) {
        return Err(AutoLabelError::Knee(limb));
    }
    let file = case.file.ok_or(AutoLabelError::NoBones(limb))?;
    let scan = case.volume_sha256;
    let (rows, bones_sha256) = computed_rows(manifest, limb, scan, file, scale)?;
    let computation = Computation::new(file, &bones_sha256, scale);
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
        target,
    })
}

impl ComputedLabels<'_> {
    /// Checks that writing would not replace results of an earlier computation that differ from these.
    ///
    /// # Errors
    /// [`AutoLabelError::Differs`] naming the file.
    pub fn require_same(&self) -> Result<(), AutoLabelError> {
        for (path, bytes) in self.own_files() {
            if path.exists() && std::fs::read(&path).map_err(FileError::at("read", &path))? != bytes
            {
                return Err(AutoLabelError::Differs(path));
            }
        }
        let Target::Default(before) = &self.target else {
            return Ok(());
        };
        // Earlier versions stored no separate file of computed labels.
        let before = before.computed();
        let same = |row: &LabelRow| {
            self.labels.of_step(row.step) == Some(row)
                && self.labels.source_of_step(row.step) == before.source_of_step(row.step)
        };
        match before.labels().iter().all(same) {
            true => Ok(()),
            false => Err(AutoLabelError::Differs(LabelFile::path(
                &self.manifest.root,
                self.limb,
            ))),
        }
    }

    /// Writes `openness.csv`, `openness.json` (settings of the computation), `labels.computed.json` (all labels) and `labels.json` next to
    /// the limb's regions of interest, and their hashes to `labels.sha256`. In `labels.json`, readers' labels are kept, and computed ones
    /// fill the gaps; a file that contains labels without a source is left unchanged. Labels with a name go to `openness.NAME.csv`,
    /// `openness.NAME.json` and `labels.NAME.json`; `labels.json` is left unchanged.
    ///
    /// # Errors
    /// [`AutoLabelError`] if a file cannot be written.
    pub fn write(&self) -> Result<LabelledLimb, AutoLabelError> {
        let (root, limb) = (&self.manifest.root, self.limb);
        let mut written = Vec::new();
        for (path, bytes) in self.own_files() {
            write_whole(&path, &bytes)?;
            written.push(path);
        }
        let (mut of_readers, mut unnamed_kept) = (0, false);
        if let Target::Default(before) = &self.target {
            unnamed_kept = before.has_unnamed();
            if !unnamed_kept {
                let readers = before.not_computed();
                of_readers = readers.labels().len();
                readers.over(&self.labels).write(root, limb)?;
                written.push(LabelFile::path(root, limb));
            }
        }
        Checksums::record_labels(root, &written)?;
        Ok(LabelledLimb {
            limb,
            radiographs: self.rows.len(),
            diagnostic: self.rows.iter().filter(|row| row.label < 2.5).count(),
            best_angle_deg: best_angle_deg(&self.rows),
            of_readers,
            unnamed_kept,
        })
    }

    /// The files that contain only computed data.
    fn own_files(&self) -> [(PathBuf, Vec<u8>); 3] {
        let (root, limb) = (&self.manifest.root, self.limb);
        let (labels, stem) = match &self.target {
            Target::Default(_) => (LabelFile::computed_path(root, limb), "openness".to_owned()),
            Target::Named(name) => (
                LabelFile::named_path(root, limb, Some(name)),
                format!("openness.{name}"),
            ),
        };
        let beside = |kind: &str| labels.with_file_name(format!("{stem}.{kind}"));
        [
            (beside("csv"), table_bytes(&self.rows)),
            (beside("json"), self.computation.clone().into_bytes()),
            (labels.clone(), self.labels.to_text().into_bytes()),
        ]
    }
}

fn computed_rows(
    manifest: &Manifest,
    limb: LimbId,
    volume_sha256: &str,
    file: &BoneFile,
    scale: &LabelScale,
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
    if described.scan_of(limb) != Some(volume_sha256) {
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
    let ReadBones { bones, sha256 } = read_bones(file, &joint)?;
    let space = JointSpace::new(bones, &ct_from_patient).map_err(of_limb)?;
    let openness = space.openness(&exposures).map_err(of_limb)?;
    let rows = radiographs
        .iter()
        .zip(&devices)
        .zip(exposures.iter().zip(&openness));
    let rows = rows.map(|((row, device), (exposure, openness))| {
        let visibility = described.visibility(manifest, row, device, &space)?;
        let hidden = space.hidden(exposure);
        let grade = scale.grade(openness, &hidden);
        let [medial_grade, superior_grade, lateral_grade] = grade.gutters;
        let overlaps = space.overlaps(exposure);
        Ok(ComputedRow {
            image: row.file.clone(),
            step: row.step,
            angle_deg: row.angle_deg,
            medial: openness.medial[1],
            superior: openness.superior,
            lateral: openness.lateral[1],
            medial_hidden_share: hidden.medial.share,
            medial_hidden_mm: hidden.medial.median_mm,
            lateral_hidden_share: hidden.lateral.share,
            lateral_hidden_mm: hidden.lateral.median_mm,
            medial_grade,
            superior_grade,
            lateral_grade,
            worst: grade.worst,
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
    rows: Option<&TransformRows>,
) -> Result<Isometry3<f64>, AutoLabelError> {
    let usable = rows.and_then(|rows| isometry_from_rows(rows).ok());
    usable.ok_or_else(|| AutoLabelError::Pose {
        file: row.file.clone(),
        what,
    })
}

/// Mean of the rotations at which the worst gutter reaches at least nine tenths of the best: both flanks are steep.
fn best_angle_deg(rows: &[ComputedRow]) -> f64 {
    let most = rows.iter().map(|row| row.worst).fold(0.0, f64::max);
    let near = rows.iter().filter(|row| row.worst >= 0.9 * most);
    let angles: Vec<f64> = near.map(|row| row.angle_deg).collect();
    angles.iter().sum::<f64>() / angles.len() as f64
}
