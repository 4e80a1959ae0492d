//! Share of each region of interest that shows a face where the field of view of the CT cut the limb.

use std::collections::BTreeMap;

use maud::Markup;
use ppa_dataset::BodyShape;
use ppa_dataset::layout::View;
use ppa_dataset::manifest::{FileKind, FileRow};

use super::chart::chart;
use crate::chart::{Mark, Series};

fn share(row: &FileRow) -> f64 {
    row.cut_share.unwrap_or(0.0)
}

/// The shares of a limb's images against rotation, with a curve per camera and one for the radiographs, and the largest share in
/// percent; `None` if nothing is cut. With several body shapes, each pose has its largest share.
pub(super) fn cut_shares(rows: &[&FileRow]) -> Option<(Markup, f64)> {
    let largest = rows.iter().map(|row| share(row)).fold(0.0, f64::max);
    if largest == 0.0 {
        return None;
    }
    let svg = chart(
        "medial rotation, degrees",
        "cut share, %",
        curves(rows),
        Some([0.0, 110.0 * largest]),
    );
    Some((svg, 100.0 * largest))
}

fn curves(rows: &[&FileRow]) -> Vec<Series> {
    let curve = |name: &str, of: &dyn Fn(&FileRow) -> bool| {
        let mut points: BTreeMap<u32, [f64; 2]> = BTreeMap::new();
        for row in rows.iter().filter(|row| of(row)) {
            let point = points.entry(row.step).or_insert([row.angle_deg, 0.0]);
            point[1] = point[1].max(100.0 * share(row));
        }
        Series::new(name, Mark::Line, points.into_values().collect())
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
    series
}

#[cfg(test)]
mod tests {
    use serde_json::json;

    use super::*;

    #[test]
    fn the_largest_share_of_a_pose_is_drawn() {
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
        let rows: Vec<FileRow> = rows
            .into_iter()
            .map(|row| serde_json::from_value(row).unwrap())
            .collect();
        let rows: Vec<&FileRow> = rows.iter().collect();
        let (_, largest) = cut_shares(&rows).unwrap();
        assert_eq!(largest, 20.0);
        let points = vec![[0.0, 0.0], [10.0, 20.0]];
        assert_eq!(curves(&rows), [Series::new("cam left", Mark::Line, points)]);
        assert!(cut_shares(&rows[..1]).is_none());
    }
}
