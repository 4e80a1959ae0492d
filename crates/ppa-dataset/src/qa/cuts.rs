//! How much of each region of interest shows a face where the field of view of the CT cut the limb.

use std::collections::BTreeMap;
use std::path::Path;

use serde::Deserialize;

use super::chart::{Series, chart};
use crate::body_shape::BodyShape;
use crate::files::{FileError, read_text};
use crate::layout::View;
use crate::manifest::{FileKind, FileRow, Manifest};

/// What the page needs of a row of the manifest besides [`FileRow`].
#[derive(Deserialize)]
struct CutRow {
    file: String,
    #[serde(default)]
    cut_share: Option<f64>,
}

/// Share of the region of each image that shows a cut face, by file, where it is above 0.
pub(super) struct CutShares(BTreeMap<String, f64>);

impl CutShares {
    /// Reads the key `cut_share` of the rows of `manifest.jsonl`.
    pub fn read(root: &Path) -> Result<Self, FileError> {
        let path = root.join(Manifest::FILE);
        let text = read_text(&path)?;
        let mut shares = BTreeMap::new();
        for line in text.lines() {
            let row: CutRow = serde_json::from_str(line)
                .map_err(|e| FileError::at("parse", &path)(std::io::Error::from(e)))?;
            let share = row.cut_share.filter(|share| *share > 0.0);
            shares.extend(share.map(|share| (row.file, share)));
        }
        Ok(Self(shares))
    }

    fn of(&self, row: &FileRow) -> f64 {
        self.0.get(&row.file).copied().unwrap_or(0.0)
    }

    /// The shares of a limb's images against rotation, a curve per camera and one of the radiographs, and the largest of them in
    /// percent; `None` where nothing is cut. Of several body shapes each pose has its largest share.
    pub fn chart(&self, rows: &[&FileRow]) -> Option<(String, f64)> {
        let largest = rows.iter().map(|row| self.of(row)).fold(0.0, f64::max);
        if largest == 0.0 {
            return None;
        }
        let curve = |name: &str, of: &dyn Fn(&FileRow) -> bool| {
            let mut points: BTreeMap<u32, [f64; 2]> = BTreeMap::new();
            for row in rows.iter().filter(|row| of(row)) {
                let point = points.entry(row.step).or_insert([row.angle_deg, 0.0]);
                point[1] = point[1].max(100.0 * self.of(row));
            }
            Series {
                name: name.to_owned(),
                points: points.into_values().collect(),
                spread: Vec::new(),
                marked: Vec::new(),
            }
        };
        let camera = |view: View| {
            let name = view.name().replace('_', " ");
            curve(&name, &move |row: &FileRow| row.camera == Some(view))
        };
        let radiograph =
            |row: &FileRow| row.kind == FileKind::Radiograph && row.shape == BodyShape::Orig;
        let mut series = Vec::from(View::ALL.map(camera));
        series.push(curve("radiograph", &radiograph));
        series.retain(|series| !series.points.is_empty());
        let svg = chart(
            "medial rotation, degrees",
            "cut share, %",
            &series,
            Some([0.0, 110.0 * largest]),
        );
        Some((svg, 100.0 * largest))
    }
}

#[cfg(test)]
mod tests {
    use serde_json::json;

    use super::*;

    #[test]
    fn the_largest_share_of_a_pose_is_drawn() {
        let folder = tempfile::tempdir().unwrap();
        let pose = [
            [1.0, 0.0, 0.0, 0.0],
            [0.0, 1.0, 0.0, 0.0],
            [0.0, 0.0, 1.0, 0.0],
            [0.0, 0.0, 0.0, 1.0],
        ];
        let row = |file: &str, step: u32, shape: &str, cut: Option<f64>| {
            let mut row = json!({
                "file": file, "sha256": "", "kind": "depth", "patient": 0, "side": "l", "step": step,
                "angle_deg": f64::from(step) / 2.0, "camera": "cam_left", "shape": shape, "patient_from_ct": pose,
                "room_from_patient": pose,
            });
            if let Some(cut) = cut {
                row["cut_share"] = json!(cut);
            }
            row
        };
        let rows = [
            row("a", 0, "orig", None),
            row("b", 20, "orig", Some(0.05)),
            row("c", 20, "big", Some(0.2)),
        ];
        let text: String = rows.iter().map(|row| format!("{row}\n")).collect();
        std::fs::write(folder.path().join("manifest.jsonl"), text).unwrap();
        let shares = CutShares::read(folder.path()).unwrap();
        let rows: Vec<FileRow> = rows
            .into_iter()
            .map(|row| serde_json::from_value(row).unwrap())
            .collect();
        let (svg, largest) = shares.chart(&rows.iter().collect::<Vec<_>>()).unwrap();
        assert_eq!(largest, 20.0);
        // From 0 at the left bottom to 20 of 22 % at the right.
        assert!(svg.contains("d=\"M52.0 200.0L448.0 30.9\""), "{svg}");
        assert!(
            svg.contains("cam left") && !svg.contains("radiograph"),
            "{svg}"
        );
        assert!(shares.chart(&[&rows[0]]).is_none());
    }
}
