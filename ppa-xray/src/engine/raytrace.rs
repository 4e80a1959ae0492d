//! The primary image without randomness: line integrals through the voxels, averaged over each pixel.
//!
//! docs/physics.md, "Fast engine", primary.

use nalgebra::{Point2, Point3};
use rayon::prelude::*;

use crate::beam::field::Field;
use crate::beam::projection::Projection;
use crate::beam::spectrum::Spectrum;
use crate::engine::exposure::Exposure;
use crate::engine::paths::Paths;
use crate::engine::primary_rays::{PrimaryRays, Scratch, area_cm2};
use crate::matter::compton::ComptonModel;
use crate::phantom::voxels::VoxelPhantom;
use crate::transport::tally::{Moments, mix};
use crate::transport::tracking::TransportError;

/// Points per side of a focal spot.
const SPOT_POINTS: usize = 8;

/// Energy of unscattered photons per pixel, row-major, eV/cm² per history.
///
/// Each pixel is the mean over `samples_per_side`² evenly spaced rays, from each of 64 points unless the focal spot is a point.
/// Rays through pixel centres alone are wrong by up to 13 % at sharp edges. All energies of the spectrum are included. Between
/// the centres of voxels the density is interpolated as in the transport.
///
/// # Errors
/// The same as [`crate::analog`]; also if `samples_per_side` is not 1 to 64.
pub fn primary(
    phantom: &VoxelPhantom,
    spectrum: &Spectrum,
    projection: &Projection,
    samples_per_side: u32,
) -> Result<Vec<f64>, TransportError> {
    check_samples(samples_per_side)?;
    let exposure = Exposure::new(phantom, spectrum, projection, ComptonModel::default())?;
    let mut moments = of_spot(&exposure, samples_per_side);
    if let Some((extrafocal, share)) = exposure.of_extrafocal() {
        mix(&mut moments, &of_spot(&extrafocal, samples_per_side), share);
    }
    let marker = projection.marker.iter();
    for (pixel, share) in marker.flat_map(|marker| marker.covered(&projection.detector)) {
        moments[pixel] = moments[pixel].scaled(1.0 - share);
    }
    let ev_cm2 = 1e3 / projection.detector.pixel_cm2();
    Ok(moments.iter().map(|m| m.mean_kev * ev_cm2).collect())
}

/// First two moments per history of the primary energy in every pixel, for the focal spot of the exposure's emitter.
fn of_spot(exposure: &Exposure, samples_per_side: u32) -> Vec<Moments> {
    let transport = &exposure.transport;
    let paths = Paths::new(transport);
    let rays = PrimaryRays::new(exposure, &paths, transport.emitter.lines());
    let spots = transport.emitter.spot_points(SPOT_POINTS);
    let pixels = 0..transport.projection.detector.pixels();
    rays.per_pixel(pixels.into_par_iter(), |pixel, scratch| {
        rays.lit(pixel).map_or_else(Moments::default, |lit| {
            sampled(&rays, &spots, lit, samples_per_side, scratch)
        })
    })
}

pub(crate) fn check_samples(samples_per_side: u32) -> Result<(), TransportError> {
    if (1..=64).contains(&samples_per_side) {
        return Ok(());
    }
    Err(TransportError::Setting {
        what: "the number of rays per pixel side",
        found: f64::from(samples_per_side),
        expected: "1 to 64",
    })
}

/// Samples a rectangle at the midpoints of `samples_per_side`² parts.
fn sampled(
    rays: &PrimaryRays,
    spots: &[Point3<f64>],
    lit: Field,
    samples_per_side: u32,
    scratch: &mut Scratch,
) -> Moments {
    let size = lit.size_mm();
    let along = |i: u32| (f64::from(i) + 0.5) / f64::from(samples_per_side);
    let samples = samples_per_side * samples_per_side;
    let emitter = &rays.transport.emitter;
    let per_side = spots.len().isqrt();
    let mut sum = Moments::default();
    for sample in 0..samples {
        let at = [sample % samples_per_side, sample / samples_per_side];
        let at = [0, 1].map(|axis| lit.low_mm[axis] + along(at[axis]) * size[axis]);
        let at = Point2::from(at);
        for (index, spot) in spots.iter().enumerate() {
            let strips = [index % per_side, index / per_side];
            let lit = emitter.lit_share(strips, per_side, at);
            rays.aim(std::slice::from_ref(spot), at, scratch);
            let behind = rays.behind(spot, at, scratch).scaled(lit);
            sum = [sum, behind].into_iter().sum();
        }
    }
    sum.scaled(area_cm2(lit) / f64::from(samples) / spots.len() as f64)
}
