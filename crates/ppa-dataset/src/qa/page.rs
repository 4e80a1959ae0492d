//! The page: what stands on it, and in which order.

use std::path::Path;

use super::chart::{Series, chart};
use super::histogram::Depths;
use super::outliers::{LEAST_POSES, outliers};
use super::scene::{Scene, height_and_tilt};
use super::views::{depth_view, embedded};
use crate::body_shape::BodyShape;
use crate::contact_sheet::{ContactSheetError, contact_sheet, evenly_chosen};
use crate::files::FileError;
use crate::layout::{LimbId, View, angle_text};
use crate::manifest::{FileKind, FileRow, Manifest, RoiFile};
use crate::published::{Flaw, GrayImage16, ImageFileError, Published, PublishedError, inspect};
use crate::split::{Split, SplitError};

/// Poses on the contact sheet of a limb.
const COLUMNS: usize = 7;

/// Depth images per limb and camera that histograms are made of.
const SAMPLE: usize = 24;

/// Outliers are looked for beyond these jumps, mm and degrees.
const FLOOR: [f64; 2] = [0.5, 0.1];

/// Why there is no page.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum QaError {
    /// A file of the dataset.
    #[error(transparent)]
    File(#[from] FileError),
    /// An image of the dataset.
    #[error(transparent)]
    Image(#[from] ImageFileError),
    /// Its layout or lists.
    #[error(transparent)]
    Published(#[from] PublishedError),
    /// One of its splits.
    #[error(transparent)]
    Split(#[from] SplitError),
    /// Its contact sheets.
    #[error(transparent)]
    ContactSheet(#[from] ContactSheetError),
}

/// The dataset in `root`, which `ppa generate` finished, as one page of HTML without any address outside of it: checks of all
/// files, contact sheets, regions and joints in whole images, labels against angle, depths, heights and tilts with outliers, origin.
///
/// # Errors
/// [`QaError`] naming the file at fault. Flaws of single images stand on the page; damaged ones that it would show are errors.
pub fn qa_page(root: &Path) -> Result<String, QaError> {
    let inspection = inspect(root)?;
    let manifest = Manifest::read(root)?;
    let dataset = Published::read(root)?;
    let scene = Scene::read(root)?;
    let mut page = String::from(HEAD);
    page += &format!(
        "<h1>Dataset of {} persons</h1><p>{} limbs, {} image pairs, {} depth images, {} radiographs, {} pairs with a label.</p>",
        inspection.patients,
        inspection.limbs,
        inspection.pairs,
        inspection.depth_images,
        inspection.radiographs,
        inspection.labelled
    );
    page += &checks(root, &inspection.flaws);
    page += &splits(root, &dataset.patients())?;
    for limb in manifest.limbs() {
        page += &limb_section(root, &manifest, &dataset, &scene, limb)?;
    }
    page += &provenance(&scene);
    Ok(page + "</main></body></html>\n")
}

const HEAD: &str = concat!(
    "<!DOCTYPE html><html lang=\"en\"><head><meta charset=\"utf-8\"><meta name=\"viewport\" content=\"width=device-width\">",
    "<title>Dataset, looked over</title><style>",
    include_str!("page.css"),
    "</style></head><body><main>"
);

fn checks(root: &Path, flaws: &[Flaw]) -> String {
    const TOLD: usize = 50;
    if flaws.is_empty() {
        return "<p class=\"good\">Every image could be decoded and is as in manifest.jsonl; no region reaches beyond its image.</p>".to_owned();
    }
    let told = flaws.iter().take(TOLD);
    let told = told.map(|flaw| format!("<li>{}</li>", escaped(&without_folder(flaw, root))));
    format!(
        "<div class=\"bad\"><p>{} flaws:</p><ul>{}</ul></div>",
        flaws.len(),
        told.collect::<String>()
    )
}

/// An error with its causes. The page may be passed on: where the dataset lay is nobody's business.
fn without_folder(error: &dyn std::error::Error, root: &Path) -> String {
    let mut text = error.to_string();
    let mut cause = error.source();
    while let Some(source) = cause {
        text += &format!(": {source}");
        cause = source.source();
    }
    let folder = root.join("").display().to_string();
    text.replace(&folder, "")
}

fn splits(root: &Path, patients: &[u32]) -> Result<String, QaError> {
    let mut rows = String::new();
    for name in Split::names(root)? {
        let read = Split::read(&Split::path(root, &name))
            .and_then(|split| split.check(patients).map(|()| split));
        rows += &match read {
            Err(error) => format!(
                "<tr class=\"bad\"><td>{}</td><td>{}</td></tr>",
                escaped(&name),
                escaped(&without_folder(&error, root))
            ),
            Ok(split) => {
                let parts = split
                    .parts
                    .iter()
                    .map(|(part, of)| format!("{}: {of:?}", escaped(part)));
                format!(
                    "<tr><td>{}</td><td>{}</td></tr>",
                    escaped(&name),
                    parts.collect::<Vec<_>>().join("; ")
                )
            }
        };
    }
    if rows.is_empty() {
        return Ok("<p>No split yet.</p>".to_owned());
    }
    Ok(format!("<h2>Splits by person</h2><table>{rows}</table>"))
}

fn limb_section(
    root: &Path,
    manifest: &Manifest,
    dataset: &Published,
    scene: &Scene,
    limb: LimbId,
) -> Result<String, QaError> {
    let rois = manifest.rois(limb)?;
    let rows: Vec<_> = manifest
        .files
        .iter()
        .filter(|row| row.limb == limb)
        .collect();
    let depth = |shape: BodyShape, view: View| {
        let of = rows
            .iter()
            .copied()
            .filter(move |row| row.shape == shape && row.camera == Some(view));
        let mut of: Vec<&FileRow> = of.collect();
        of.sort_by_key(|row| row.step);
        of
    };
    let mut shapes: Vec<_> = rows
        .iter()
        .filter(|row| row.kind == FileKind::Depth)
        .map(|row| row.shape)
        .collect();
    shapes.sort_unstable();
    shapes.dedup();
    let mut section = format!("<h2>Patient {}, {}</h2>", limb.patient, side(limb));
    section += "<h3>Poses</h3>";
    let sheet = contact_sheet(root, limb, COLUMNS)?;
    section += &embedded(
        &sheet,
        "Depth images in false colour and radiographs by rotation",
        root,
    )?;
    section += "<div class=\"charts\">";
    section += &figure(
        "Label of each pose; the band is its spread.",
        labels(dataset, limb),
    );
    section += &figure(
        "Depths in the regions of interest, share of the valid pixels per 10 mm.",
        histograms(root, &rois, |view| depth(shapes[0], view))?,
    );
    let sweeps: Vec<_> = shapes
        .iter()
        .map(|&shape| (shape, depth(shape, View::Left)))
        .collect();
    let (charts, told) = heights_and_tilts(&sweeps);
    section += &charts;
    section += "</div>";
    section += &told;
    section += "<h3>Regions of interest and the joint in whole images</h3><div class=\"views\">";
    for view in View::ALL {
        let of_view = depth(shapes[0], view);
        let steps: Vec<_> = of_view.iter().map(|row| row.step).collect();
        let chosen = if steps.is_empty() {
            Vec::new()
        } else {
            evenly_chosen(&steps, 3)
        };
        for row in of_view.into_iter().filter(|row| chosen.contains(&row.step)) {
            section += &whole_view(root, row, &rois, scene, view)?;
        }
    }
    Ok(section + "</div>")
}

fn side(limb: LimbId) -> &'static str {
    if limb.side_letter() == "l" {
        "left"
    } else {
        "right"
    }
}

fn figure(caption: &str, content: String) -> String {
    if content.is_empty() {
        return String::new();
    }
    format!("<figure>{content}<figcaption>{caption}</figcaption></figure>")
}

fn labels(dataset: &Published, limb: LimbId) -> String {
    let mut labels: Vec<_> = dataset
        .pairs
        .iter()
        .filter(|pair| pair.limb == limb)
        .filter_map(|pair| match (pair.pose, &pair.label) {
            (crate::published::Pose::Rotated { step, .. }, Some(label)) => Some((step, label)),
            _ => None,
        })
        .collect();
    labels.dedup_by_key(|(step, _)| *step);
    let Some((_, first)) = labels.first() else {
        return String::new();
    };
    let source = first
        .source
        .and_then(|source| serde_json::to_value(source).ok());
    let name = source
        .as_ref()
        .and_then(|source| source.as_str())
        .unwrap_or("source not told");
    let series = Series {
        name: name.to_owned(),
        points: labels
            .iter()
            .map(|(step, label)| [f64::from(*step) / 2.0, label.label])
            .collect(),
        spread: labels.iter().map(|(_, label)| label.std).collect(),
        marked: Vec::new(),
    };
    chart(
        "medial rotation, degrees",
        "label: 1 ideal, 3 inadequate",
        &[series],
        Some([0.8, 3.2]),
    )
}

fn histograms<'a>(
    root: &Path,
    rois: &RoiFile,
    of_view: impl Fn(View) -> Vec<&'a FileRow>,
) -> Result<String, QaError> {
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
            let image = GrayImage16::read(&root.join(&row.file))?;
            depths.add(&image, rois.get(&LimbId::depth_name(view, row.step)));
        }
        let name = format!(
            "{}, {:.1} % without depth",
            view.name().replace('_', " "),
            100.0 * depths.invalid_share()
        );
        series.push(depths.series(&name));
    }
    Ok(chart("depth, mm", "pixels, %", &series, None))
}

/// Two charts, and a sentence on every pose that does not follow from its neighbours.
fn heights_and_tilts(sweeps: &[(BodyShape, Vec<&FileRow>)]) -> (String, String) {
    let (mut charts, mut told) = (String::new(), Vec::new());
    for (i, [what, unit]) in [
        ["height of the joint", "mm"],
        ["tilt of the axis", "degrees"],
    ]
    .into_iter()
    .enumerate()
    {
        let mut series = Vec::new();
        for (shape, rows) in sweeps {
            let values: Vec<f64> = rows.iter().map(|row| height_and_tilt(row)[i]).collect();
            let points: Vec<_> = rows
                .iter()
                .zip(&values)
                .map(|(row, value)| [row.angle_deg, *value])
                .collect();
            let odd = if values.len() < LEAST_POSES {
                Vec::new()
            } else {
                outliers(&values, FLOOR[i])
            };
            told.extend(odd.iter().map(|&at| {
                let angle = angle_text(rows[at].step);
                format!(
                    "<li>{}, {angle} degrees: {what} {:.2} {unit} is off those beside it</li>",
                    shape.name(),
                    values[at]
                )
            }));
            let marked = odd.iter().map(|&at| points[at]).collect();
            series.push(Series {
                name: shape.name().to_owned(),
                points,
                spread: Vec::new(),
                marked,
            });
        }
        let caption = format!("{what} in the room, {unit}; outliers are ringed.");
        charts += &figure(
            &caption,
            chart(
                "medial rotation, degrees",
                &format!("{what}, {unit}"),
                &series,
                None,
            ),
        );
    }
    let longest = sweeps.iter().map(|(_, rows)| rows.len()).max();
    let told = match told.len() {
        0 if longest.is_none_or(|poses| poses < LEAST_POSES) => {
            format!("<p>Fewer than {LEAST_POSES} poses: too few to tell which stands out.</p>")
        }
        0 => "<p class=\"good\">No pose stands out from those beside it.</p>".to_owned(),
        _ => format!(
            "<div class=\"bad\"><p>Poses that stand out:</p><ul>{}</ul></div>",
            told.concat()
        ),
    };
    (charts, told)
}

fn whole_view(
    root: &Path,
    row: &FileRow,
    rois: &RoiFile,
    scene: &Scene,
    view: View,
) -> Result<String, QaError> {
    let image = GrayImage16::read(&root.join(&row.file))?;
    let roi = rois.get(&LimbId::depth_name(view, row.step));
    let picture = depth_view(&image, roi, scene.joint_pixel(row));
    let text = format!(
        "{}, {} degrees",
        view.name().replace('_', " "),
        angle_text(row.step)
    );
    Ok(figure(&text, embedded(&picture, &text, root)?))
}

fn provenance(scene: &Scene) -> String {
    let scans = scene.limbs.iter().map(|limb| {
        let name = format!("patient {} {}", limb.patient, escaped(&limb.side));
        format!(
            "<tr><td>{name}</td><td><code>{}</code></td></tr>",
            escaped(&limb.volume_sha256)
        )
    });
    format!(
        "<h2>Origin</h2><p>Made by {} from sources <code>{}</code> with seed {}. All settings stand in dataset.json, pose and \
         hash of every image in manifest.jsonl.</p><table><tr><th>limb</th><th>SHA-256 of the scan's voxels</th></tr>{}</table>",
        escaped(&scene.generator),
        escaped(&scene.code),
        scene.seed,
        scans.collect::<String>()
    )
}

fn escaped(text: &str) -> String {
    text.replace('&', "&amp;")
        .replace('<', "&lt;")
        .replace('>', "&gt;")
        .replace('"', "&quot;")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn where_a_dataset_lay_is_not_told() {
        for root in ["/home/name/data", "/home/name/data/"] {
            let path = Path::new(root).join("splits/x.json");
            let error = crate::files::read_text(&path).unwrap_err();
            let told = without_folder(&error, Path::new(root));
            assert!(
                told.contains("splits/x.json") && !told.contains("name"),
                "{told}"
            );
        }
    }
}
