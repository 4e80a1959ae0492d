//! Integrals over a layer: the exponential integral, and points and weights.

/// Exponential integral E₂(x) = ∫₀¹ exp(−x/c) dc: the share of isotropic photons that pass an optical
/// depth x of a half-space (Abramowitz and Stegun, 5.1.4, 5.1.11, 5.1.14, 5.1.22).
pub(crate) fn e2(x: f64) -> f64 {
    const EULER: f64 = 0.577_215_664_901_532_9;
    if x <= 0.0 {
        return 1.0;
    }
    if x > 700.0 {
        return 0.0;
    }
    let e1 = if x < 1.0 {
        let mut sum = -EULER - x.ln();
        let mut term = -1.0;
        for n in 1..30 {
            term *= -x / f64::from(n);
            sum += term / f64::from(n);
        }
        sum
    } else {
        // Lentz's continued fraction.
        let mut b = x + 1.0;
        let mut c = f64::INFINITY;
        let mut d = 1.0 / b;
        let mut fraction = d;
        for n in 1..200 {
            let a = -f64::from(n * n);
            b += 2.0;
            d = 1.0 / (a * d + b);
            c = b + a / c;
            fraction *= c * d;
            if (c * d - 1.0).abs() < 1e-12 {
                break;
            }
        }
        fraction * (-x).exp()
    };
    (-x).exp() - x * e1
}

/// Points and weights of Gauss–Legendre quadrature on [0, 1].
pub(crate) fn gauss_legendre<const N: usize>() -> [(f64, f64); N] {
    std::array::from_fn(|i| {
        let mut x = (std::f64::consts::PI * (i as f64 + 0.75) / (N as f64 + 0.5)).cos();
        let mut slope = 1.0;
        for _ in 0..20 {
            let (mut p, mut before) = (x, 1.0);
            for n in 2..=N {
                let n = n as f64;
                (p, before) = (((2.0 * n - 1.0) * x * p - (n - 1.0) * before) / n, p);
            }
            slope = N as f64 * (x * p - before) / (x * x - 1.0);
            x -= p / slope;
        }
        (0.5 * (1.0 + x), 1.0 / ((1.0 - x * x) * slope * slope))
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    /// E₂ of Abramowitz and Stegun, table 5.4.
    #[test]
    fn exponential_integral_agrees_with_the_tables() {
        for (x, expected) in [
            (0.0, 1.0),
            (0.1, 0.722_545_0),
            (0.5, 0.326_643_9),
            (1.0, 0.148_495_5),
            (2.0, 0.037_534_3),
        ] {
            assert!((e2(x) - expected).abs() < 2e-7, "E₂({x}) = {}", e2(x));
        }
    }

    #[test]
    fn points_and_weights_integrate_polynomials() {
        for power in 0..20 {
            let sum: f64 = gauss_legendre::<10>()
                .iter()
                .map(|(x, w)| w * x.powi(power))
                .sum();
            assert!((sum * f64::from(power + 1) - 1.0).abs() < 1e-13, "{power}");
        }
    }
}
