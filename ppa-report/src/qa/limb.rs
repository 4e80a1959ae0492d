//! Section of one limb.

use std::path::Path;

use image::RgbImage;
use maud::{Markup, html};
use ppa_dataset::BodyShape;
use ppa_dataset::layout::{LimbId, View, angle_text};
use ppa_dataset::manifest::{FileKind, FileRow, Manifest, RoiFile};
use ppa_dataset::published::{GrayImage16, Published};

use super::curves::{heights_and_tilts, histograms, labels};
use super::cuts::cut_shares;
use super::depth_view::{depth_view, strip};
use super::error::QaError;
use super::figure::{embedded, figure};
use super::scale::colour_scale;
use super::scene::Scene;
use crate::contact_sheet::{Tiles, evenly_chosen, tiles};

/// Number of poses shown per limb.
const COLUMNS: usize = 7;

/// The section of one limb, and the number of its outliers.
pub(super) struct LimbPart {
    pub html: Markup,
    pub outliers: usize,
    /// Whether it has no depth images.
    pub is_empty: bool,
}

pub(super) fn limb_part(
    root: &Path,
    manifest: &Manifest,
    dataset: &Published,
    scene: &Scene,
    limb: LimbId,
) -> Result<LimbPart, QaError> {
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
    let title = html! { h2 { "Patient " (limb.patient) ", " (limb.side) } };
    if shapes.is_empty() {
        return Ok(LimbPart {
            html: html! { (title) p class="bad" { "No depth images." } },
            outliers: 0,
            is_empty: true,
        });
    }
    let tiles = tiles(root, limb, COLUMNS)?;
    let scale = colour_scale(tiles.range_mm);
    let depths = histograms(root, &rois, |view| depth(shapes[0], view));
    let sweeps: Vec<_> = shapes
        .iter()
        .map(|&shape| (shape, depth(shape, View::Left)))
        .collect();
    let sweeps = heights_and_tilts(scene, &sweeps);
    let mut whole_views = Vec::new();
    for view in View::ALL {
        let of_view = depth(shapes[0], view);
        let steps: Vec<_> = of_view.iter().map(|row| row.step).collect();
        let chosen = if steps.is_empty() {
            Vec::new()
        } else {
            evenly_chosen(&steps, 3)
        };
        for row in of_view.into_iter().filter(|row| chosen.contains(&row.step)) {
            whole_views.push(whole_view(root, row, &rois, scene, tiles.range_mm)?);
        }
    }
    let html = html! {
        (title)
        h3 { "Poses" }
        (sheet(root, &tiles)?)
        (figure("Depth in the images above.", scale.clone()))
        div class="charts" {
            (figure("Label of each pose; the band is its spread.", labels(dataset, limb)))
            (figure("Depths in the regions of interest, share of the valid pixels per 10 mm.", depths))
            @if let Some((chart, largest)) = cut_shares(&rows) {
                (figure(
                    &format!("Share of the regions of interest that shows a face where the field of view of the CT cut the limb, at most {largest:.1} %."),
                    chart,
                ))
            }
            (sweeps.charts)
        }
        (sweeps.html)
        h3 { "Regions of interest and the joint in whole images" }
        div class="views" { @for view in whole_views { (view) } }
        (figure("Depth in the images above; nearer and farther depths have the colours at the ends of the scale.", scale))
    };
    Ok(LimbPart {
        html,
        outliers: sweeps.outliers,
        is_empty: false,
    })
}

/// Rows of small pictures with their names, a column per pose.
fn sheet(root: &Path, tiles: &Tiles) -> Result<Markup, QaError> {
    let picture = |name: &str, pictures: &[RgbImage]| {
        embedded(&strip(pictures), &format!("{name} by rotation"), root)
    };
    Ok(html! {
        table class="sheet" {
            tr {
                th { "medial rotation" }
                @for &step in &tiles.steps { th { (angle_text(step)) "°" } }
            }
            @for (name, pictures) in &tiles.rows {
                tr { th { (name) } td colspan=(tiles.steps.len()) { (picture(name, pictures)?) } }
            }
        }
    })
}

fn whole_view(
    root: &Path,
    row: &FileRow,
    rois: &RoiFile,
    scene: &Scene,
    range_mm: [f64; 2],
) -> Result<Markup, QaError> {
    let camera = row.camera.map_or("", View::name).replace('_', " ");
    let text = format!("{camera}, {}°", angle_text(row.step));
    // An unreadable image is listed as a flaw.
    let Ok(image) = GrayImage16::read(&root.join(&row.file)) else {
        return Ok(figure(&text, html! { p class="bad" { "cannot be read" } }));
    };
    let name = row.camera.map(|view| LimbId::depth_name(view, row.step));
    let roi = name.and_then(|name| rois.get(&name));
    let picture = depth_view(&image, range_mm, roi, scene.joint_pixel(row));
    Ok(figure(&text, embedded(&picture, &text, root)?))
}
