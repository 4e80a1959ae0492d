//! The x-ray source of an exposure: focal spot, heel effect, collimation.

use nalgebra::{Point3, Vector3};
use ppa_core::random::Philox;
use serde::{Deserialize, Serialize};

use crate::beam::field::Field;
use crate::setters::setters;

/// Differences of the tube from a point that emits the same photons in all directions.
///
/// The default is that point, collimated to the detector.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
#[non_exhaustive]
pub struct Source {
    /// Area from which photons are emitted.
    pub focal_spot: FocalSpot,
    /// Part of the detector plane that the beam covers.
    pub collimation: Collimation,
    /// Distance of the collimator blades from the focal spot along device z, mm: an extended spot gives the field a penumbra. Without it,
    /// edges are sharp.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub blades_mm: Option<f64>,
    /// Extrafocal radiation; needs `blades_mm`.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub extrafocal: Option<Extrafocal>,
    /// Dependence of intensity and spectrum on the angle to the anode; without it, both are those of the central ray.
    pub heel_effect: Option<HeelEffect>,
}

/// The effective focal spot: as seen along the central ray, in a plane perpendicular to it.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
#[non_exhaustive]
pub struct FocalSpot {
    /// Side of the square, or full width at half maximum of the Gaussian, mm; 0 is a point.
    pub size_mm: f64,
    /// Distribution of the intensity.
    pub shape: SpotShape,
}

/// Distribution of the intensity over the focal spot.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
#[non_exhaustive]
pub enum SpotShape {
    /// Uniform over a square.
    #[default]
    Uniform,
    /// A Gaussian, the same in all directions.
    Gaussian,
}

/// Extrafocal (off-focal) radiation: photons from electrons that are scattered back from the focal spot and hit the anode again.
///
/// They have the spectrum of the focal spot. The collimator blades, at some distance from the anode, also let them out beyond the field.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
#[non_exhaustive]
pub struct Extrafocal {
    /// Photons per solid angle relative to those of the focal spot, where the blades cover neither. Ali and Rogers, Med. Phys. 35 (2008)
    /// 4149, find up to 0.11 of the exposure for radiography tubes.
    pub ratio: f64,
    /// Side of the square that the extrafocal photons leave from, centred on the focal spot in its plane, mm.
    pub size_mm: f64,
}

/// Field of the beam in the detector plane, as the middle of the focal spot sees it.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
#[non_exhaustive]
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
    /// A rectangle given by its opening angles at the source, half to either side of device z, like the fan beam of MC-GPU.
    Fan {
        /// Full angles in the planes of device x and y, degrees.
        angles_deg: [f64; 2],
    },
}

/// Anode heel effect: photons that leave close to the anode's face are attenuated more by the anode.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
#[non_exhaustive]
pub struct HeelEffect {
    /// Direction from the cathode to the anode: degrees from device x towards device y.
    pub anode_towards_deg: f64,
}

/// Full width at half maximum of a Gaussian with standard deviation 1: √(8 ln 2).
const FWHM_PER_SIGMA: f64 = 2.354_820_045_030_949;

/// Upper limit of the magnitude of a standard normal number: random numbers come in steps of 2⁻³², and √(2 ln 2³²) is 6.66.
const WIDEST: f64 = 6.67;

setters!(Source {
    with_focal_spot: focal_spot = FocalSpot,
    with_collimation: collimation = Collimation,
    with_blades_mm: blades_mm = impl Into<Option<f64>>,
    with_extrafocal: extrafocal = impl Into<Option<Extrafocal>>,
    with_heel_effect: heel_effect = impl Into<Option<HeelEffect>>,
});

setters!(FocalSpot {
    with_size_mm: size_mm = f64,
    with_shape: shape = SpotShape,
});

impl Extrafocal {
    /// Extrafocal radiation of `ratio` times the photons of the focal spot, uniform over a square of side `size_mm`.
    pub const fn new(ratio: f64, size_mm: f64) -> Self {
        Self { ratio, size_mm }
    }

    /// The square that the extrafocal photons leave from.
    pub(crate) fn area(self) -> FocalSpot {
        FocalSpot {
            size_mm: self.size_mm,
            shape: SpotShape::Uniform,
        }
    }
}

impl HeelEffect {
    /// Takes the direction of the anode as seen from the cathode: degrees from device x towards device y.
    pub const fn new(anode_towards_deg: f64) -> Self {
        Self { anode_towards_deg }
    }
}

impl FocalSpot {
    pub(crate) fn is_point(&self) -> bool {
        self.size_mm == 0.0
    }

    /// Largest offset along an axis of the spot's plane, mm.
    pub(crate) fn reach_mm(&self) -> f64 {
        match self.shape {
            SpotShape::Uniform => 0.5 * self.size_mm,
            SpotShape::Gaussian => WIDEST * self.sigma_mm(),
        }
    }

    /// Largest offset along an axis that counts for penumbrae, mm; 2.7e-3 of a Gaussian spot is beyond it.
    pub(crate) fn shadow_reach_mm(&self) -> f64 {
        match self.shape {
            SpotShape::Uniform => 0.5 * self.size_mm,
            SpotShape::Gaussian => 3.0 * self.sigma_mm(),
        }
    }

    /// Samples an offset along two axes of the spot's plane, mm. A point uses no random numbers.
    #[inline]
    pub(crate) fn sample(&self, rng: &mut Philox) -> [f64; 2] {
        if self.is_point() {
            return [0.0; 2];
        }
        match self.shape {
            SpotShape::Uniform => [(); 2].map(|()| self.size_mm * (rng.unit() - 0.5)),
            SpotShape::Gaussian => rng.normals().map(|z| self.sigma_mm() * z),
        }
    }

    /// Offsets along an axis of the spot's plane, mm: the medians of `count` equally strong strips, moved outwards until their
    /// variance is that of the spot. Used in both x and y, they represent the spot with equal weights. A point or a single strip
    /// gives the middle.
    pub(crate) fn strips_mm(&self, count: usize) -> Vec<f64> {
        if self.is_point() || count == 1 {
            return vec![0.0; count];
        }
        let medians = (0..count).map(|strip| (strip as f64 + 0.5) / count as f64);
        let line: Vec<f64> = match self.shape {
            SpotShape::Uniform => medians.map(|share| share - 0.5).collect(),
            SpotShape::Gaussian => gaussian_quantiles(medians),
        };
        let variance = line.iter().map(|at| at * at).sum::<f64>() / count as f64;
        let spread_mm = self.sigma_mm() / variance.sqrt();
        line.iter().map(|at| spread_mm * at).collect()
    }

    /// Share of the spot at offsets below `offset_mm` along an axis.
    pub(crate) fn share_below(&self, offset_mm: f64) -> f64 {
        match self.shape {
            SpotShape::Uniform => (offset_mm / self.size_mm + 0.5).clamp(0.0, 1.0),
            SpotShape::Gaussian => normal_share_below(offset_mm / self.sigma_mm()),
        }
    }

    /// Offset along an axis, mm, of one of the strips of [`FocalSpot::strips_mm`] when they divide the part of the spot between two shares.
    ///
    /// Strips of a part of a Gaussian spot are at their medians, without the variance correction.
    pub(crate) fn strip_of_part_mm(
        &self,
        [first, last]: [f64; 2],
        strip: usize,
        strips_mm: &[f64],
    ) -> f64 {
        /// A Gaussian spot without the 3e-3 that do not count for penumbrae.
        const WHOLE: f64 = 0.997;
        let size = last - first;
        match self.shape {
            SpotShape::Uniform => {
                self.size_mm * (0.5 * (first + last) - 0.5) + size * strips_mm[strip]
            }
            SpotShape::Gaussian if size >= WHOLE => strips_mm[strip],
            SpotShape::Gaussian => {
                let median = (strip as f64 + 0.5) / strips_mm.len() as f64;
                self.sigma_mm() * normal_quantile(first + median * size)
            }
        }
    }

    /// Standard deviation along an axis, mm.
    pub(crate) fn sigma_mm(&self) -> f64 {
        match self.shape {
            SpotShape::Uniform => self.size_mm / 12.0_f64.sqrt(),
            SpotShape::Gaussian => self.size_mm / FWHM_PER_SIGMA,
        }
    }
}

/// Arguments at which the cumulative normal distribution takes the given, ascending values.
fn gaussian_quantiles(shares: impl Iterator<Item = f64>) -> Vec<f64> {
    const STEP: f64 = 1.0 / 512.0;
    let (mut at, mut sum) = (-6.0, 0.0);
    let mut reached = |share: f64| {
        while sum < share {
            let middle: f64 = at + 0.5 * STEP;
            sum += STEP * (-0.5 * middle * middle).exp() / std::f64::consts::TAU.sqrt();
            at += STEP;
        }
        at
    };
    shares.map(&mut reached).collect()
}

/// Argument at which the cumulative normal distribution takes a value, by bisection.
fn normal_quantile(share: f64) -> f64 {
    let (mut low, mut high) = (-WIDEST, WIDEST);
    for _ in 0..32 {
        let middle = 0.5 * (low + high);
        if normal_share_below(middle) < share {
            low = middle;
        } else {
            high = middle;
        }
    }
    low
}

/// The cumulative normal distribution, to 1e-7: Abramowitz and Stegun, Handbook of Mathematical Functions (1964), 26.2.17.
fn normal_share_below(z: f64) -> f64 {
    let t = 1.0 / (1.0 + 0.231_641_9 * z.abs());
    let series = t
        * (0.319_381_530
            + t * (-0.356_563_782
                + t * (1.781_477_937 + t * (-1.821_255_978 + t * 1.330_274_429))));
    let beyond = (-0.5 * z * z).exp() / std::f64::consts::TAU.sqrt() * series;
    if z < 0.0 { beyond } else { 1.0 - beyond }
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

/// Orientation of the focal spot in the device frame.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct SpotPlane {
    pub axes: [Vector3<f64>; 2],
}

impl SpotPlane {
    /// The plane perpendicular to the central ray; its axes are device x and y, tilted with the ray.
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

    /// Standard deviation of the samples and of the strips: side/√12, FWHM/2.3548.
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
            for count in [2, 4, 16] {
                let strips = spot.strips_mm(count);
                let mean = strips.iter().sum::<f64>() / count as f64;
                let variance = strips.iter().map(|at| at * at).sum::<f64>() / count as f64;
                assert!(mean.abs() < 0.01 * sigma_mm, "{strips:?}");
                assert!((variance / (sigma_mm * sigma_mm) - 1.0).abs() < 1e-12);
            }
        }
    }
}
