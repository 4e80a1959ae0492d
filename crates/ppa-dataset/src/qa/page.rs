//! The page: what stands on it, and in which order.

use std::path::Path;

use super::curves::{heights_and_tilts, histograms, labels};
use super::scene::Scene;
use super::views::{depth_view, embedded};
use crate::body_shape::BodyShape;
use crate::contact_sheet::{ContactSheetError, contact_sheet, evenly_chosen};
use crate::files::FileError;
use crate::layout::{LimbId, View, angle_text};
use crate::manifest::{FileKind, FileRow, Manifest, RoiFile};
use crate::published::{Flaw, GrayImage16, Published, PublishedError, inspect};
use crate::split::{Split, SplitError};

/// Poses on the contact sheet of a limb.
const COLUMNS: usize = 7;

/// Why there is no page.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum QaError {
    /// A file of the dataset.
    #[error(transparent)]
    File(#[from] FileError),
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
/// [`QaError`] naming the file at fault. Flaws of single images stand on the page, and a cross in their place.
pub fn qa_page(root: &Path) -> Result<String, QaError> {
    let inspection = inspect(root)?;
    let manifest = Manifest::read(root)?;
    let dataset = Published::list(root)?;
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
    if shapes.is_empty() {
        return Ok(section + "<p class=\"bad\">No depth images.</p>");
    }
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
        histograms(root, &rois, |view| depth(shapes[0], view)),
    );
    let sweeps: Vec<_> = shapes
        .iter()
        .map(|&shape| (shape, depth(shape, View::Left)))
        .collect();
    let (charts, told) = heights_and_tilts(scene, &sweeps);
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

pub(super) fn figure(caption: &str, content: String) -> String {
    if content.is_empty() {
        return String::new();
    }
    format!("<figure>{content}<figcaption>{caption}</figcaption></figure>")
}

fn whole_view(
    root: &Path,
    row: &FileRow,
    rois: &RoiFile,
    scene: &Scene,
    view: View,
) -> Result<String, QaError> {
    let text = format!(
        "{}, {} degrees",
        view.name().replace('_', " "),
        angle_text(row.step)
    );
    // What is wrong with it stands among the flaws.
    let Ok(image) = GrayImage16::read(&root.join(&row.file)) else {
        return Ok(figure(
            &text,
            "<p class=\"bad\">cannot be read</p>".to_owned(),
        ));
    };
    let roi = rois.get(&LimbId::depth_name(view, row.step));
    let picture = depth_view(&image, roi, scene.joint_pixel(row));
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
