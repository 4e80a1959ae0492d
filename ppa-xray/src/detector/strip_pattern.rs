//! Transmission of the strips of a stationary grid as a function of position.
//!
//! In the frame sheared along its strips, see [`Grid`](crate::detector::grid::Grid), a photon that leaves the grid at v has moved over
//! [v − Δ, v]. The part of Δ in strips is a continuous function of v, linear between four points of a period, at which either end of the
//! path enters or leaves a strip. So integrals of exp(−κ · part) over v and its Fourier coefficients have closed forms.

use std::f64::consts::TAU;

use nalgebra::Complex;

/// Strips of thickness `strip_mm` with a period of `pitch_mm`, one of them centred at 0.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Strips {
    pub strip_mm: f64,
    pub pitch_mm: f64,
}

impl Strips {
    /// Length in strips of a sideways path that ends at `to_mm`.
    pub fn in_strips_mm(&self, to_mm: f64, sideways_mm: f64) -> f64 {
        // Relative to the edge of a strip; reduced first, so that no digits are lost for a short path.
        let to = (to_mm + 0.5 * self.strip_mm).rem_euclid(self.pitch_mm);
        self.up_to(to) - self.up_to(to - sideways_mm)
    }

    fn up_to(&self, at: f64) -> f64 {
        let periods = (at / self.pitch_mm).floor();
        let rest = at - periods * self.pitch_mm;
        periods * self.strip_mm + rest.min(self.strip_mm)
    }
}

/// exp(−κ · length in strips) for photons with the same sideways movement, as a function of the exit position.
#[derive(Debug, Clone)]
pub(crate) struct StripPattern {
    pitch_mm: f64,
    /// Start of the first piece.
    first_mm: f64,
    pieces: Vec<Piece>,
    /// Integral over a period.
    period_mm: f64,
}

/// exp(−(a + b t)) for t from 0 to a length.
#[derive(Debug, Clone, Copy)]
struct Piece {
    a: f64,
    b_per_mm: f64,
    length_mm: f64,
}

impl Piece {
    fn integral_mm(&self, length_mm: f64) -> f64 {
        let exponent = self.b_per_mm * length_mm;
        let mean = if exponent.abs() > 1e-9 {
            -(-exponent).exp_m1() / exponent
        } else {
            1.0
        };
        (-self.a).exp() * length_mm * mean
    }
}

impl StripPattern {
    /// `kappa_per_mm` is the additional attenuation in strips compared with spaces, per sideways length.
    pub fn new(strips: Strips, sideways_mm: f64, kappa_per_mm: f64) -> Self {
        let Strips { strip_mm, pitch_mm } = strips;
        let half = 0.5 * strip_mm;
        let mut bends_mm = [-half, half, sideways_mm - half, sideways_mm + half]
            .map(|at: f64| at.rem_euclid(pitch_mm));
        bends_mm.sort_by(f64::total_cmp);
        let exponent = |at: f64| kappa_per_mm * strips.in_strips_mm(at, sideways_mm);
        let ends = [
            bends_mm[1],
            bends_mm[2],
            bends_mm[3],
            bends_mm[0] + pitch_mm,
        ];
        let pieces = bends_mm
            .into_iter()
            .zip(ends)
            .filter(|(from, to)| to > from);
        let pieces: Vec<Piece> = pieces
            .map(|(from, to)| {
                let (a, end) = (exponent(from), exponent(to));
                Piece {
                    a,
                    b_per_mm: (end - a) / (to - from),
                    length_mm: to - from,
                }
            })
            .collect();
        Self {
            pitch_mm,
            first_mm: bends_mm[0],
            period_mm: pieces
                .iter()
                .map(|piece| piece.integral_mm(piece.length_mm))
                .sum(),
            pieces,
        }
    }

    /// Mean over the phase.
    pub fn mean(&self) -> f64 {
        self.period_mm / self.pitch_mm
    }

    /// Mean over an aperture of width `width_mm` centred at `at_mm`.
    pub fn over_aperture(&self, at_mm: f64, width_mm: f64) -> f64 {
        let at = (at_mm - self.first_mm).rem_euclid(self.pitch_mm);
        (self.up_to(at + 0.5 * width_mm) - self.up_to(at - 0.5 * width_mm)) / width_mm
    }

    /// Integral from the first bend.
    fn up_to(&self, at_mm: f64) -> f64 {
        let periods = (at_mm / self.pitch_mm).floor();
        let mut rest = at_mm - periods * self.pitch_mm;
        let mut sum = periods * self.period_mm;
        for piece in &self.pieces {
            sum += piece.integral_mm(rest.clamp(0.0, piece.length_mm));
            rest -= piece.length_mm;
        }
        sum
    }

    /// The coefficient c of c · exp(2πi m v / pitch).
    pub fn coefficient(&self, m: u32) -> Complex<f64> {
        let omega = TAU * f64::from(m) / self.pitch_mm;
        let mut from = self.first_mm;
        let mut sum = Complex::new(0.0, 0.0);
        for piece in &self.pieces {
            let rate = Complex::new(piece.b_per_mm, omega);
            let left = Complex::new(1.0, 0.0) - (-rate * piece.length_mm).exp();
            let phase = Complex::new(-piece.a, -omega * from).exp();
            sum += if rate.norm() * piece.length_mm > 1e-9 {
                phase * left / rate
            } else {
                phase * piece.length_mm
            };
            from += piece.length_mm;
        }
        sum / self.pitch_mm
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        /// Length in strips by counting steps; mean, aperture and Fourier sum of the pattern by sums over positions.
        #[test]
        fn closed_forms_are_sums_over_places(
            strip_mm in 0.02..0.15_f64, sideways_mm in 1e-4..0.7_f64, at_mm in -3.0..3.0_f64, width_mm in 0.03..0.6_f64, opacity in -0.5..20.0_f64
        ) {
            const STEPS: u32 = 4_000;
            let strips = Strips { strip_mm, pitch_mm: 0.2 };
            let in_strips = |to: f64| {
                let places = (0..STEPS).map(|i| to - sideways_mm * (f64::from(i) + 0.5) / f64::from(STEPS));
                let inside = places.filter(|at| (at / 0.2 - (at / 0.2).round()).abs() * 0.2 < 0.5 * strip_mm);
                sideways_mm * inside.count() as f64 / f64::from(STEPS)
            };
            prop_assert!((strips.in_strips_mm(at_mm, sideways_mm) - in_strips(at_mm)).abs() < 4.0 * sideways_mm / f64::from(STEPS));

            let kappa = opacity / sideways_mm;
            let pattern = StripPattern::new(strips, sideways_mm, kappa);
            let value = |v: f64| (-kappa * strips.in_strips_mm(v, sideways_mm)).exp();
            let sum = |from: f64, length: f64, of: &dyn Fn(f64) -> f64| {
                let places = (0..STEPS).map(|i| from + length * (f64::from(i) + 0.5) / f64::from(STEPS));
                places.map(of).sum::<f64>() / f64::from(STEPS)
            };
            // A piece steep within one step is off by less than its height times a step.
            let error = 2e-3 * 1.0_f64.max((-opacity).exp());
            prop_assert!((pattern.mean() - sum(0.0, 0.2, &value)).abs() < error);
            prop_assert!((pattern.over_aperture(at_mm, width_mm) - sum(at_mm - 0.5 * width_mm, width_mm, &value)).abs() < error);
            for m in 0..4 {
                let c = pattern.coefficient(m);
                let omega = TAU * f64::from(m) / 0.2;
                prop_assert!((c.re - sum(0.0, 0.2, &|v| value(v) * (omega * v).cos())).abs() < error);
                prop_assert!((c.im + sum(0.0, 0.2, &|v| value(v) * (omega * v).sin())).abs() < error);
            }
        }
    }
}
