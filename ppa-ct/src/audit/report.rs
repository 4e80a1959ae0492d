//! An audit as one self-contained HTML page: no network, no script, no file names.

use std::fmt::Write;

use base64::Engine;
use base64::engine::general_purpose::STANDARD;

use ppa_core::text::number;

use super::histogram::Histogram;
use super::{Audit, Severity};
use crate::info::Info;
use crate::lps_view::LpsView;
use crate::scan::Scan;
use crate::volume::Volume;

/// HU shown black and white in the slices.
const WINDOW_HU: [f32; 2] = [-1000.0, 600.0];
/// Most pixels of the page per mm of the body.
const PIXELS_PER_MM: f64 = 3.0;
/// Width of the page that the three slices share, pixels.
const PAGE_PIXELS: f64 = 900.0;

/// The page. It names no person, file or folder, only what [`Info`] and [`Audit`] hold.
pub fn html(scan: &Scan, audit: &Audit) -> String {
    let mut page = HEAD.to_owned();
    page += "<h1>CT import audit</h1>\n";
    page += &findings(audit);
    page += &slices(&scan.volume);
    page += &histogram(&scan.volume);
    page += &facts(&Info::of(scan), scan, audit);
    page += "</body></html>\n";
    page
}

const HEAD: &str = r#"<!DOCTYPE html>
<html lang="en"><head><meta charset="utf-8"><title>CT import audit</title><style>
body { font: 15px/1.45 system-ui, sans-serif; max-width: 60rem; margin: 2rem auto; padding: 0 1rem; color: #222; }
h1 { font-size: 1.5rem; } h2 { font-size: 1.1rem; margin-top: 2rem; }
table { border-collapse: collapse; width: 100%; } td, th { text-align: left; vertical-align: top; padding: .35rem .7rem .35rem 0; border-bottom: 1px solid #ddd; }
.severe { color: #b00020; font-weight: 600; } .caution { color: #9a5b00; font-weight: 600; } .note { color: #556; }
figure { display: inline-block; margin: 0 1rem 1rem 0; vertical-align: top; } figcaption { font-size: .85rem; color: #556; }
.frame { position: relative; background: #000; } .frame img { display: block; }
.frame span { position: absolute; color: #ffd75e; font-size: 13px; text-shadow: 0 0 3px #000; }
</style></head><body>
"#;

fn escaped(text: &str) -> String {
    let text = text.replace('&', "&amp;").replace('<', "&lt;");
    text.replace('>', "&gt;").replace('"', "&quot;")
}

fn findings(audit: &Audit) -> String {
    if audit.findings.is_empty() {
        return "<p>Nothing odd was found.</p>\n".to_owned();
    }
    let mut table = "<table><tr><th></th><th>Found</th><th>For depth images</th>\
                     <th>For radiographs</th></tr>\n"
        .to_owned();
    for finding in &audit.findings {
        let severity = match finding.severity {
            Severity::Note => "note",
            Severity::Caution => "caution",
            Severity::Severe => "severe",
        };
        let cells = [&*finding.text, finding.depth_images, finding.radiographs].map(escaped);
        let _ = writeln!(
            table,
            "<tr><td class=\"{severity}\">{severity}</td><td>{}</td></tr>",
            cells.join("</td><td>")
        );
    }
    table + "</table>\n"
}

fn facts(info: &Info, scan: &Scan, audit: &Audit) -> String {
    let [nx, ny, nz] = info.size;
    let [sx, sy, sz] = info.spacing_mm;
    let measures = &audit.measures;
    let stated = &scan.acquisition;
    let peak = |hu: Option<f64>| hu.map_or("none".to_owned(), |hu| format!("{:.0} HU", number(hu)));
    let mm = |mm: Option<f64>| mm.map_or("not stated".to_owned(), |mm| format!("{mm:.2} mm"));
    let rows = [
        ("Voxels", format!("{nx} × {ny} × {nz}")),
        ("Spacing", format!("{sx:.4} × {sy:.4} × {sz:.4} mm")),
        ("Axes run to", measures.axes.clone()),
        ("Tilt", format!("{:.2}°", number(measures.tilt_deg))),
        ("Values", format!("{} to {} HU", info.hu_min, info.hu_max)),
        ("Air", peak(measures.air_peak_hu)),
        ("Soft tissue", peak(measures.tissue_peak_hu)),
        ("Above 300 HU", format!("{:.1} cm³", measures.bone_cm3)),
        ("Above 2500 HU", format!("{:.2} cm³", measures.metal_cm3)),
        (
            "Modality",
            info.modality
                .clone()
                .unwrap_or_else(|| "not stated".to_owned()),
        ),
        ("Slice thickness", mm(stated.slice_thickness_mm)),
        ("Table height", mm(stated.table_height_mm)),
        (
            "Patient position",
            stated
                .patient_position
                .clone()
                .unwrap_or_else(|| "not stated".to_owned()),
        ),
        (
            "Identifying attributes",
            stated
                .identifiers
                .iter()
                .copied()
                .collect::<Vec<_>>()
                .join(", "),
        ),
    ];
    let rows =
        rows.map(|(name, value)| format!("<tr><th>{name}</th><td>{}</td></tr>\n", escaped(&value)));
    format!("<h2>Facts</h2>\n<table>{}</table>\n", rows.concat())
}

/// The slices through the middle, seen as radiologists do: from the feet, from the front, from the left.
fn slices(volume: &Volume) -> String {
    let view = LpsView::of(volume);
    let (size, spacing) = (view.size(), view.spacing_mm());
    let [x, y, z] = size.map(|n| n / 2);
    let mut html = format!(
        "<h2>Slices through the middle</h2>\n<p>{} HU is black, {} HU white.</p>\n",
        WINDOW_HU[0], WINDOW_HU[1]
    );
    // Across, down, letters at left, right, top and bottom; superior is up.
    let axial = |u: usize, v: usize| view.at([u, v, z]);
    let coronal = |u: usize, v: usize| view.at([u, y, size[2] - 1 - v]);
    let sagittal = |u: usize, v: usize| view.at([x, u, size[2] - 1 - v]);
    html += &figure("axial", [0, 1], ["R", "L", "A", "P"], size, spacing, axial);
    html += &figure(
        "coronal",
        [0, 2],
        ["R", "L", "S", "I"],
        size,
        spacing,
        coronal,
    );
    html += &figure(
        "sagittal",
        [1, 2],
        ["A", "P", "S", "I"],
        size,
        spacing,
        sagittal,
    );
    html
}

fn figure(
    name: &str,
    [across, down]: [usize; 2],
    [left, right, top, bottom]: [&str; 4],
    size: [usize; 3],
    spacing_mm: [f64; 3],
    hu: impl Fn(usize, usize) -> f32,
) -> String {
    let [low, high] = WINDOW_HU;
    let (width, height) = (size[across], size[down]);
    let grey = (0..width * height).map(|n| {
        let shown = (hu(n % width, n / width) - low) / (high - low) * 255.0;
        shown.round().clamp(0.0, 255.0) as u8
    });
    let picture = STANDARD.encode(png(width, height, &grey.collect::<Vec<_>>()));
    let mm = [0, 1, 2].map(|axis| size[axis] as f64 * spacing_mm[axis]);
    // Two slices are as wide as the body, one as deep: all three at one scale.
    let scale = (PAGE_PIXELS / (2.0 * mm[0] + mm[1])).min(PIXELS_PER_MM);
    let [w_mm, h_mm] = [across, down].map(|axis| mm[axis]);
    let (w, h) = (w_mm * scale, h_mm * scale);
    format!(
        "<figure><div class=\"frame\" style=\"width:{w:.0}px;height:{h:.0}px\">\
         <img alt=\"{name}\" width=\"{w:.0}\" height=\"{h:.0}\" src=\"data:image/png;base64,{picture}\">\
         <span style=\"left:4px;top:45%\">{left}</span><span style=\"right:4px;top:45%\">{right}</span>\
         <span style=\"left:48%;top:2px\">{top}</span><span style=\"left:48%;bottom:2px\">{bottom}</span>\
         </div><figcaption>{name}, {w_mm:.0} × {h_mm:.0} mm</figcaption></figure>\n"
    )
}

/// A grey PNG of 8 bits without any text in it.
fn png(width: usize, height: usize, grey: &[u8]) -> Vec<u8> {
    let mut file = Vec::new();
    let mut encoder = png::Encoder::new(&mut file, width as u32, height as u32);
    encoder.set_color(png::ColorType::Grayscale);
    encoder.set_depth(png::BitDepth::Eight);
    let mut writer = encoder.write_header().expect("a Vec takes every byte");
    writer.write_image_data(grey).expect("one byte per pixel");
    writer.finish().expect("a Vec takes every byte");
    file
}

/// Voxels per HU on a logarithmic scale.
fn histogram(volume: &Volume) -> String {
    const RANGE: [i32; 2] = [-1200, 2800];
    const BINS: usize = 400;
    const SIZE: [f64; 2] = [800.0, 220.0];
    let counts = Histogram::of(volume.values()).coarse(RANGE[0], RANGE[1], BINS);
    let most = counts.iter().copied().max().unwrap_or(0).max(1) as f64;
    let height = |count: u64| SIZE[1] * (1.0 + count as f64).ln() / (1.0 + most).ln();
    let step = SIZE[0] / BINS as f64;
    let mut path = format!("M0 {}", SIZE[1]);
    for (n, &count) in counts.iter().enumerate() {
        let y = SIZE[1] - height(count);
        let _ = write!(path, "V{y:.1}H{:.1}", (n + 1) as f64 * step);
    }
    let _ = write!(path, "V{}Z", SIZE[1]);
    let x = |hu: i32| f64::from(hu - RANGE[0]) / f64::from(RANGE[1] - RANGE[0]) * SIZE[0];
    let marks = [
        (-1000, "air"),
        (0, "water"),
        (1000, "1000 HU"),
        (2000, "2000 HU"),
    ];
    let marks = marks.map(|(hu, name)| {
        format!(
            "<path d=\"M{0:.1} 0V{1}\" stroke=\"#c33\" stroke-dasharray=\"3 3\"/>\
             <text x=\"{0:.1}\" y=\"{2}\" font-size=\"13\" text-anchor=\"middle\">{name}</text>",
            x(hu),
            SIZE[1],
            SIZE[1] + 16.0
        )
    });
    format!(
        "<h2>Hounsfield units</h2>\n<svg viewBox=\"0 0 {} {}\" width=\"100%\" role=\"img\">\
         <path d=\"{path}\" fill=\"#446\"/>{}</svg>\n<p>Voxels per {} HU, logarithmic.</p>\n",
        SIZE[0],
        SIZE[1] + 22.0,
        marks.concat(),
        (RANGE[1] - RANGE[0]) as usize / BINS
    )
}
