//! Light that reaches a pixel via another surface.

use nalgebra::{Complex, Point3, Vector3};
use rayon::prelude::*;

use crate::image::DepthImage;
use crate::render::surface::{Surface, signal};
use crate::sensor::modulation::phase_per_mm;
use crate::sensor::spec::Multipath;

/// Pixels along each side of a tile; tiles send and receive as one.
const TILE: usize = 16;

/// The middle of a tile's surface.
struct Patch {
    point: Point3<f64>,
    normal: Vector3<f64>,
    range_mm: f64,
    cos_incidence: f64,
    area_mm2: f64,
}

/// Phasors of the light that reaches each pixel after one bounce, relative to the signal's unit and to the pixel's own phase.
///
/// Diffuse surfaces of one albedo ρ, lamp and lens at one place. A patch q of area A_q that receives S_q sends to p, before its
/// cosine law at p, ρ S_q cos θ_q cos θ_p A_q / (π d²), over a way that is longer than the direct one by (r_q + d − r_p) / 2
/// in range. Patches are the surfaces of tiles of 16 x 16 pixels; occlusion between them is ignored, and surfaces that the camera
/// does not see send nothing.
pub(crate) fn one_bounce(
    surface: &Surface,
    image: &DepthImage,
    multipath: Multipath,
) -> Vec<Complex<f64>> {
    let width = image.width as usize;
    let (columns, rows) = (width.div_ceil(TILE), (image.height as usize).div_ceil(TILE));
    let patches: Vec<Patch> = (0..columns * rows)
        .into_par_iter()
        .filter_map(|tile| patch(surface, image, tile % columns * TILE, tile / columns * TILE))
        .collect();
    let phase = phase_per_mm(multipath.modulation_mhz);
    let received = |pixel: usize| {
        let (Some(point), Some(normal)) = (surface.point(pixel), surface.normal(pixel)) else {
            return Complex::new(0.0, 0.0);
        };
        let range_mm = point.coords.norm();
        let mut sum = Complex::new(0.0, 0.0);
        for patch in &patches {
            let way = patch.point - point;
            let squared = way.norm_squared();
            let (to_patch, to_pixel) = (normal.dot(&way), -patch.normal.dot(&way));
            // Closer than its own size, a patch cannot be treated as a point.
            if to_patch <= 0.0 || to_pixel <= 0.0 || squared < patch.area_mm2 {
                continue;
            }
            let form =
                to_patch * to_pixel * patch.area_mm2 / (std::f64::consts::PI * squared * squared);
            // Received light leaves towards the camera as direct light does, so both compare as what reaches p.
            let sent = multipath.albedo * signal(patch.cos_incidence, patch.range_mm) * form;
            let longer_mm = 0.5 * (patch.range_mm + squared.sqrt() - range_mm);
            sum += Complex::from_polar(sent, phase * longer_mm);
        }
        sum
    };
    let mut light = vec![Complex::new(0.0, 0.0); image.z_mm.len()];
    light
        .par_chunks_mut(width)
        .enumerate()
        .for_each(|(row, light)| {
            for (column, light) in light.iter_mut().enumerate() {
                *light = received(row * width + column);
            }
        });
    light
}

fn patch(surface: &Surface, image: &DepthImage, column: usize, row: usize) -> Option<Patch> {
    let (width, height) = (image.width as usize, image.height as usize);
    let (columns, rows) = (
        column..width.min(column + TILE),
        row..height.min(row + TILE),
    );
    let pixels = || {
        let columns = columns.clone();
        rows.clone()
            .flat_map(move |row| columns.clone().map(move |column| row * width + column))
    };
    // The surface of the pixel nearest to the middle that sees one.
    let middle = (row + TILE / 2).min(height - 1) * width + (column + TILE / 2).min(width - 1);
    let away = |pixel: &usize| {
        let (du, dv) = (
            (pixel % width).abs_diff(middle % width),
            (pixel / width).abs_diff(middle / width),
        );
        (du * du + dv * dv, *pixel)
    };
    let at = pixels()
        .filter(|&pixel| surface.normal(pixel).is_some())
        .min_by_key(away)?;
    let (point, normal) = (surface.point(at)?, surface.normal(at)?);
    let range_mm = point.coords.norm();
    let cos_incidence = -normal.dot(&point.coords) / range_mm;
    // Each pixel sees the area r² dΩ / cos θ.
    let area_mm2 = pixels()
        .filter_map(|pixel| surface.pixel_area_mm2(pixel))
        .sum();
    Some(Patch {
        point,
        normal,
        range_mm,
        cos_incidence,
        area_mm2,
    })
}
