//! Additive recurrence with irrational steps: points of low discrepancy with a random shift.
//!
//! Niederreiter, *Random Number Generation and Quasi-Monte Carlo Methods*, 1992, ch. 3; shift: Cranley and Patterson, SIAM J.
//! Numer. Anal. 13 (1976) 904. docs/physics.md, "Fast engine", first collisions.

use ppa_core::random::Philox;

/// Randomly shifted multiples of fixed irrational numbers, modulo 1 (a Kronecker sequence).
///
/// Each point by itself is uniform, so averages are unbiased. Together the points are evenly distributed, so averages of smooth
/// functions converge nearly as 1/n. The irrational numbers are powers of 1/g, where g is the root of g^(d+1) = g + 1.
#[derive(Debug, Clone)]
pub(crate) struct QuasiRandom<const D: usize> {
    point: [u64; D],
    step: [u64; D],
}

impl<const D: usize> QuasiRandom<D> {
    /// The sequence with a random start.
    pub fn new(rng: &mut Philox) -> Self {
        let mut g = 1.5_f64;
        for _ in 0..64 {
            g = (1.0 + g).powf(1.0 / (D as f64 + 1.0));
        }
        let whole = 2.0_f64.powi(64);
        Self {
            // Two random numbers of 32 bits.
            point: [(); D].map(|()| {
                let high = (rng.unit() * 4_294_967_296.0) as u64;
                (high << 32) | (rng.unit() * 4_294_967_296.0) as u64
            }),
            step: std::array::from_fn(|axis| (g.powi(-(axis as i32) - 1) * whole) as u64),
        }
    }

    /// The next point.
    #[inline]
    pub fn next(&mut self) -> [f64; D] {
        std::array::from_fn(|axis| {
            self.point[axis] = self.point[axis].wrapping_add(self.step[axis]);
            (self.point[axis] >> 11) as f64 * (1.0 / (1_u64 << 53) as f64)
        })
    }
}
