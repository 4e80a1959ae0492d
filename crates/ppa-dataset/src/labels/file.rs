//! `labels.json`: the quality of every radiograph of a limb, in the published layout.

use std::collections::BTreeMap;
use std::fmt;
use std::path::{Path, PathBuf};

use serde::de::{Error as _, MapAccess, Visitor};
use serde::{Deserialize, Deserializer, Serialize, Serializer};

use super::label::{LabelError, LabelRow, LabelSource, radiograph_name};
use crate::files::{FileError, read_text, write_whole};
use crate::layout::LimbId;

/// `labels.json` lies beside the regions of interest.
fn path_of(root: &Path, limb: LimbId) -> PathBuf {
    root.join(limb.roi_file()).with_file_name("labels.json")
}

/// Why `labels.json` cannot be used.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum LabelFileError {
    /// It cannot be read or written.
    #[error(transparent)]
    File(#[from] FileError),
    /// It is no file of labels.
    #[error("{} holds no labels: {message}", path.display())]
    Parse {
        /// The file.
        path: PathBuf,
        /// What is wrong and where.
        message: String,
    },
}

/// The labels of one limb's radiographs, all from one source.
///
/// Readers' labels and computed ones never stand in one file.
#[derive(Debug, Clone, PartialEq)]
pub struct LabelFile {
    /// Who made them; `None` for a file that does not tell, as the published ones.
    pub source: Option<LabelSource>,
    /// By name of the radiograph, `xray_image_STEP.png`.
    rows: BTreeMap<String, LabelRow>,
}

impl LabelFile {
    /// Labels, in any order.
    ///
    /// # Errors
    /// [`LabelError`] for labels outside 1 to 3, spreads outside 0 to 1, and steps beyond 360.
    pub fn new(
        source: LabelSource,
        labels: impl IntoIterator<Item = LabelRow>,
    ) -> Result<Self, LabelError> {
        let named = labels.into_iter().map(|row| {
            let image = radiograph_name(row.step);
            row.check(&image).map(|()| (image, row))
        });
        Ok(Self {
            source: Some(source),
            rows: named.collect::<Result<_, _>>()?,
        })
    }

    /// Labels by step, lowest first.
    pub fn labels(&self) -> Vec<LabelRow> {
        let mut rows: Vec<_> = self.rows.values().copied().collect();
        rows.sort_unstable_by_key(|row| row.step);
        rows
    }

    /// The label of a step.
    pub fn of_step(&self, step: u32) -> Option<&LabelRow> {
        self.rows.get(&radiograph_name(step))
    }

    /// Reads `labels.json` of a limb; `None` if there is none.
    ///
    /// # Errors
    /// [`LabelFileError`] naming the file and the radiograph at fault: labels outside 1 to 3, angles off the grid of half
    /// degrees from 0 to 180, a radiograph twice, labels of two sources.
    pub fn read(root: &Path, limb: LimbId) -> Result<Option<Self>, LabelFileError> {
        let path = path_of(root, limb);
        if !path.try_exists().map_err(FileError::at("read", &path))? {
            return Ok(None);
        }
        let found = serde_json::from_str(&read_text(&path)?);
        found.map(Some).map_err(|error| LabelFileError::Parse {
            message: error.to_string(),
            path,
        })
    }

    /// Writes `labels.json` of a limb, whole or not at all.
    ///
    /// # Errors
    /// [`FileError`] when it cannot be written.
    pub fn write(&self, root: &Path, limb: LimbId) -> Result<(), FileError> {
        let text = serde_json::to_string_pretty(self).expect("labels are finite numbers");
        write_whole(&path_of(root, limb), text.as_bytes())
    }
}

/// A label as it stands in the file.
#[derive(Serialize, Deserialize)]
struct Entry {
    #[serde(flatten)]
    row: LabelRow,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    label_source: Option<LabelSource>,
}

impl Serialize for LabelFile {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        let label_source = self.source;
        let entry = |(image, &row)| (image, Entry { row, label_source });
        serializer.collect_map(self.rows.iter().map(entry))
    }
}

impl<'de> Deserialize<'de> for LabelFile {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        deserializer.deserialize_map(Rows)
    }
}

/// Reads row by row, since a map would keep the last of two rows of one name.
struct Rows;

impl<'de> Visitor<'de> for Rows {
    type Value = LabelFile;

    fn expecting(&self, f: &mut fmt::Formatter) -> fmt::Result {
        f.write_str("labels by name of the radiograph")
    }

    fn visit_map<A: MapAccess<'de>>(self, mut map: A) -> Result<LabelFile, A::Error> {
        let mut source: Option<Option<LabelSource>> = None;
        let mut rows = BTreeMap::new();
        while let Some((image, entry)) = map.next_entry::<String, Entry>()? {
            entry.row.check(&image).map_err(A::Error::custom)?;
            let expected = *source.get_or_insert(entry.label_source);
            if entry.label_source != expected {
                let name = |s: Option<LabelSource>| s.map_or("nobody named", LabelSource::name);
                return Err(A::Error::custom(LabelError::Mixed {
                    found: name(entry.label_source),
                    expected: name(expected),
                    image,
                }));
            }
            if rows.contains_key(&image) {
                return Err(A::Error::custom(format!("{image} stands there twice")));
            }
            rows.insert(image, entry.row);
        }
        Ok(LabelFile {
            source: source.flatten(),
            rows,
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::layout::Side;

    const LIMB: LimbId = LimbId {
        patient: 0,
        side: Side::Right,
    };

    fn read(text: &str) -> Result<LabelFile, String> {
        serde_json::from_str(text).map_err(|error| error.to_string())
    }

    /// The example of the published dataset's README.
    #[test]
    fn published_labels_are_read() {
        let text = r#"{"xray_image_180.png": {"label": 3.0, "std": 0.0, "step": 180}}"#;
        let found = read(text).unwrap();
        assert_eq!(found.source, None);
        let expected = LabelRow {
            label: 3.0,
            std: 0.0,
            step: 180,
        };
        assert_eq!(found.labels(), [expected]);
        assert_eq!(found.of_step(180), Some(&expected));
        let written: serde_json::Value = serde_json::to_value(&found).unwrap();
        assert_eq!(
            written,
            serde_json::from_str::<serde_json::Value>(text).unwrap()
        );
    }

    #[test]
    fn labels_come_back_as_they_were_written() {
        let root = tempfile::tempdir().unwrap();
        assert_eq!(LabelFile::read(root.path(), LIMB).unwrap(), None);
        let rows = [(100, 1.25), (9, 3.0), (36, 1.0)].map(|(step, label)| LabelRow {
            label,
            std: 0.1 + 0.2,
            step,
        });
        let labels = LabelFile::new(LabelSource::Surrogate, rows).unwrap();
        labels.write(root.path(), LIMB).unwrap();
        let path = root.path().join("patient_0/labels/r/labels.json");
        assert!(
            std::fs::read_to_string(path)
                .unwrap()
                .contains("surrogate-jso/1")
        );
        let found = LabelFile::read(root.path(), LIMB).unwrap().unwrap();
        assert_eq!(found, labels);
        let steps: Vec<u32> = found.labels().iter().map(|row| row.step).collect();
        assert_eq!(steps, [9, 36, 100]);
    }

    #[test]
    fn what_is_no_label_is_named() {
        let one = |name: &str, row: &str| read(&format!(r#"{{"{name}": {{{row}}}}}"#)).unwrap_err();
        let refused = [
            (
                "xray_image_36.png",
                r#""label": 3.5, "std": 0.0, "step": 36"#,
                "label 3.5, expected 1 to 3",
            ),
            (
                "xray_image_36.png",
                r#""label": 0.0, "std": 0.0, "step": 36"#,
                "label 0, expected 1 to 3",
            ),
            (
                "xray_image_36.png",
                r#""label": 1.0, "std": 1.5, "step": 36"#,
                "std 1.5, expected 0 to 1",
            ),
            (
                "xray_image_36.png",
                r#""label": 1.0, "std": 0.0, "step": 37"#,
                "step 37",
            ),
            (
                "xray_image_36.0.png",
                r#""label": 1.0, "std": 0.0, "step": 36"#,
                "xray_image_36.0.png has the step",
            ),
            (
                "xray_image_361.png",
                r#""label": 1.0, "std": 0.0, "step": 361"#,
                "180.5 degrees",
            ),
            (
                "xray_image_36.png",
                r#""label": 1.0, "step": 36"#,
                "missing field `std`",
            ),
            (
                "xray_image_36.png",
                r#""label": 1.0, "std": 0.0, "step": 36, "label_source": "me""#,
                "unknown variant `me`",
            ),
        ];
        for (name, row, expected) in refused {
            let said = one(name, row);
            assert!(said.contains(expected), "{said}");
        }
        let row = r#"{"label": 1.0, "std": 0.0, "step": 36}"#;
        let twice = format!(r#"{{"xray_image_36.png": {row}, "xray_image_36.png": {row}}}"#);
        assert!(
            read(&twice)
                .unwrap_err()
                .contains("xray_image_36.png stands there twice")
        );
        let beyond = LabelRow {
            label: 1.0,
            std: 0.0,
            step: 400,
        };
        let error = LabelFile::new(LabelSource::Readers, [beyond]).unwrap_err();
        assert_eq!(
            error,
            LabelError::Angle("xray_image_400.png".to_owned(), 200.0)
        );
    }

    #[test]
    fn readers_and_computed_labels_do_not_mix() {
        let by = |source: &str, step: u32| {
            format!(
                r#""xray_image_{step}.png": {{"label": 1.0, "std": 0.0, "step": {step}{source}}}"#
            )
        };
        let readers = r#", "label_source": "readers""#;
        let surrogate = r#", "label_source": "surrogate-jso/1""#;
        let said = read(&format!("{{{}, {}}}", by(readers, 1), by(surrogate, 2))).unwrap_err();
        assert!(
            said.contains("xray_image_2.png is labelled by surrogate-jso/1, others by readers"),
            "{said}"
        );
        assert!(read(&format!("{{{}, {}}}", by(readers, 1), by("", 2))).is_err());
        let found = read(&format!("{{{}, {}}}", by(readers, 1), by(readers, 2))).unwrap();
        assert_eq!(found.source, Some(LabelSource::Readers));
    }
}
