//! Charts of one limb: quantities against the angle, and depths.

use std::path::Path;

use maud::{Markup, html};
use ppa_core::text::number;
use ppa_dataset::BodyShape;
use ppa_dataset::labels::LabelSource;
use ppa_dataset::layout::{LimbId, View, angle_text};
use ppa_dataset::manifest::{FileRow, RoiFile};
use ppa_dataset::published::{GrayImage16, Pose, Published};

use super::chart::chart;
use super::figure::figure;
use super::histogram::Depths;
use super::outliers::{LEAST_POSES, outliers};
use super::scene::Scene;
use crate::chart::{Mark, Series};
use crate::contact_sheet::evenly_chosen;

/// Depth images per limb and camera used for histograms.
const SAMPLE: usize = 24;

/// Smallest jumps that count as outliers, mm and degrees.
const FLOOR: [f64; 2] = [0.5, 0.1];

pub(super) fn labels(dataset: &Published, limb: LimbId) -> Markup {
    let mut labels: Vec<_> = dataset
        .pairs
        .iter()
        .filter(|pair| pair.limb == limb)
        .filter_map(|pair| match (pair.pose, &pair.label) {
            (Pose::Rotated { step, .. }, Some(label)) => Some((step, label)),
            _ => None,
        })
        .collect();
    labels.dedup_by_key(|(step, _)| *step);
    if labels.is_empty() {
        return Markup::default();
    }
    let mut series: Vec<Series> = Vec::new();
    for (step, label) in labels {
        let name = label.source.map_or("source not named", LabelSource::name);
        let place = series.iter().position(|series| series.name == name);
        let place = place.unwrap_or_else(|| {
            series.push(Series::new(name, Mark::Line, Vec::new()));
            series.len() - 1
        });
        series[place]
            .points
            .push([f64::from(step) / 2.0, label.label]);
        series[place].spread.push(label.std);
    }
    chart(
        "medial rotation, degrees",
        "label: 1 ideal, 3 inadequate",
        series,
        Some([0.8, 3.2]),
    )
}

pub(super) fn histograms<'a>(
    root: &Path,
    rois: &RoiFile,
    of_view: impl Fn(View) -> Vec<&'a FileRow>,
) -> Markup {
    let mut series = Vec::new();
    for view in View::ALL {
        let rows = of_view(view);
        let steps: Vec<_> = rows.iter().map(|row| row.step).collect();
        if steps.is_empty() {
            continue;
        }
        let chosen = evenly_chosen(&steps, SAMPLE);
        let mut depths = Depths::default();
        for row in rows.into_iter().filter(|row| chosen.contains(&row.step)) {
            // Unreadable images are listed as flaws.
            let Ok(image) = GrayImage16::read(&root.join(&row.file)) else {
                continue;
            };
            depths.add(&image, rois.get(&LimbId::depth_name(view, row.step)));
        }
        let name = format!(
            "{}, {:.1} % without depth",
            view.name().replace('_', " "),
            100.0 * depths.invalid_share()
        );
        series.push(depths.series(&name));
    }
    chart("depth, mm", "pixels, %", series, None)
}

/// Charts and outliers of heights and tilts.
pub(super) struct Sweeps {
    /// Two charts.
    pub charts: Markup,
    /// A sentence on every pose that does not follow from its neighbours.
    pub html: Markup,
    /// Number of these poses.
    pub outliers: usize,
}

/// Quantities that are followed from pose to pose, with their units.
pub(super) const COURSES: [[&str; 2]; 2] = [
    ["height of the joint", "mm"],
    ["tilt of the axis", "degrees"],
];

/// One quantity over the poses of a body shape.
pub(super) struct Course {
    /// Angle and value of each pose.
    pub points: Vec<[f64; 2]>,
    /// Positions of the outliers.
    pub odd: Vec<usize>,
}

/// The course of a quantity of [`COURSES`] over poses by angle.
pub(super) fn course(scene: &Scene, rows: &[&FileRow], quantity: usize) -> Course {
    let point = |row: &&FileRow| [row.angle_deg, scene.height_and_tilt(row)[quantity]];
    let points: Vec<[f64; 2]> = rows.iter().map(point).collect();
    let odd = if points.len() < LEAST_POSES {
        Vec::new()
    } else {
        outliers(&points, FLOOR[quantity])
    };
    Course { points, odd }
}

/// Changes of height and tilt of a limb from pose to pose.
pub(super) fn heights_and_tilts(scene: &Scene, sweeps: &[(BodyShape, Vec<&FileRow>)]) -> Sweeps {
    let (mut charts, mut sentences) = (Vec::new(), Vec::new());
    for (i, [what, unit]) in COURSES.into_iter().enumerate() {
        let mut series = Vec::new();
        for (shape, rows) in sweeps {
            let Course { points, odd } = course(scene, rows, i);
            sentences.extend(odd.iter().map(|&at| {
                let angle = angle_text(rows[at].step);
                format!(
                    "{}, {angle} degrees: {what} {:.2} {unit} does not fit the neighbouring poses",
                    shape.name(),
                    number(points[at][1])
                )
            }));
            series.push(Series {
                ringed: odd.iter().map(|&at| points[at]).collect(),
                ..Series::new(shape.name(), Mark::Line, points)
            });
        }
        let caption = format!("{what} above the table, {unit}; outliers are ringed.");
        charts.push(figure(
            &caption,
            chart(
                "medial rotation, degrees",
                &format!("{what}, {unit}"),
                series,
                None,
            ),
        ));
    }
    let longest = sweeps.iter().map(|(_, rows)| rows.len()).max();
    let too_few = longest.is_none_or(|poses| poses < LEAST_POSES);
    let outliers = sentences.len();
    let html = html! {
        @if outliers > 0 {
            div class="caution" {
                p { "Poses that stand out:" }
                ul { @for sentence in sentences { li { (sentence) } } }
            }
        } @else if too_few {
            p { "Fewer than " (LEAST_POSES) " poses: too few to find outliers." }
        } @else {
            p { "No pose stands out from its neighbours." }
        }
    };
    Sweeps {
        charts: html! { @for chart in charts { (chart) } },
        html,
        outliers,
    }
}
