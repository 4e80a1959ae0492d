//! Primary image: adaptive ray tracing, with rays stratified over pixel and focal spot by Hammersley's set.
//!
//! Estimator: the mean of exp(−∫µ ds) times energy and response over pixel and spot, docs/physics.md, "Fast engine", primary. Hammersley,
//! Ann. N. Y. Acad. Sci. 86 (1960) 844.

use nalgebra::Point3;
use rayon::prelude::*;

use crate::beam::field::Field;
use crate::beam::spectral_lines::SpectralLines;
use crate::engine::centre_rays;
use crate::engine::exposure::Exposure;
use crate::engine::fast_progress::{Monitor, PRIMARY_DONE};
use crate::engine::paths::Paths;
use crate::engine::primary_rays::{PrimaryRays, Scratch, area_cm2, centre};
use crate::phantom::interpolation::Interpolation;
use crate::transport::tally::Moments;
use crate::transport::tracking::Transport;

/// Largest relative second difference between neighbouring pixels for which the centre of a pixel represents the pixel.
///
/// If the image bends uniformly the correction by it is exact; a [`KINK`] in the centre of a pixel leaves an eighth.
const EVEN: f64 = 4e-3;

/// Share of the second difference that remains in a pixel with a kink in its centre, as with homogeneous voxels.
const KINK: f64 = 0.125;

/// Second difference above which there may be an edge.
const EDGE: f64 = 2e-2;

/// A rectangle is divided as long as opposite quarters differ from its centre by more than this share of the pixel.
const TOLERANCE: f64 = 3e-3;

/// [`EVEN`] and [`TOLERANCE`] are at least these shares of the quantum noise of a pixel; the rms error of the rays is then a few
/// hundredths of the noise.
const EVEN_NOISE: f64 = 0.8;
const TOLERANCE_NOISE: f64 = 0.4;

/// Points per side of the focal spot over which fluence and response of the detector, which vary slowly, are averaged.
const OPEN_POINTS: usize = 2;

/// Extent of the penumbra of an edge, in its standard deviations, and the extent beyond a pixel above which the
/// next pixels are checked for edges, in pixels: an edge nearer than the next centre shows in the pixel's own second difference.
const REACH: f64 = 3.0;
const NEAR: f64 = 0.5;

/// First two moments per history of the primary energy in every pixel.
///
/// One ray through the centre where the image is smooth, up to `samples_per_side`² where it is not and the quantum noise of an exposure
/// of `histories` does not exceed the error. An extended focal spot needs no additional rays: each starts from another point of the spot.
pub(crate) fn primary_moments(
    exposure: &Exposure,
    paths: &Paths,
    lines: SpectralLines,
    samples_per_side: u32,
    histories: f64,
    monitor: &Monitor,
) -> Vec<Moments> {
    let transport = &exposure.transport;
    let rays = PrimaryRays::new(exposure, paths, lines);
    let pixels = transport.projection.detector.pixels();
    let Some(open_beam) = rays.open_beam(&transport.emitter.spot_points(OPEN_POINTS)) else {
        return vec![Moments::default(); pixels]; // the field misses the detector
    };
    let cuts = samples_per_side.ilog2() as usize;
    let strips_mm: Vec<Vec<f64>> = (0..=cuts)
        .map(|cut| transport.emitter.spot().strips_mm(1 << cut))
        .collect();
    let aimed = |lit: Field, scratch: &mut Scratch| {
        rays.aim_from_table(&open_beam, centre(lit), scratch);
        let behind = rays.behind(&Point3::origin(), centre(lit), scratch);
        behind.scaled(transport.emitter.lit_share([0; 2], 1, centre(lit)))
    };
    let columns = transport.projection.detector.columns as usize;
    let rows = transport.projection.detector.rows as usize;
    let phase = monitor.phase(0.0..PRIMARY_DONE, 2 * rows);
    // A row is counted at its first pixel.
    let goes_on = |pixel: usize| {
        if pixel.is_multiple_of(columns) {
            phase.advance();
        }
        !phase.is_cancelled()
    };
    let interpolation = transport.tables.phantom.interpolation();
    let voxels_per_pixel = voxels_per_pixel(transport);
    let finest = finest_detail(interpolation);
    let pixel_cm2 = transport.projection.detector.pixel_cm2();
    let even = |value: Moments, cm2| EVEN.max(EVEN_NOISE * relative_noise(value, cm2, histories));
    let fully_lit = transport.emitter.fully_lit();
    let centres = centre_rays::values(
        [columns, rows],
        finest / voxels_per_pixel,
        |value| {
            let error_share = match interpolation {
                Interpolation::Nearest => centre_rays::KINK_ERROR,
                Interpolation::Trilinear => centre_rays::SMOOTH_ERROR,
            };
            KINK * even(value, pixel_cm2) / error_share
        },
        |pixels, between| {
            rays.per_pixel(pixels.par_iter().copied(), |pixel, scratch| {
                let between = between.filter(|_| lies_within(&fully_lit, rays.pixel(pixel)));
                if let Some(value) = between.and_then(|between| between.at(pixel)) {
                    return value;
                }
                let lit = if goes_on(pixel) {
                    rays.lit(pixel)
                } else {
                    None
                };
                lit.map_or_else(Moments::default, |lit| aimed(lit, scratch))
            })
        },
    );
    let bends: Vec<f32> = (0..centres.len())
        .into_par_iter()
        .map(|pixel| relative_bend(&centres, pixel, columns))
        .collect();
    let shadow = shadow_sigma_pixels(transport, paths.nearest_z_mm());
    let reach = (REACH * shadow - NEAR).ceil().max(0.0) as usize;
    let fine = voxels_per_pixel <= finest;
    // Half the squared standard deviation is to the blur of a uniform bend what 1/24 is to the pixel.
    let left = bend_left(interpolation, voxels_per_pixel);
    let even_share = KINK / (left + 0.5 * shadow * shadow);
    // An edge may cut off a corner that the five rays of an undivided pixel miss, or a part of the spot that the 20 rays of its
    // quarters miss. So pixels at edges are always divided where the noise is below the tolerance.
    let edge_cuts = if transport.emitter.spot().is_point() {
        1
    } else {
        2
    };
    let sure_cuts = voxels_per_pixel.log2().ceil().max(0.0) as usize;
    rays.per_pixel((0..pixels).into_par_iter(), |pixel, scratch| {
        let lit = if goes_on(pixel) {
            rays.lit(pixel)
        } else {
            None
        };
        let Some(lit) = lit else {
            return Moments::default();
        };
        let middle = centres[pixel];
        let worst = largest_about(&bends, pixel, columns, reach);
        let cm2 = area_cm2(lit);
        let noise = TOLERANCE_NOISE * relative_noise(middle, cm2, histories);
        // The penumbra of blades has kinks at both ends, for any voxels.
        let even_share = if lies_within(&fully_lit, rays.pixel(pixel)) {
            even_share
        } else {
            even_share.min(1.0)
        };
        if fine
            && worst <= even(middle, cm2) * even_share
            && lies_within(transport.emitter.field(), rays.pixel(pixel))
            && let Some([x, y]) = bend(&centres, pixel, columns)
        {
            let mean = [middle, x.scaled(1.0 / 24.0), y.scaled(1.0 / 24.0)];
            return mean.into_iter().sum::<Moments>().scaled(cm2);
        }
        rays.aim_from_table(&open_beam, centre(lit), scratch);
        let cut = Cut {
            rays: &rays,
            strips_mm: &strips_mm,
            sure: if worst > EDGE && noise < TOLERANCE {
                sure_cuts.max(edge_cuts)
            } else {
                sure_cuts
            },
            tolerance_kev: TOLERANCE.max(noise) * middle.mean_kev * cm2,
        };
        let whole = Part {
            field: lit,
            cuts: 0,
            strips: [0, 0],
        };
        cut.refined(whole, middle, scratch)
    })
}

/// Share of the second difference that remains after the correction by it.
///
/// Between trilinear voxels there is no kink. Details of their image vary as (π x / voxel)², so the second difference misses
/// (π voxels per pixel)² / 12 of the second derivative, of which a pixel takes 1/24: less than a twentieth of the square.
fn bend_left(interpolation: Interpolation, voxels_per_pixel: f64) -> f64 {
    match interpolation {
        Interpolation::Nearest => KINK,
        Interpolation::Trilinear => KINK.min(voxels_per_pixel * voxels_per_pixel / 20.0),
    }
}

/// Quantum noise on an area of `cm2` after `histories`, relative to the signal there.
fn relative_noise(per_cm2: Moments, cm2: f64, histories: f64) -> f64 {
    (per_cm2.square_kev2 / (cm2 * histories)).sqrt() / per_cm2.mean_kev.max(f64::MIN_POSITIVE)
}

/// Second differences along x and y; `None` at the rim.
fn bend(values: &[Moments], pixel: usize, columns: usize) -> Option<[Moments; 2]> {
    let column = pixel % columns;
    let along = |before: Option<usize>, after: usize| {
        let (a, b) = (values.get(before?)?, values.get(after)?);
        Some([*a, values[pixel].scaled(-2.0), *b].into_iter().sum())
    };
    if column == 0 || column + 1 == columns {
        return None;
    }
    Some([
        along(pixel.checked_sub(1), pixel + 1)?,
        along(pixel.checked_sub(columns), pixel + columns)?,
    ])
}

/// The larger second difference relative to the value; infinite at the rim, where it is unknown.
fn relative_bend(values: &[Moments], pixel: usize, columns: usize) -> f32 {
    let Some(bend) = bend(values, pixel, columns) else {
        return f32::INFINITY;
    };
    let larger = bend.iter().map(|m| m.mean_kev.abs()).fold(0.0, f64::max);
    if larger == 0.0 {
        return 0.0;
    }
    (larger / values[pixel].mean_kev) as f32
}

/// The largest value of the pixels up to `reach` away; infinite if the detector ends before that.
fn largest_about(values: &[f32], pixel: usize, columns: usize, reach: usize) -> f64 {
    let (column, row) = (pixel % columns, pixel / columns);
    let rows = values.len() / columns;
    let inside = |at: usize, count: usize| at >= reach && at + reach < count;
    if !inside(column, columns) || !inside(row, rows) {
        return f64::INFINITY;
    }
    let lines = row - reach..=row + reach;
    let largest = lines.flat_map(|row| &values[row * columns + column - reach..][..2 * reach + 1]);
    largest.copied().fold(0.0_f32, f32::max).into()
}

/// Whether a field contains all of a pixel and of its neighbours.
fn lies_within(field: &Field, pixel: Field) -> bool {
    (0..2).all(|axis| {
        let side = pixel.size_mm()[axis];
        pixel.low_mm[axis] - side >= field.low_mm[axis]
            && pixel.high_mm[axis] + side <= field.high_mm[axis]
    })
}

/// Ratio of pixel side to smallest voxel side up to which neighbouring centres miss nothing.
fn finest_detail(interpolation: Interpolation) -> f64 {
    match interpolation {
        Interpolation::Nearest => 0.5,
        Interpolation::Trilinear => 1.0,
    }
}

/// Ratio of pixel side to smallest voxel side.
fn voxels_per_pixel(transport: &Transport) -> f64 {
    let spacing_mm = transport.tables.phantom.grid().spacing_mm().min();
    transport.projection.detector.pixel_mm / spacing_mm
}

/// Standard deviation of the penumbra of objects at z = `nearest_mm` from the focal spot, in pixels.
fn shadow_sigma_pixels(transport: &Transport, nearest_mm: f64) -> f64 {
    let projection = transport.projection;
    let magnification = projection.source_detector_mm / nearest_mm.max(1.0);
    let sigma_mm = transport.emitter.spot().sigma_mm();
    sigma_mm * (magnification - 1.0).max(0.0) / projection.detector.pixel_mm
}

/// Rules for dividing a pixel.
struct Cut<'a> {
    rays: &'a PrimaryRays<'a>,
    /// Strips of the focal spot, twice as many for every further division.
    strips_mm: &'a [Vec<f64>],
    /// Divisions that are always made: a square wider than a voxel may hide one.
    sure: usize,
    tolerance_kev: f64,
}

/// A part of a pixel, and the strips of the focal spot, or of its part that lights the point, from which the ray to its centre starts.
#[derive(Clone, Copy)]
struct Part {
    field: Field,
    cuts: usize,
    strips: [usize; 2],
}

impl Part {
    /// The quarter on the upper or the lower side in x and in y.
    ///
    /// Each of the 4ⁿ quarters of quarters is seen from another of 4ⁿ points of the spot, and the four of a rectangle from one in each
    /// quarter of the spot: the spot's quarters are the pixel's in reverse order, as in the set of Hammersley, Ann. N. Y. Acad.
    /// Sci. 86 (1960) 844. They are rotated by a right angle, so that a step on the spot does not cancel the step in the pixel.
    fn quarter(&self, [upper_x, upper_y]: [bool; 2]) -> Self {
        let middle = centre(self.field);
        let mut field = self.field;
        for (axis, upper) in [upper_x, upper_y].into_iter().enumerate() {
            if upper {
                field.low_mm[axis] = middle[axis];
            } else {
                field.high_mm[axis] = middle[axis];
            }
        }
        let [x, y] = self.strips;
        let higher = |bit: bool| usize::from(bit) << self.cuts;
        Self {
            field,
            cuts: self.cuts + 1,
            strips: [x + higher(!upper_y), y + higher(upper_x)],
        }
    }
}

impl Cut<'_> {
    /// Energy in a part whose ray reads `middle`. It is divided into four until both pairs of opposite quarters agree with it: this is so
    /// on a plane, while at an edge or a kink at least one pair differs.
    fn refined(&self, part: Part, middle: Moments, scratch: &mut Scratch) -> Moments {
        let cm2 = area_cm2(part.field);
        if part.cuts + 1 == self.strips_mm.len() {
            return middle.scaled(cm2);
        }
        let quarters = [[false; 2], [true, false], [false, true], [true; 2]];
        let parts = quarters.map(|quarter| part.quarter(quarter));
        let middles = parts.map(|part| self.ray(&part, scratch));
        let differs = |a: usize, b: usize| {
            let pair = 0.5 * (middles[a].mean_kev + middles[b].mean_kev);
            (pair - middle.mean_kev).abs() * cm2 > self.tolerance_kev
        };
        if part.cuts >= self.sure && !differs(0, 3) && !differs(1, 2) {
            return middles.into_iter().sum::<Moments>().scaled(0.25 * cm2);
        }
        let parts = parts.into_iter().zip(middles);
        parts
            .map(|(part, middle)| self.refined(part, middle, scratch))
            .sum()
    }

    fn ray(&self, part: &Part, scratch: &mut Scratch) -> Moments {
        let strips_mm = &self.strips_mm[part.cuts];
        let emitter = &self.rays.transport.emitter;
        let at = centre(part.field);
        let lit_part = emitter.lit_part(at);
        let lit: f64 = lit_part.iter().map(|[first, last]| last - first).product();
        if lit == 0.0 {
            return Moments::default();
        }
        // In a penumbra the strips divide the part of the spot that lights the point; with dark strips the division would end too early.
        let spot = emitter.spot();
        let offsets_mm =
            [0, 1].map(|axis| spot.strip_of_part_mm(lit_part[axis], part.strips[axis], strips_mm));
        let spot = emitter.spot_at(offsets_mm);
        self.rays.behind(&spot, at, scratch).scaled(lit)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::beam::detector::Detector;
    use crate::beam::projection::Projection;
    use crate::engine::small_limb;
    use crate::engine::spectral_quadrature::PRIMARY_ENERGIES;
    use crate::engine::spectral_quadrature::compressed;
    use crate::matter::compton::ComptonModel;

    /// An exposure with noise takes fewer rays than the expected image, with pixels of two voxels and of a fifth; the images differ by
    /// less than a tenth of the noise.
    #[test]
    fn errors_of_fewer_rays_are_below_a_tenth_of_the_noise() {
        let (homogeneous, spectrum, projection) = small_limb::exposure();
        let trilinear = homogeneous
            .clone()
            .with_interpolation(Interpolation::Trilinear);
        let fine = Projection {
            detector: Detector::centred(240, 240, 0.5),
            ..projection.clone()
        };
        for (phantom, projection) in [(homogeneous, projection), (trilinear, fine)] {
            let model = ComptonModel::default();
            let exposure = Exposure::new(&phantom, &spectrum, &projection, model).unwrap();
            let paths = Paths::new(&exposure.transport);
            let image = |histories: f64| {
                let lines = compressed(&exposure, PRIMARY_ENERGIES);
                primary_moments(&exposure, &paths, lines, 8, histories, &Monitor::silent())
            };
            let expected = image(f64::INFINITY);
            let histories = 1e7;
            let found = image(histories);
            let errors = found
                .iter()
                .zip(&expected)
                .filter(|(_, all)| all.mean_kev > 0.0);
            let squares: Vec<f64> = errors
                .map(|(few, all)| {
                    let noise = all.standard_error_kev(histories);
                    ((few.mean_kev - all.mean_kev) / noise).powi(2)
                })
                .collect();
            let rms = (squares.iter().sum::<f64>() / squares.len() as f64).sqrt();
            println!("{rms:.4} of the noise in {} pixels", squares.len());
            assert!(rms > 0.0 && rms < 0.1, "{rms}");
        }
    }
}
