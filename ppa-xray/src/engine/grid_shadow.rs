//! Lines of a stationary grid in the expected primary.
//!
//! The primary of a pixel, a mean over the phase of the strips, is multiplied by the transmission of the strips over its aperture relative
//! to that mean, weighted with the spectrum behind the phantom at its centre. Within the pixel the fluence in front of the grid is taken as
//! uniform. Extrafocal photons, whose strip shadows are displaced by up to 0.04 mm, get the lines of the focal spot.
//!
//! docs/physics.md, "Detector", grid.

use std::f64::consts::TAU;

use nalgebra::{Complex, Point3};
use rayon::prelude::*;

use crate::detector::grid::Grid;
use crate::detector::mtf::sinc;
use crate::detector::readout::Readout;
use crate::detector::strip_pattern::StripPattern;
use crate::engine::attenuation_basis::{LANES, exponents};
use crate::engine::exposure::Exposure;
use crate::engine::open_beam::LineMoments;
use crate::engine::path_tables::PathTables;
use crate::engine::paths::Paths;
use crate::engine::primary_rays::PrimaryRays;
use crate::engine::spectral_quadrature::{PRIMARY_ENERGIES, compressed};
use crate::transport::tally::Moments;
use crate::vector_math::{WIDTH, exp, pad};

/// Points per side of the focal spot over which fluence and response of the detector are averaged.
const OPEN_POINTS: usize = 2;

/// Harmonics with more cycles per pixel are omitted: the aperture leaves less than 2 % of them.
const MOST_CYCLES: f64 = 16.0;

/// Primary of all pixels behind the strips.
pub(super) struct ShadowedPrimary {
    /// Primary that the blur of the pixels converts to the expected signal. The blur multiplies a harmonic above the Nyquist frequency by
    /// the transfer at its alias; to compensate, the harmonic is scaled here by the transfer at its own frequency divided by that at
    /// the alias.
    pub expected: Vec<Moments>,
    /// Primary that reaches the pixels, if it differs.
    pub counted: Option<Vec<Moments>>,
}

/// Applies the lines of a stationary grid to the primary; without such a grid it is unchanged.
pub(super) fn shadowed(
    exposure: &Exposure,
    tables: &PathTables,
    primary: Vec<Moments>,
) -> ShadowedPrimary {
    let unchanged = |primary| ShadowedPrimary {
        expected: primary,
        counted: None,
    };
    let grid = match exposure.response.grid() {
        Some(grid) if !grid.is_moving() => grid,
        _ => return unchanged(primary),
    };
    let transport = &exposure.transport;
    let projection = transport.projection;
    let paths = Paths::with_tables(transport, tables.clone());
    let lines = compressed(exposure, PRIMARY_ENERGIES);
    let energies_kev = lines.energy_kev.clone();
    let rays = PrimaryRays::new(exposure, &paths, lines);
    let Some(open_beam) = rays.open_beam(&transport.emitter.spot_points(OPEN_POINTS)) else {
        return unchanged(primary); // the field misses the detector
    };
    let attenuation = paths.basis.by_line(&energies_kev);
    let detector = &projection.detector;
    let columns = detector.columns as usize;
    let table = ShadowTable::new(exposure, grid, &energies_kev);
    let scratch = || {
        (
            vec![[0.0; LANES]; paths.basis.groups],
            LineMoments::default(),
        )
    };
    let pixels = (0..primary.len())
        .into_par_iter()
        .with_min_len(columns.min(64));
    let shares: Vec<[[f32; 2]; 2]> = pixels
        .map_init(scratch, |(mass, open), pixel| {
            if primary[pixel].mean_kev <= 0.0 {
                return [[1.0; 2]; 2];
            }
            let at = detector.pixel_centre_mm(pixel);
            let on_plane = Point3::new(at.x, at.y, projection.source_detector_mm);
            open_beam.interpolate(at, open);
            paths.between(&Point3::origin(), &on_plane, mass);
            let through =
                |chunk: usize| exponents(mass, &attenuation, chunk * WIDTH).map(|e| exp(-e));
            let line = [pixel % columns, pixel / columns][grid.across()];
            let way_mm = grid.way_mm(&on_plane.coords.normalize());
            table.shares(line, way_mm, open, through)
        })
        .collect();
    let times = |kind: usize| -> Vec<Moments> {
        let pairs = primary.iter().zip(&shares);
        pairs
            .map(|(moments, shares)| Moments {
                mean_kev: moments.mean_kev * f64::from(shares[kind][0]),
                square_kev2: moments.square_kev2 * f64::from(shares[kind][1]),
            })
            .collect()
    };
    let counted = exposure.readout.transfer(0.0).map(|_| times(COUNTED));
    ShadowedPrimary {
        expected: times(EXPECTED),
        counted,
    }
}

const EXPECTED: usize = 0;
const COUNTED: usize = 1;

/// Transmission of the strips over pixels relative to the mean over the phase, by pixel across the strips and line of the spectrum.
struct ShadowTable {
    places: Vec<ShadowsAtPlace>,
}

/// Values for the shortest and the longest path through the grid, interpolated in between: they vary by some per cent along the strips.
struct ShadowsAtPlace {
    ways_mm: [f64; 2],
    /// By path, then [`EXPECTED`] and [`COUNTED`], line by line, padded.
    shares: [[Vec<f32>; 2]; 2],
}

impl ShadowTable {
    fn new(exposure: &Exposure, grid: &Grid, energies_kev: &[f64]) -> Self {
        let projection = exposure.transport.projection;
        let detector = &projection.detector;
        let across = grid.across();
        let (low, high) = (detector.field().low_mm, detector.field().high_mm);
        let along = 1 - across;
        let nearest = 0.0_f64.clamp(low[along], high[along]);
        let farthest = if low[along].abs() > high[along].abs() {
            low[along]
        } else {
            high[along]
        };
        let count = [detector.columns, detector.rows][across] as usize;
        let place = |index: usize| {
            let place = low[across] + (index as f64 + 0.5) * detector.pixel_mm;
            let ends = [nearest, farthest].map(|end| {
                let mut at_mm = [place; 2];
                at_mm[along] = end;
                let on_plane = Point3::new(at_mm[0], at_mm[1], projection.source_detector_mm);
                let direction = on_plane.coords.normalize();
                (at_mm, direction, grid.way_mm(&direction))
            });
            let shares = ends.each_ref().map(|(at_mm, direction, way_mm)| {
                let mut shares = [Vec::new(), Vec::new()];
                for &energy_kev in energies_kev {
                    let attenuation = grid.attenuation(energy_kev);
                    let (pattern, exit_mm) = grid.pattern(*at_mm, direction, *way_mm, attenuation);
                    let pixel = Pixel {
                        at_mm: exit_mm,
                        side_mm: detector.pixel_mm,
                    };
                    let counted =
                        pattern.over_aperture(pixel.at_mm, pixel.side_mm) / pattern.mean();
                    let expected = if exposure.readout.transfer(0.0).is_some() {
                        pixel.before_blur(&pattern, grid.pitch_mm(), &exposure.readout)
                    } else {
                        counted
                    };
                    shares[EXPECTED].push(expected as f32);
                    shares[COUNTED].push(counted as f32);
                }
                shares.iter_mut().for_each(pad);
                shares
            });
            ShadowsAtPlace {
                ways_mm: ends.map(|(_, _, way_mm)| way_mm),
                shares,
            }
        };
        Self {
            places: (0..count).into_par_iter().map(place).collect(),
        }
    }

    /// Factors of the mean energy and mean squared energy, for the [`EXPECTED`] and the [`COUNTED`] primary; `through` is the transmission
    /// of the phantom for a chunk of lines.
    fn shares(
        &self,
        place: usize,
        way_mm: f64,
        open: &LineMoments,
        through: impl Fn(usize) -> [f32; WIDTH],
    ) -> [[f32; 2]; 2] {
        let ShadowsAtPlace { ways_mm, shares } = &self.places[place];
        let [short, long] = *ways_mm;
        let t = if long > short {
            ((way_mm - short) / (long - short)) as f32
        } else {
            0.0
        };
        let mut signal = [0.0_f32; 2];
        let mut shaded = [[0.0_f32; 2]; 2];
        for chunk in 0..open.mean_kev.len() / WIDTH {
            for (lane, through) in through(chunk).into_iter().enumerate() {
                let line = chunk * WIDTH + lane;
                let moments = [open.mean_kev[line], open.square_kev2[line]];
                for (moment, value) in moments.into_iter().enumerate() {
                    signal[moment] += value * through;
                    for (kind, shaded) in shaded.iter_mut().enumerate() {
                        let [near, far] = [0, 1].map(|way| shares[way][kind][line]);
                        shaded[moment] += value * through * (near + t * (far - near));
                    }
                }
            }
        }
        shaded.map(|shaded| {
            [0, 1].map(|moment| {
                if signal[moment] > 0.0 {
                    shaded[moment] / signal[moment]
                } else {
                    1.0
                }
            })
        })
    }
}

/// The aperture of a pixel on the strip pattern.
struct Pixel {
    at_mm: f64,
    side_mm: f64,
}

impl Pixel {
    /// The pattern over the pixel relative to its mean, which a blur of the pixels converts to that of the converter.
    fn before_blur(&self, pattern: &StripPattern, pitch_mm: f64, readout: &Readout) -> f64 {
        let cycles = self.side_mm / pitch_mm;
        let transfer = |f: f64| readout.transfer(f).unwrap_or(1.0);
        let harmonics = (1..).take_while(|&m| f64::from(m) * cycles <= MOST_CYCLES);
        let sum: f64 = harmonics
            .map(|m| {
                let f = f64::from(m) * cycles;
                let alias = f - f.round();
                let wave = Complex::new(0.0, TAU * f64::from(m) * self.at_mm / pitch_mm).exp();
                let left = transfer(f);
                // Both may be zero.
                let share = if left == 0.0 {
                    0.0
                } else {
                    sinc(f) * left / transfer(alias)
                };
                2.0 * share * (pattern.coefficient(m) * wave).re
            })
            .sum();
        1.0 + sum / pattern.mean()
    }
}
