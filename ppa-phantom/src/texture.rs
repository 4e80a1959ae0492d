//! Texture of spongy bone: a random field whose spectrum is that of trabecular bone in radiographs.
//!
//! The field is a sum of octaves, each twice as coarse as the previous one: random numbers at the points of a lattice, joined by
//! quadratic B-splines. The spectrum of an octave is flat up to about a quarter of a wave per cell and falls off
//! quickly beyond, so that the sum follows a power law between the corners of the finest and of the coarsest octave. A
//! projection keeps the exponent (projection-slice theorem).

use std::array;

use nalgebra::{Matrix3, Point3, Rotation3};

use super::draw::{Purpose, Stream};

/// Number of octaves: with trabeculae 0.7 mm apart their cells are 0.2 to 4 mm.
const OCTAVES: usize = 5;
/// Cell of the finest octave over the distance between neighbouring trabeculae: the field then has one maximum per
/// distance along a line across the trabeculae.
const FINEST_CELL: f64 = 0.35;
/// Variance of an octave over that of the next finer one. Equal variances would make the exponent a little
/// more than 3; less in the coarse ones makes it about 2.8, in the middle of the 2.6 to 3 assumed for projected bone.
const COARSER: f64 = 0.7;

/// One octave of the field.
#[derive(Debug, Clone)]
struct Octave {
    /// Lattices of different octaves are rotated relative to each other and to the bone, so that no direction stands out.
    lattice_from_place: Matrix3<f64>,
    numbers: Stream,
}

/// A random field with mean 0, different for every seed.
///
/// Positions and widths are in units of the distance between trabeculae: across them twice, then along them.
#[derive(Debug, Clone)]
pub(super) struct Texture {
    octaves: [Octave; OCTAVES],
}

impl Texture {
    pub(super) fn new(seed: u64) -> Self {
        Self {
            octaves: array::from_fn(|n| {
                let turn = n as f64;
                let turn = Rotation3::from_euler_angles(
                    0.5 + 2.4 * turn,
                    0.9 + 1.3 * turn,
                    0.3 + 0.7 * turn,
                );
                let octave_seed = Stream::new(seed, Purpose::Texture).bits(n as u64);
                Octave {
                    lattice_from_place: turn.matrix() / cell(n),
                    numbers: Stream::new(octave_seed, Purpose::Texture),
                }
            }),
        }
    }

    /// The mean of the field over a voxel of this width. Its variance is [`variance_seen`].
    pub(super) fn at(&self, place: &Point3<f64>, width: [f64; 3]) -> f64 {
        let octaves = self.octaves.iter().enumerate();
        octaves
            .map(|(n, octave)| octave_variance(n, width).sqrt() * octave.at(place))
            .sum()
    }
}

/// Variance of the field averaged over voxels of this width; 1 at points.
pub(super) fn variance_seen(width: [f64; 3]) -> f64 {
    (0..OCTAVES).map(|n| octave_variance(n, width)).sum()
}

fn cell(octave: usize) -> f64 {
    FINEST_CELL * (1_u32 << octave) as f64
}

/// Share of an octave in the variance of the field at points, times the fraction that remains in means over voxels.
///
/// The kernel of an octave has a variance of a quarter of a cell squared along each axis, which a voxel raises by a twelfth of its
/// width squared; white noise loses as much variance as its kernel gains width.
fn octave_variance(octave: usize, width: [f64; 3]) -> f64 {
    let share =
        COARSER.powi(octave as i32) * (1.0 - COARSER) / (1.0 - COARSER.powi(OCTAVES as i32));
    let cell = cell(octave);
    let wider: f64 = width
        .iter()
        .map(|width| 1.0 + width * width / (3.0 * cell * cell))
        .product();
    share / wider.sqrt()
}

impl Octave {
    /// A field with mean 0 and variance 1.
    fn at(&self, place: &Point3<f64>) -> f64 {
        let q = self.lattice_from_place * place;
        let middle = q.map(f64::round);
        let weights: [[f64; 3]; 3] = array::from_fn(|axis| {
            let t = q[axis] - middle[axis];
            [
                0.5 * (0.5 - t) * (0.5 - t),
                0.75 - t * t,
                0.5 * (0.5 + t) * (0.5 + t),
            ]
        });
        // 21 bits per axis: the lattice repeats after 100 metres.
        let index = |axis: usize, step: usize| {
            ((middle[axis] as i64 + step as i64 - 1) as u64 & 0x1f_ffff) << (21 * axis)
        };
        let mut sum = 0.0;
        for (i, x) in weights[0].iter().enumerate() {
            for (j, y) in weights[1].iter().enumerate() {
                for (k, z) in weights[2].iter().enumerate() {
                    let number = self.numbers.even(index(0, i) | index(1, j) | index(2, k));
                    sum += x * y * z * number;
                }
            }
        }
        let squares = weights.map(|w| w.iter().map(|w| w * w).sum::<f64>());
        sum / squares.iter().product::<f64>().sqrt()
    }
}
