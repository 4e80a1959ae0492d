//! The x-ray source of an exposure: focal spot, heel effect, collimation.

use nalgebra::{Point3, Vector3};
use serde::{Deserialize, Serialize};

use crate::beam::field::Field;
use crate::philox::Philox;

/// What the tube adds to a point that sends the same photons everywhere.
///
/// The default is that point, collimated to the detector.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Source {
    /// The area that photons leave from.
    pub focal_spot: FocalSpot,
    /// Which part of the detector plane photons are sent to.
    pub collimation: Collimation,
    /// Intensity and spectrum by angle to the anode; without it both are those of the central ray.
    pub heel_effect: Option<HeelEffect>,
}

/// The effective focal spot: as seen along the central ray, in a plane square to it.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct FocalSpot {
    /// Side of the square, or full width at half maximum of the Gaussian, mm; 0 is a point.
    pub size_mm: f64,
    /// How the intensity is spread.
    pub shape: SpotShape,
}

/// Distribution of the intensity over the focal spot.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum SpotShape {
    /// Even over a square.
    #[default]
    Uniform,
    /// A Gaussian, the same in all directions.
    Gaussian,
}

/// Field of the beam in the detector plane. Its edges are sharp.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Collimation {
    /// Exactly the detector.
    #[default]
    Detector,
    /// A rectangle, smaller or larger than the detector.
    Rectangle {
        /// Sides along device x and y, mm.
        size_mm: [f64; 2],
        /// Centre in device x and y, mm from the foot of the perpendicular through the source.
        #[serde(default)]
        centre_mm: [f64; 2],
    },
    /// A rectangle by its opening angles seen from the source, half to either side of device z, as the fan beam of MC-GPU.
    Fan {
        /// Full angles in the planes of device x and y, degrees.
        angles_deg: [f64; 2],
    },
}

/// Anode heel effect: photons that leave close to the anode's face lose more of themselves in it.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct HeelEffect {
    /// Where the anode is seen from the cathode: degrees from device x towards device y.
    pub anode_towards_deg: f64,
}

/// A Gaussian of this full width at half maximum has the standard deviation 1: √(8 ln 2).
const FWHM_PER_SIGMA: f64 = 2.354_820_045_030_949;

/// No standard normal number is farther from 0: random numbers come in steps of 2⁻³², and √(2 ln 2³²) is 6.66.
const WIDEST: f64 = 6.67;

/// Half-width of the square that stands for a Gaussian in sums over the spot, in standard deviations.
const GAUSSIAN_REACH: f64 = 3.5;

impl FocalSpot {
    pub(crate) fn is_point(&self) -> bool {
        self.size_mm == 0.0
    }

    /// Largest offset along an axis of the spot's plane, mm.
    pub(crate) fn reach_mm(&self) -> f64 {
        match self.shape {
            SpotShape::Uniform => 0.5 * self.size_mm,
            SpotShape::Gaussian => WIDEST * self.size_mm / FWHM_PER_SIGMA,
        }
    }

    /// Offset along two axes of the spot's plane, mm; a point draws nothing.
    #[inline]
    pub(crate) fn sample(&self, rng: &mut Philox) -> [f64; 2] {
        if self.is_point() {
            return [0.0; 2];
        }
        match self.shape {
            SpotShape::Uniform => [(); 2].map(|()| self.size_mm * (rng.unit() - 0.5)),
            SpotShape::Gaussian => rng.normals().map(|z| self.size_mm / FWHM_PER_SIGMA * z),
        }
    }

    /// `per_side`² points (at least 4) with weights that sum to 1: midpoints of equal cells of the square, or of the
    /// Gaussian within 3.5 standard deviations, moved outwards or inwards until their variance is that of the spot.
    /// Four points are then those of Gauss and integrate cubics exactly. A point is one point.
    pub(crate) fn quadrature(&self, per_side: u32) -> Vec<([f64; 2], f64)> {
        if self.is_point() {
            return vec![([0.0; 2], 1.0)];
        }
        let sigma_mm = self.size_mm / FWHM_PER_SIGMA;
        let half_mm = match self.shape {
            SpotShape::Uniform => 0.5 * self.size_mm,
            SpotShape::Gaussian => GAUSSIAN_REACH * sigma_mm,
        };
        let line: Vec<(f64, f64)> = (0..per_side)
            .map(|i| {
                let at = half_mm * ((2.0 * f64::from(i) + 1.0) / f64::from(per_side) - 1.0);
                let weight = match self.shape {
                    SpotShape::Uniform => 1.0,
                    SpotShape::Gaussian => (-0.5 * (at / sigma_mm).powi(2)).exp(),
                };
                (at, weight)
            })
            .collect();
        let sum: f64 = line.iter().map(|(_, weight)| weight).sum();
        let square: f64 = line.iter().map(|(at, weight)| at * at * weight / sum).sum();
        let variance = match self.shape {
            SpotShape::Uniform => half_mm * half_mm / 3.0,
            SpotShape::Gaussian => sigma_mm * sigma_mm,
        };
        let spread = (variance / square).sqrt();
        line.iter()
            .flat_map(|&(y, wy)| {
                line.iter()
                    .map(move |&(x, wx)| ([spread * x, spread * y], wx * wy / (sum * sum)))
            })
            .collect()
    }
}

impl Collimation {
    /// The field on a plane `distance_mm` from the source, for a detector that covers `detector`.
    pub(crate) fn field(&self, detector: Field, distance_mm: f64) -> Field {
        match *self {
            Self::Detector => detector,
            Self::Rectangle { size_mm, centre_mm } => Field::centred(centre_mm, size_mm),
            Self::Fan { angles_deg } => {
                let side = |deg: f64| 2.0 * distance_mm * (0.5 * deg.to_radians()).tan();
                Field::centred([0.0; 2], angles_deg.map(side))
            }
        }
    }
}

/// Where the focal spot lies in the device frame.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct SpotPlane {
    pub axes: [Vector3<f64>; 2],
}

impl SpotPlane {
    /// The plane square to the central ray; its axes are device x and y, tilted with the ray.
    pub fn square_to(central_ray: &Vector3<f64>) -> Self {
        let turn = nalgebra::UnitQuaternion::rotation_between(&Vector3::z(), central_ray)
            .unwrap_or_else(nalgebra::UnitQuaternion::identity);
        Self {
            axes: [turn * Vector3::x(), turn * Vector3::y()],
        }
    }

    #[inline]
    pub fn at(&self, [x, y]: [f64; 2]) -> Point3<f64> {
        Point3::from(self.axes[0] * x + self.axes[1] * y)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Standard deviation of the samples and of the quadrature: side/√12, FWHM/2.3548.
    #[test]
    fn spots_are_as_wide_as_asked_for() {
        let draws = 40_000_u32;
        for (shape, sigma_mm, kurtosis) in [
            (SpotShape::Uniform, 1.2 / 12.0_f64.sqrt(), 1.8),
            (SpotShape::Gaussian, 1.2 / FWHM_PER_SIGMA, 3.0),
        ] {
            let spot = FocalSpot {
                size_mm: 1.2,
                shape,
            };
            let mut square = 0.0;
            for i in 0..draws {
                let [x, y] = spot.sample(&mut Philox::new(3, 0, u64::from(i)));
                square += x * x + y * y;
            }
            let n = 2.0 * f64::from(draws);
            // Variance of the mean square: (kurtosis − 1) σ⁴ / n.
            let spread = sigma_mm * sigma_mm * ((kurtosis - 1.0_f64) / n).sqrt();
            let z = (square / n - sigma_mm * sigma_mm) / spread;
            assert!(z.abs() < 4.0, "{shape:?}: {z:.1} sigma"); // 6e-5
            for per_side in [2, 4, 16] {
                let points = spot.quadrature(per_side);
                let sum: f64 = points.iter().map(|(_, w)| w).sum();
                let variance: f64 = points.iter().map(|([x, _], w)| w * x * x).sum();
                assert!((sum - 1.0).abs() < 1e-12);
                assert!((variance / (sigma_mm * sigma_mm) - 1.0).abs() < 1e-12);
            }
        }
    }
}
