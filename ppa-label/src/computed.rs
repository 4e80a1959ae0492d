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
    /// Share of the medial gutter's height at which the malleolus covers the talus, see [`Hidden`](super::Hidden).
    pub medial_hidden_share: f64,
    /// By how many mm it does, median over that height.
    pub medial_hidden_mm: f64,
    /// The same of the lateral gutter.
    pub lateral_hidden_share: f64,
    /// The same of the lateral gutter.
    pub lateral_hidden_mm: f64,
    /// Grade of the medial gutter alone.
    pub medial_grade: f64,
    /// Of the superior one.
    pub superior_grade: f64,
    /// Of the lateral one.
    pub lateral_grade: f64,
    /// How good the worst gutter is before it is graded, 0 to 1.
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
    /// Rotation at which the worst gutter is best: the middle of what reaches nine tenths of the best.
    pub best_angle_deg: f64,
    /// Radiographs whose label in `labels.json` is that of readers.
    pub of_readers: usize,
    /// Whether `labels.json` holds labels without a source, and was left as it is.
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
    /// Results of an earlier computation that differ from the new ones.
    #[error(
        "{} holds other computed labels, or was computed with other settings: give --replace to replace it",
        .0.display()
    )]
    Differs(PathBuf),
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
    Scale(#[from] ScaleError),
    /// The name of the file that keeps computed labels where readers graded as well.
    #[error("labels.computed.json belongs to labels.json: choose a name other than {0}")]
    ReservedName(LabelName),
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
    target: Target,
}

/// Where labels are written.
#[derive(Debug, Clone)]
enum Target {
    /// `labels.json`, as it was found, and beside it `labels.computed.json`.
    Default(LabelFile),
    /// `labels.NAME.json`.
    Named(LabelName),
}

/// What computed labels need to know of the case of a limb.
#[derive(Debug, Clone, Copy)]
pub struct CaseBones<'a> {
    /// The kind of limb that the case gives, if it does.
    pub limb_kind: Option<LimbKind>,
    /// The file that labels its bones.
    pub file: Option<&'a BoneFile>,
    /// Identity of its scan.
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
    /// Refuses to replace results of an earlier computation that differ from these.
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
        // Computed labels had no file of their own in earlier versions.
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

    /// Writes `openness.csv`, `openness.json` (what it was computed with), `labels.computed.json` (all labels) and `labels.json`
    /// beside the limb's regions of interest, and their hashes to `labels.sha256`. In `labels.json` labels of readers stay, and computed ones stand where there are none; a
    /// file of labels without a source stays as it is. Labels with a name go to `openness.NAME.csv`, `openness.NAME.json` and
    /// `labels.NAME.json`; `labels.json` stays as it is.
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

    /// The files that hold nothing but what was computed.
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

/// The middle of the rotations at which the worst gutter reaches at least nine tenths of the best: both flanks are steep.
fn best_angle_deg(rows: &[ComputedRow]) -> f64 {
    let most = rows.iter().map(|row| row.worst).fold(0.0, f64::max);
    let near = rows.iter().filter(|row| row.worst >= 0.9 * most);
    let angles: Vec<f64> = near.map(|row| row.angle_deg).collect();
    angles.iter().sum::<f64>() / angles.len() as f64
}
