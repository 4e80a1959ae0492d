//! Lubberts effect: noise is blurred less than the signal, because the blur of a photon's light depends on the depth of the interaction.
//!
//! With the MTF T of the signal and the noise transfer N ≥ T, the square root of the normalised noise power, the DQE is lower by the
//! ratio R = T²/N² (Lubberts, J. Opt. Soc. Am. 58 (1968) 1475). Photons whose light is spread by the same kernel of transfer N, about a
//! point displaced at random from the interaction, have that noise, since displaced photons are still independent of each other. They
//! have the signal T if the distribution of the displacement has the characteristic function A = T/N. With 1/(1 + H f²) for T and
//! 1/(1 + H_N f²) for N that is
//!
//! A = H_N/H + (1 − H_N/H) / (1 + H f²):
//!
//! a share H_N/H of the photons is not displaced, the others are displaced by a Gaussian whose variance along either axis is exponentially
//! distributed, with mean H/2π².
//!
//! This reproduces signal and noise power of depth-dependent blur, not the light of single photons.

use std::f64::consts::PI;

use nalgebra::DMatrix;
use ppa_core::random::Philox;
use serde::{Deserialize, Serialize};

use crate::beam::receptor::{Blur, ReceptorError, require};
use crate::detector::mtf::{CurvePoint, Mtf, last_per_mm, lorentzian, table};

/// Noise transfer of a converter, and the displacement of photons that converts it to the MTF.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct Lubberts {
    /// N, without the aperture of the pixels.
    pub noise: Mtf,
    pub displacement: Displacement,
}

/// Distribution of the displacement of photons, in pixels.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case", deny_unknown_fields)]
pub(crate) enum Displacement {
    /// A share of the photons is not displaced, the others are displaced by a Gaussian of exponentially distributed variance.
    Exponential {
        stays: f64,
        /// Mean variance along either axis, pixels².
        variance: f64,
    },
    /// A mixture of Gaussians.
    Gaussians(Mtf),
}

impl Lubberts {
    /// `None` if noise is blurred like the signal.
    ///
    /// # Errors
    /// [`ReceptorError`] for invalid numbers, a noise transfer below the MTF, and a noise transfer or ratio of MTF and noise transfer that
    /// does not fall steadily.
    pub fn of(blur: &Blur, pixel_mm: f64) -> Result<Option<Self>, ReceptorError> {
        let last_per_mm = last_per_mm(pixel_mm);
        match blur {
            Blur::Lorentzian {
                noise_h_mm2: None, ..
            }
            | Blur::Mtf { noise: None, .. } => Ok(None),
            Blur::Lorentzian {
                h_mm2,
                noise_h_mm2: Some(noise_h_mm2),
            } => {
                let expected = "0 mm² to H of the MTF";
                let what = "H of the noise transfer 1/(1 + H f²)";
                require(what, *noise_h_mm2, 0.0..=*h_mm2, expected)?;
                let curve = lorentzian(*noise_h_mm2, last_per_mm);
                Ok(Some(Self {
                    noise: Mtf::fitted(NOISE, &curve, pixel_mm)?,
                    displacement: Displacement::Exponential {
                        stays: noise_h_mm2 / h_mm2,
                        variance: h_mm2 / (2.0 * PI * PI * pixel_mm * pixel_mm),
                    },
                }))
            }
            Blur::Mtf {
                per_mm,
                mtf,
                noise: Some(noise),
            } => {
                let signal = table("MTF", per_mm, mtf, last_per_mm)?;
                let noise = table(NOISE, per_mm, noise, last_per_mm)?;
                let ratio = signal.iter().zip(&noise).map(|(signal, noise)| {
                    if noise.value < signal.value {
                        return Err(ReceptorError::NoiseBelowMtf {
                            per_mm: noise.per_mm,
                            noise: noise.value,
                            mtf: signal.value,
                        });
                    }
                    // The transfer of the image is N times A, so an error of A matters where N is large.
                    Ok(CurvePoint {
                        value: signal.value / noise.value.max(f64::MIN_POSITIVE),
                        weight: noise.value,
                        ..*noise
                    })
                });
                let ratio = ratio.collect::<Result<Vec<_>, _>>()?;
                let displacement =
                    Mtf::fitted("ratio of MTF and noise transfer", &ratio, pixel_mm)?;
                Ok(Some(Self {
                    noise: Mtf::fitted(NOISE, &noise, pixel_mm)?,
                    displacement: Displacement::Gaussians(displacement),
                }))
            }
        }
    }
}

const NOISE: &str = "noise transfer";

impl Displacement {
    /// Samples the displacement of a photon along x and y, pixels.
    pub fn draw(&self, rng: &mut Philox) -> [f64; 2] {
        let sigma = match self {
            Self::Exponential { stays, variance } => {
                if rng.unit() < *stays {
                    0.0
                } else {
                    // 1 − u is in (0, 1], so the logarithm stays finite.
                    (-variance * (1.0 - rng.unit()).ln()).sqrt()
                }
            }
            Self::Gaussians(mixture) => {
                let mut left = rng.unit();
                let term = mixture.terms().iter().find(|(weight, _)| {
                    left -= weight;
                    left < 0.0
                });
                // Because of rounding the weights may sum to less than 1.
                term.or(mixture.terms().last()).map_or(0.0, |term| term.1)
            }
        };
        if sigma == 0.0 {
            return [0.0; 2];
        }
        rng.normals().map(|normal| sigma * normal)
    }

    /// The characteristic function at all pairs of `frequencies`, in cycles per pixel.
    pub fn plane(&self, frequencies: &[f64]) -> DMatrix<f64> {
        match self {
            Self::Exponential { stays, variance } => {
                let h = 2.0 * PI * PI * variance;
                DMatrix::from_fn(frequencies.len(), frequencies.len(), |i, j| {
                    let square = frequencies[i].powi(2) + frequencies[j].powi(2);
                    stays + (1.0 - stays) / (1.0 + h * square)
                })
            }
            Self::Gaussians(mixture) => mixture.plane(frequencies),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const PIXEL_MM: f64 = 0.2;

    fn tabulated(noise_h_mm2: f64) -> Blur {
        let per_mm: Vec<f64> = (0..=40).map(|i| 0.2 * f64::from(i)).collect();
        let values = |h: f64| per_mm.iter().map(|f| 1.0 / (1.0 + h * f * f)).collect();
        Blur::Mtf {
            mtf: values(0.45),
            noise: Some(values(noise_h_mm2)),
            per_mm,
        }
    }

    /// The mean of cos 2πfx over 1e5 samples: an error of 0.0023 at most, 10 comparisons at 4.5 standard errors; for tables
    /// another 0.03/N for the fit.
    #[test]
    fn displaced_photons_lead_from_noise_to_signal() {
        const DRAWS: u32 = 100_000;
        let exact = Blur::Lorentzian {
            h_mm2: 0.45,
            noise_h_mm2: Some(0.15),
        };
        for (blur, fit) in [(exact, 0.0), (tabulated(0.15), 0.03)] {
            let lubberts = Lubberts::of(&blur, PIXEL_MM).unwrap().unwrap();
            let steps: Vec<[f64; 2]> = (0..DRAWS)
                .map(|i| {
                    let mut rng = Philox::new(3, 0, u64::from(i));
                    lubberts.displacement.draw(&mut rng)
                })
                .collect();
            for (fx, fy) in [(0.1, 0.0), (0.0, 0.25), (0.3, 0.4), (0.5, 0.5), (0.9, 0.0)] {
                let cosines = steps
                    .iter()
                    .map(|[x, y]| (2.0 * PI * (fx * x + fy * y)).cos());
                let found = cosines.sum::<f64>() / f64::from(DRAWS);
                let square = (fx * fx + fy * fy) / (PIXEL_MM * PIXEL_MM);
                let [signal, noise] = [0.45, 0.15].map(|h| 1.0 / (1.0 + h * square));
                let error = 4.5 * (0.5 / f64::from(DRAWS)).sqrt() + fit / noise;
                assert!(
                    (found - signal / noise).abs() < error,
                    "{blur:?} at {fx}, {fy}: {found}, {}",
                    signal / noise
                );
                let plane = lubberts.displacement.plane(&[fx, fy]);
                assert!((plane[(0, 1)] - found).abs() < 4.5 * (0.5 / f64::from(DRAWS)).sqrt());
            }
        }
    }

    #[test]
    fn noise_transfers_that_make_no_sense_are_refused() {
        let refused = |blur: Blur| Lubberts::of(&blur, PIXEL_MM).unwrap_err().to_string();
        let lorentzian = |noise_h_mm2| Blur::Lorentzian {
            h_mm2: 0.45,
            noise_h_mm2: Some(noise_h_mm2),
        };
        assert!(refused(lorentzian(0.5)).contains("noise transfer 1/(1 + H f²) is 0.5"));
        assert!(refused(lorentzian(f64::NAN)).contains("NaN"));
        assert!(refused(lorentzian(-1.0)).contains("-1"));
        let table = |mtf: &[f64], noise: &[f64]| Blur::Mtf {
            per_mm: vec![1.0, 2.0, 3.0],
            mtf: mtf.to_vec(),
            noise: Some(noise.to_vec()),
        };
        let below = refused(table(&[0.7, 0.4, 0.2], &[0.8, 0.3, 0.3]));
        assert!(
            below.contains("0.3 at 2/mm is below the MTF of 0.4"),
            "{below}"
        );
        let short = refused(table(&[0.7, 0.4, 0.2], &[0.8, 0.5]));
        assert!(
            short.contains("noise transfer table are 3 and 2"),
            "{short}"
        );
        // A noise transfer that falls more steeply than the MTF and then not at all.
        let ratio = refused(table(&[0.4, 0.39, 0.38], &[0.9, 0.6, 0.39]));
        assert!(ratio.contains("ratio of MTF and noise transfer"), "{ratio}");
        assert!(
            Lubberts::of(&Blur::lorentzian(0.45), PIXEL_MM)
                .unwrap()
                .is_none()
        );
        assert!(Lubberts::of(&lorentzian(0.0), PIXEL_MM).unwrap().is_some());
    }
}
