//! Results of `ppa depth coverage` as CSV and text.

use ppa_core::text::{count, number};
use ppa_depth::Viewpoint;
use ppa_generate::{CoverageStudy, RankedPlace};

/// Number of positions printed, in addition to those of the rig.
const SHOWN: usize = 12;

/// Describes the best positions and those of the rig.
pub fn describe(study: &CoverageStudy) -> String {
    let mut lines = vec![
        format!(
            "{:.0} cm² of skin within {} mm of the joint; seen at up to {} degrees of incidence:",
            study.surface_mm2 / 100.0,
            study.radius_mm,
            study.max_angle_deg
        ),
        "rank  place            azimuth  elevation  distance  visible  pixels/cm²  mm/pixel"
            .to_owned(),
    ];
    let shown = |row: &&RankedPlace| row.rank <= SHOWN || row.name.starts_with("rig ");
    for row in study.places.iter().filter(shown) {
        let (v, c) = (&row.viewpoint, &row.coverage);
        let side = c
            .mm_per_pixel
            .map_or("-".to_owned(), |mm| format!("{mm:.2}"));
        lines.push(format!(
            "{:>4}  {:<15} {:>7.0}°  {:>8.0}°  {:>5.0} mm  {:>5.1} %  {:>10.1}  {side:>8}",
            row.rank,
            row.name,
            number(v.azimuth_deg),
            number(v.elevation_deg),
            v.distance_mm,
            100.0 * c.visible_share,
            c.pixels_per_cm2,
        ));
    }
    lines.push(format!(
        "{}; --csv and --json give all",
        count(study.places.len(), "place")
    ));
    lines.join("\n")
}
/// A cell that spreadsheets do not evaluate as a formula.
fn as_text(name: &str) -> String {
    let mark = if ppa_dataset::is_formula(name) {
        "'"
    } else {
        ""
    };
    format!("{mark}{name}")
}

/// All positions as CSV.
pub fn table_csv(rows: &[RankedPlace]) -> anyhow::Result<Vec<u8>> {
    let mut writer = csv::Writer::from_writer(Vec::new());
    writer.write_record([
        "rank",
        "name",
        "azimuth_deg",
        "elevation_deg",
        "distance_mm",
        "x_mm",
        "y_mm",
        "z_mm",
        "visible_mm2",
        "visible_share",
        "pixels",
        "pixels_per_cm2",
        "mm_per_pixel",
    ])?;
    for row in rows {
        let Viewpoint {
            azimuth_deg,
            elevation_deg,
            distance_mm,
        } = row.viewpoint;
        let [x, y, z] = [0, 1, 2].map(|axis| row.room_from_camera[axis][3]);
        let c = &row.coverage;
        // Three decimals are enough for all of them.
        let [
            azimuth,
            elevation,
            distance,
            x,
            y,
            z,
            area,
            share,
            pixels,
            density,
        ] = [
            azimuth_deg,
            elevation_deg,
            distance_mm,
            x,
            y,
            z,
            c.visible_mm2,
            c.visible_share,
            c.pixels,
            c.pixels_per_cm2,
        ]
        .map(|value| (1000.0 * value).round() / 1000.0);
        writer.serialize((
            row.rank,
            &as_text(&row.name),
            (azimuth, elevation, distance),
            (x, y, z),
            (area, share),
            (
                pixels,
                density,
                c.mm_per_pixel.map(|mm| (1000.0 * mm).round() / 1000.0),
            ),
        ))?;
    }
    Ok(writer.into_inner()?)
}
