//! The audit of a scan as one self-contained HTML page: no network, no script, no file names.

use image::GrayImage;
use maud::{DOCTYPE, Markup, PreEscaped, html};
use ppa_core::text::number;
use ppa_ct::audit::Audit;
use ppa_ct::{Info, LpsView, Scan, Values, Volume};
use rayon::prelude::*;

use crate::chart::{Chart, Mark, Series};
use crate::embedded::data_uri;

/// HU shown as black and white in the slices.
const WINDOW_HU: [f32; 2] = [-1000.0, 600.0];
/// Most pixels of the page per mm of the body.
const PIXELS_PER_MM: f64 = 3.0;
/// Total width of the three slices on the page, pixels.
const PAGE_PIXELS: f64 = 900.0;
/// Range of the histogram and width of its bins, HU.
const HISTOGRAM_HU: [i32; 2] = [-1200, 2800];
const BIN_HU: i32 = 10;

/// Writes the page. It contains no names of persons, files or folders, only the contents of [`Info`] and [`Audit`].
pub fn audit_page(scan: &Scan, audit: &Audit) -> String {
    let page = html! {
        (DOCTYPE)
        html lang="en" {
            head {
                meta charset="utf-8";
                title { "CT import audit" }
                style { (PreEscaped(include_str!("audit_page.css"))) }
            }
            body {
                h1 { "CT import audit" }
                (findings(audit))
                (slices(&scan.volume))
                (histogram(scan.volume.values()))
                (facts(&Info::of(scan), scan, audit))
            }
        }
    };
    page.into_string()
}

fn findings(audit: &Audit) -> Markup {
    if audit.findings.is_empty() {
        return html! { p { "Nothing unusual was found." } };
    }
    html! {
        table {
            tr { th {} th { "Found" } th { "For depth images" } th { "For radiographs" } }
            @for finding in &audit.findings {
                tr {
                    td class=(finding.severity) { (finding.severity) }
                    td { (finding.text) }
                    td { (finding.depth_images) }
                    td { (finding.radiographs) }
                }
            }
        }
    }
}

fn facts(info: &Info, scan: &Scan, audit: &Audit) -> Markup {
    let [nx, ny, nz] = info.size;
    let [sx, sy, sz] = info.spacing_mm;
    let measures = &audit.measures;
    let stated = &scan.acquisition;
    let peak = |hu: Option<f64>| hu.map_or("none".to_owned(), |hu| format!("{:.0} HU", number(hu)));
    let mm = |mm: Option<f64>| mm.map_or("not stated".to_owned(), |mm| format!("{mm:.2} mm"));
    let text = |text: &Option<String>| text.clone().unwrap_or_else(|| "not stated".to_owned());
    let identifiers: Vec<_> = stated.identifiers.iter().copied().collect();
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
        ("Modality", text(&info.modality)),
        ("Slice thickness", mm(stated.slice_thickness_mm)),
        ("Table height", mm(stated.table_height_mm)),
        ("Patient position", text(&stated.patient_position)),
        ("Identifying attributes", identifiers.join(", ")),
    ];
    html! {
        h2 { "Facts" }
        table {
            @for (name, value) in rows {
                tr { th { (name) } td { (value) } }
            }
        }
    }
}

/// The slices through the middle in radiological view: from the feet, from the front, from the left.
fn slices(volume: &Volume) -> Markup {
    let view = LpsView::of(volume);
    let (size, spacing) = (view.size(), view.spacing_mm());
    let [x, y, z] = size.map(|n| n / 2);
    let [low, high] = WINDOW_HU;
    // Superior is up.
    let up = |v: usize| size[2] - 1 - v;
    html! {
        h2 { "Slices through the middle" }
        p { (low) " HU is black, " (high) " HU white." }
        (figure("axial", [0, 1], ["R", "L", "A", "P"], size, spacing, |u, v| view.at([u, v, z])))
        (figure("coronal", [0, 2], ["R", "L", "S", "I"], size, spacing, |u, v| view.at([u, y, up(v)])))
        (figure("sagittal", [1, 2], ["A", "P", "S", "I"], size, spacing, |u, v| view.at([x, u, up(v)])))
    }
}

/// A slice with the orientation letters at its left, right, top and bottom.
fn figure(
    name: &str,
    [across, down]: [usize; 2],
    [left, right, top, bottom]: [&str; 4],
    size: [usize; 3],
    spacing_mm: [f64; 3],
    hu: impl Fn(usize, usize) -> f32,
) -> Markup {
    let [low, high] = WINDOW_HU;
    let picture = GrayImage::from_fn(size[across] as u32, size[down] as u32, |u, v| {
        let shown = (hu(u as usize, v as usize) - low) / (high - low) * 255.0;
        image::Luma([shown.round().clamp(0.0, 255.0) as u8])
    });
    let source = data_uri(&picture)
        .expect("a grid has voxels along every axis, and memory takes every byte");
    let mm = [0, 1, 2].map(|axis| size[axis] as f64 * spacing_mm[axis]);
    // Two slices are as wide as the body, one as deep: all three have the same scale.
    let scale = (PAGE_PIXELS / (2.0 * mm[0] + mm[1])).min(PIXELS_PER_MM);
    let [w_mm, h_mm] = [across, down].map(|axis| mm[axis]);
    let [w, h] = [w_mm, h_mm].map(|mm| format!("{:.0}", mm * scale));
    html! {
        figure {
            div class="frame" style={ "width:" (w) "px;height:" (h) "px" } {
                img alt=(name) width=(w) height=(h) src=(source);
                span style="left:4px;top:45%" { (left) }
                span style="right:4px;top:45%" { (right) }
                span style="left:48%;top:2px" { (top) }
                span style="left:48%;bottom:2px" { (bottom) }
            }
            figcaption { (format!("{name}, {w_mm:.0} × {h_mm:.0} mm")) }
        }
    }
}

/// Voxels per bin, by their HU rounded to whole numbers.
fn bins(hu: Values) -> Vec<u64> {
    let [low, high] = HISTOGRAM_HU;
    let count = ((high - low) / BIN_HU) as usize;
    let parts = hu.par_parts(1 << 20).map(|values| {
        let mut bins = vec![0_u64; count];
        for value in values.iter() {
            let bin = (value.round() as i32 - low).div_euclid(BIN_HU);
            if let Some(bin) = usize::try_from(bin).ok().and_then(|bin| bins.get_mut(bin)) {
                *bin += 1;
            }
        }
        bins
    });
    parts.reduce(
        || vec![0; count],
        |mut a, b| {
            a.iter_mut().zip(b).for_each(|(a, b)| *a += b);
            a
        },
    )
}

/// Voxels per HU on a logarithmic scale.
fn histogram(hu: Values) -> Markup {
    let [low, high] = HISTOGRAM_HU;
    let of_bin = |(n, count): (usize, u64)| {
        let middle = f64::from(low) + (n as f64 + 0.5) * f64::from(BIN_HU);
        [middle, (1.0 + count as f64).log10()]
    };
    let points: Vec<[f64; 2]> = bins(hu).into_iter().enumerate().map(of_bin).collect();
    let most = points.iter().map(|point| point[1]).fold(1.0, f64::max);
    let chart = Chart {
        size: [800, 300],
        title: String::new(),
        labels: [
            "HU".to_owned(),
            format!("log10 of voxels per {BIN_HU} HU, plus 1"),
        ],
        ranges: [[f64::from(low), f64::from(high)], [0.0, most]],
        tiles: Vec::new(),
        series: vec![Series::new("", Mark::Area, points)],
    };
    html! {
        h2 { "Hounsfield units" }
        div role="img" { (PreEscaped(chart.to_inline_svg())) }
        p { "Air is at -1000 HU, water at 0 HU." }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_value_of_the_range_falls_into_its_bin() {
        let counts = bins(Values::F32(&[
            -1200.4, -1200.6, -0.4, 9.4, 9.6, 2789.0, 2800.0,
        ]));
        assert_eq!(counts.len(), 400);
        // -1200.6 rounds to -1201, which is below the range, and 9.6 to 10.
        assert_eq!(
            [counts[0], counts[120], counts[121], counts[398]],
            [1, 2, 1, 1]
        );
        assert_eq!(counts.iter().sum::<u64>(), 5);
        assert_eq!(bins(Values::I16(&[-1200, 0, 9, 10])).iter().sum::<u64>(), 4);
    }
}
