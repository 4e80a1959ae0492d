//! Labels and regions of interest in the lists of the other layout.

use std::collections::BTreeMap;

use serde_json::{Map, Value, json};

use super::convert::{ConvertError, Copy, Moved, depth_files};
use super::specimen::{depth_file_name, flexion_folder, radiograph_name};
use super::{Flexion, Label, Pose};
use crate::files::{FileError, write_whole};
use crate::labels::{LabelFile, LabelRow};
use crate::layout::LimbId;
use crate::manifest::{RoiFile, roi_text};

impl Copy<'_> {
    /// Writes the lists of all flexions, only one of which is filled; returns the number of labels.
    pub fn specimen_lists(&self, moved: &[Moved], filled: Flexion) -> Result<usize, FileError> {
        let (mut labels, mut rois) = (Map::new(), Map::new());
        for Moved { pair, pose } in moved {
            let Pose::Recorded {
                image_number,
                timestamp,
                ..
            } = *pose
            else {
                continue;
            };
            if let Some(label) = &pair.label {
                labels.insert(
                    radiograph_name(image_number),
                    label_entry(label, image_number),
                );
            }
            for (view, depth) in depth_files(pair) {
                if let Some(roi) = &depth.roi {
                    let roi = serde_json::to_value(roi).expect("regions hold only JSON values");
                    rois.insert(depth_file_name(view, image_number, timestamp), roi);
                }
            }
        }
        for flexion in Flexion::ALL {
            let folder = self
                .root
                .join(flexion_folder(self.limb, flexion))
                .join("label");
            for (list, entries) in [
                ("quality/labels.json", &labels),
                ("roi/roi_depth.json", &rois),
            ] {
                let entries = if flexion == filled {
                    entries.clone()
                } else {
                    Map::new()
                };
                write_whole(
                    &folder.join(list),
                    format!("{:#}", Value::Object(entries)).as_bytes(),
                )?;
            }
        }
        Ok(labels.len())
    }

    /// Writes the lists of a limb; returns the number of labels.
    pub fn synthetic_lists(&self, moved: &[Moved]) -> Result<usize, ConvertError> {
        let (mut labels, mut rois) = (BTreeMap::new(), RoiFile::new());
        for Moved { pair, pose } in moved {
            let Pose::Rotated { step, .. } = *pose else {
                continue;
            };
            if let Some(Label { label, std, source }) = pair.label {
                labels.insert(step, (LabelRow { label, std, step }, source));
            }
            for (view, depth) in depth_files(pair) {
                if let Some(roi) = &depth.roi {
                    rois.insert(LimbId::depth_name(view, step), roi.clone());
                }
            }
        }
        if !rois.is_empty() {
            write_whole(
                &self.root.join(self.limb.roi_file()),
                roi_text(&rois).as_bytes(),
            )?;
        }
        let count = labels.len();
        if count == 0 {
            return Ok(0);
        }
        let file = LabelFile::with_sources(labels.into_values());
        let file = file.map_err(|source| ConvertError::Label {
            patient: self.limb.patient,
            side: self.limb.side_letter(),
            source,
        })?;
        file.write(self.root, self.limb)?;
        Ok(count)
    }
}

fn label_entry(label: &Label, image_number: u32) -> Value {
    let mut entry = json!({"label": label.label, "std": label.std, "image_number": image_number});
    if let Some(source) = label.source {
        entry["label_source"] = json!(source);
    }
    entry
}
