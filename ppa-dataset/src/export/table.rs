//! Table with one row per file and all its metadata.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use ppa_core::TransformRows;
use serde::{Deserialize, Serialize};
use serde_json::Value;

use crate::files::{FileError, read_text, write_whole};
use crate::labels::{LabelFile, LabelFileError};
use crate::layout::{LimbId, View};
use crate::manifest::{FileRow, Manifest};
use crate::split::{Split, SplitError};

/// Why a table cannot be made of a dataset.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum TableError {
    /// A file of the dataset, or the table itself.
    #[error(transparent)]
    File(#[from] FileError),
    /// The labels of a limb.
    #[error(transparent)]
    Labels(#[from] LabelFileError),
    /// Labels of radiographs that have since been replaced.
    #[error("{}: the label of step {step} is for a radiograph that has since been replaced; label the radiographs again", path.display())]
    Outdated {
        /// `labels.json` of the limb.
        path: PathBuf,
        /// Half degrees of rotation.
        step: u32,
    },
    /// An existing file that differs from what would be written.
    #[error("{} exists and differs from what would be written: give --replace to replace it", .0.display())]
    Differs(PathBuf),
    /// An invalid name, licence or date.
    #[error("{0}")]
    Metadata(String),
    /// The requested split.
    #[error(transparent)]
    Split(#[from] SplitError),
}

/// Columns of equal length.
///
/// | column | what |
/// |---|---|
/// | `file`, `sha256` | path from the root of the dataset, hash of its bytes |
/// | `kind` | `depth`, `radiograph` or `radiograph_tallies` |
/// | `unit` | the pose it belongs to, as `patient_0_r_036` |
/// | `patient`, `side`, `step`, `angle_deg` | person, `l` or `r`, half degrees and degrees of medial rotation |
/// | `camera`, `shape` | `cam_left` or `cam_right` of a depth image; body shape |
/// | `intrinsics` | lens of the camera: JSON of a camera file, pixels |
/// | `patient_from_ct`, `room_from_patient`, `room_from_camera`, `ct_from_device` | 4x4 rows as JSON, mm |
/// | `seed` | of the noise in the image |
/// | `dose_histories`, `scatter_histories` | of a radiograph: photons whose noise it carries (`inf`: none), photons followed; the same number of analog ones |
/// | `label`, `label_std`, `label_source` | quality of the pose, 1 (ideal) to 3 |
/// | `split` | part of the split that the person is in |
#[derive(Debug, Clone, PartialEq)]
pub struct Table {
    /// The columns, in a fixed order.
    pub columns: Vec<Column>,
    limbs: Vec<LimbId>,
}

/// One column.
#[derive(Debug, Clone, PartialEq)]
pub struct Column {
    /// Its name.
    pub name: &'static str,
    /// One value per file.
    pub values: Values,
}

/// Values of a column; `None` for files without a value.
#[derive(Debug, Clone, PartialEq)]
pub enum Values {
    /// Text.
    Text(Vec<Option<String>>),
    /// Whole numbers.
    Count(Vec<Option<u64>>),
    /// Numbers.
    Real(Vec<Option<f64>>),
}

impl Values {
    fn cell(&self, row: usize) -> String {
        match self {
            Self::Text(values) => values[row].clone().unwrap_or_default(),
            Self::Count(values) => values[row].map(|v| v.to_string()).unwrap_or_default(),
            Self::Real(values) => values[row].map(|v| v.to_string()).unwrap_or_default(),
        }
    }

    /// Number of rows.
    pub fn len(&self) -> usize {
        match self {
            Self::Text(values) => values.len(),
            Self::Count(values) => values.len(),
            Self::Real(values) => values.len(),
        }
    }

    /// Whether there is no row.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }
}

/// The part of `dataset.json` that applies to all rows of a manifest.
#[derive(Deserialize)]
struct Shared {
    settings: Settings,
    cameras: Vec<CameraRow>,
}

#[derive(Deserialize)]
struct Settings {
    xray: Xray,
}

#[derive(Deserialize)]
struct Xray {
    engine: Engine,
    /// The analog engine, if it was used instead of the other one.
    analog: Option<Analog>,
}

#[derive(Deserialize)]
struct Analog {
    histories: u64,
}

impl Xray {
    /// Photons whose noise an image carries (infinite for none), and photons that were followed.
    fn histories(&self) -> (f64, u64) {
        match (&self.analog, &self.engine) {
            (Some(analog), _) => (analog.histories as f64, analog.histories),
            (None, fast) => (
                fast.dose_histories.unwrap_or(f64::INFINITY),
                fast.scatter_histories,
            ),
        }
    }
}

#[derive(Deserialize)]
struct Engine {
    /// `None` for an image without noise, since JSON cannot store infinity.
    dose_histories: Option<f64>,
    scatter_histories: u64,
}

#[derive(Deserialize)]
struct CameraRow {
    view: View,
    intrinsics: Value,
    room_from_camera: TransformRows,
}

impl Table {
    /// Builds the table of the finished dataset in `root`; `split` names one of its splits.
    ///
    /// # Errors
    /// [`TableError`] naming the file at fault.
    pub fn of_dataset(root: &Path, split: Option<&str>) -> Result<Self, TableError> {
        let manifest = Manifest::read(root)?;
        let path = root.join("dataset.json");
        let shared: Shared = serde_json::from_str(&read_text(&path)?)
            .map_err(|e| FileError::at("parse", &path)(e.into()))?;
        let mut labels = BTreeMap::new();
        for limb in manifest.limbs() {
            if let Some(file) = LabelFile::read(root, limb)? {
                if let Some(&step) = file.outdated(&manifest, limb).first() {
                    let path = LabelFile::path(root, limb);
                    return Err(TableError::Outdated { path, step });
                }
                labels.insert(limb, file);
            }
        }
        let split = split
            .map(|name| Split::read(&Split::path(root, name)))
            .transpose()?;
        if let Some(split) = &split {
            let mut patients: Vec<_> = manifest.limbs().iter().map(|limb| limb.patient).collect();
            patients.dedup();
            split.check(&patients)?;
        }
        let limbs = manifest.limbs();
        let columns = columns(&manifest.files, &shared, &labels, split.as_ref());
        Ok(Self { columns, limbs })
    }

    /// The limbs in the table, in order.
    pub(super) fn limbs(&self) -> &[LimbId] {
        &self.limbs
    }

    fn values(&self, name: &str) -> Option<&Values> {
        let column = self.columns.iter().find(|column| column.name == name);
        column.map(|column| &column.values)
    }

    /// A column of text.
    pub(super) fn texts(&self, name: &str) -> impl Iterator<Item = Option<&str>> {
        let texts = match self.values(name) {
            Some(Values::Text(texts)) => texts.as_slice(),
            _ => &[],
        };
        texts.iter().map(Option::as_deref)
    }

    /// A column of numbers.
    pub(super) fn reals(&self, name: &str) -> impl Iterator<Item = Option<f64>> {
        let reals = match self.values(name) {
            Some(Values::Real(reals)) => reals.as_slice(),
            _ => &[],
        };
        reals.iter().copied()
    }

    /// Number of files.
    pub fn rows(&self) -> usize {
        self.columns.first().map_or(0, |column| column.values.len())
    }

    /// The table as CSV with a header line; missing values are empty.
    pub fn to_csv(&self) -> Vec<u8> {
        let mut writer = csv::Writer::from_writer(Vec::new());
        let names = self.columns.iter().map(|column| column.name);
        writer.write_record(names).expect("memory takes all");
        for row in 0..self.rows() {
            let cells = self.columns.iter().map(|column| column.values.cell(row));
            writer.write_record(cells).expect("memory takes all");
        }
        writer.into_inner().expect("memory takes all")
    }

    /// Writes the table as CSV, or with the feature `parquet` as Parquet, by the extension of `path`; completely or not at all.
    ///
    /// # Errors
    /// [`FileError`] for other extensions, or when it cannot be written.
    pub fn write(&self, path: &Path) -> Result<(), FileError> {
        match path.extension().and_then(|extension| extension.to_str()) {
            Some("csv") => write_whole(path, &self.to_csv()),
            #[cfg(feature = "parquet")]
            Some("parquet") => write_whole(path, &self.to_parquet()),
            _ => {
                let kinds = if cfg!(feature = "parquet") {
                    ".csv or .parquet"
                } else {
                    ".csv (.parquet needs a program built with the feature parquet)"
                };
                let text = format!("expected a name ending in {kinds}");
                Err(FileError::at("write", path)(std::io::Error::other(text)))
            }
        }
    }
}

/// The columns of [`Table`].
fn columns(
    rows: &[FileRow],
    shared: &Shared,
    labels: &BTreeMap<LimbId, LabelFile>,
    split: Option<&Split>,
) -> Vec<Column> {
    let text = |name, of: &dyn Fn(&FileRow) -> Option<String>| Column {
        name,
        values: Values::Text(rows.iter().map(of).collect()),
    };
    let count = |name, of: &dyn Fn(&FileRow) -> Option<u64>| Column {
        name,
        values: Values::Count(rows.iter().map(of).collect()),
    };
    let real = |name, of: &dyn Fn(&FileRow) -> Option<f64>| Column {
        name,
        values: Values::Real(rows.iter().map(of).collect()),
    };
    let camera = |row: &FileRow| shared.cameras.iter().find(|c| Some(c.view) == row.camera);
    let radiograph = |row: &FileRow| row.ct_from_device.map(|_| shared.settings.xray.histories());
    let label = |row: &FileRow| labels.get(&row.limb)?.of_step(row.step).copied();
    vec![
        text("file", &|row| Some(row.file.clone())),
        text("sha256", &|row| Some(row.sha256.clone())),
        text("kind", &|row| name(&row.kind)),
        text("unit", &|row| Some(row.limb.unit_name(row.step))),
        count("patient", &|row| Some(row.limb.patient.into())),
        text("side", &|row| Some(row.limb.side_letter().to_owned())),
        count("step", &|row| Some(row.step.into())),
        real("angle_deg", &|row| Some(row.angle_deg)),
        text("camera", &|row| Some(row.camera?.name().to_owned())),
        text("shape", &|row| Some(row.shape.name().to_owned())),
        text("intrinsics", &|row| json(&camera(row)?.intrinsics)),
        text("patient_from_ct", &|row| json(&row.patient_from_ct)),
        text("room_from_patient", &|row| json(&row.room_from_patient)),
        text("room_from_camera", &|row| {
            json(&camera(row)?.room_from_camera)
        }),
        text("ct_from_device", &|row| json(&row.ct_from_device?)),
        count("seed", &|row| row.seed),
        real("dose_histories", &|row| Some(radiograph(row)?.0)),
        count("scatter_histories", &|row| Some(radiograph(row)?.1)),
        real("label", &|row| Some(label(row)?.label)),
        real("label_std", &|row| Some(label(row)?.std)),
        text("label_source", &|row| {
            name(&labels.get(&row.limb)?.source_of_step(row.step)?)
        }),
        text("split", &|row| {
            Some(split?.part_of(row.limb.patient)?.to_owned())
        }),
    ]
}

fn json(value: &impl Serialize) -> Option<String> {
    Some(serde_json::to_string(value).expect("manifests hold only JSON values"))
}

/// The name of an enumeration's value in JSON.
fn name(value: &impl Serialize) -> Option<String> {
    let value = serde_json::to_value(value).expect("manifests hold only JSON values");
    value.as_str().map(str::to_owned)
}
