//! Section of one limb.

use std::path::Path;

use ppa_dataset::BodyShape;
use ppa_dataset::layout::{LimbId, View, angle_text};
use ppa_dataset::manifest::{FileKind, FileRow, Manifest, RoiFile};
use ppa_dataset::published::{GrayImage16, Published};

use super::curves::{Sweeps, heights_and_tilts, histograms, labels};
use super::cuts::cut_shares;
use super::page::{QaError, figure, side};
use super::scale::colour_scale;
use super::scene::Scene;
use super::views::{depth_view, embedded, strip};
use crate::contact_sheet::{Tiles, evenly_chosen, tiles};

/// Poses that are shown of a limb.
const COLUMNS: usize = 7;

/// The part of the page on one limb, and how many of its poses stand out.
pub(super) struct LimbPart {
    pub html: String,
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
    let mut section = format!("<h2>Patient {}, {}</h2>", limb.patient, side(limb));
    if shapes.is_empty() {
        return Ok(LimbPart {
            html: section + "<p class=\"bad\">No depth images.</p>",
            outliers: 0,
            is_empty: true,
        });
    }
    section += "<h3>Poses</h3>";
    let tiles = tiles(root, limb, COLUMNS)?;
    let scale = colour_scale(tiles.range_mm);
    section += &sheet(root, &tiles)?;
    section += &figure("Depth in the images above.", scale.clone());
    section += "<div class=\"charts\">";
    section += &figure(
        "Label of each pose; the band is its spread.",
        labels(dataset, limb),
    );
    section += &figure(
        "Depths in the regions of interest, share of the valid pixels per 10 mm.",
        histograms(root, &rois, |view| depth(shapes[0], view)),
    );
    if let Some((svg, largest)) = cut_shares(&rows) {
        let caption = format!(
            "Share of the regions of interest that shows a face where the field of view of the CT cut the limb, at most {largest:.1} %."
        );
        section += &figure(&caption, svg);
    }
    let sweeps: Vec<_> = shapes
        .iter()
        .map(|&shape| (shape, depth(shape, View::Left)))
        .collect();
    let Sweeps {
        charts,
        html,
        outliers,
    } = heights_and_tilts(scene, &sweeps);
    section += &charts;
    section += "</div>";
    section += &html;
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
            section += &whole_view(root, row, &rois, scene, tiles.range_mm)?;
        }
    }
    section += "</div>";
    section += &figure(
        "Depth in the images above; what is nearer or farther has the colour of the end.",
        scale,
    );
    Ok(LimbPart {
        html: section,
        outliers,
        is_empty: false,
    })
}

/// Rows of small pictures with their names, a column per pose.
fn sheet(root: &Path, tiles: &Tiles) -> Result<String, QaError> {
    let angles = tiles.steps.iter();
    let angles: String = angles
        .map(|&step| format!("<th>{}°</th>", angle_text(step)))
        .collect();
    let columns = tiles.steps.len();
    let mut html = format!("<table class=\"sheet\"><tr><th>medial rotation</th>{angles}</tr>");
    for (name, pictures) in &tiles.rows {
        let picture = embedded(&strip(pictures), &format!("{name} by rotation"), root)?;
        html += &format!("<tr><th>{name}</th><td colspan=\"{columns}\">{picture}</td></tr>");
    }
    Ok(html + "</table>")
}

fn whole_view(
    root: &Path,
    row: &FileRow,
    rois: &RoiFile,
    scene: &Scene,
    range_mm: [f64; 2],
) -> Result<String, QaError> {
    let camera = row.camera.map_or("", View::name).replace('_', " ");
    let text = format!("{camera}, {}°", angle_text(row.step));
    // What is wrong with it stands among the flaws.
    let Ok(image) = GrayImage16::read(&root.join(&row.file)) else {
        return Ok(figure(
            &text,
            "<p class=\"bad\">cannot be read</p>".to_owned(),
        ));
    };
    let name = row.camera.map(|view| LimbId::depth_name(view, row.step));
    let roi = name.and_then(|name| rois.get(&name));
    let picture = depth_view(&image, range_mm, roi, scene.joint_pixel(row));
    Ok(figure(&text, embedded(&picture, &text, root)?))
}
