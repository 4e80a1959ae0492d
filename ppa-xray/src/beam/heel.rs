//! Anode heel effect: spectra by the angle at which photons leave the anode.

use nalgebra::{Point2, Point3, Unit, Vector3};

use crate::beam::projection_error::ProjectionError;
use crate::beam::source::{HeelEffect, SpotPlane};
use crate::beam::spectrum::Spectrum;
use crate::beam::tube::{TubeSpec, anode_angles_deg};

/// Largest step between the take-off angles of the stored spectra, degrees.
const STEP_DEG: f64 = 0.5;

/// Points per side of the field at which take-off angles are evaluated.
const LOOK: u32 = 33;

/// Spectra of one tube by take-off angle; photons between two of them are mixed in proportion.
///
/// The angle between a photon and the face of the anode is the anode angle of the tube model; it determines the path
/// length in tungsten, and decreases towards the anode. Outside the model's range of 1° to 30° the
/// last spectrum is used.
#[derive(Debug, Clone)]
pub(crate) struct Heel {
    /// Outward normal of the anode's face in the device frame.
    normal: Vector3<f64>,
    /// Take-off angles of the spectra, radians, evenly spaced.
    first: f64,
    step: f64,
    pub spectra: Vec<Spectrum>,
    /// Photons per solid angle of each spectrum relative to those of the central ray.
    intensity: Vec<f64>,
    pub largest: f64,
}

/// Spectra and intensity for a direction.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Mixture {
    /// The lower of the two spectra.
    pub lower: usize,
    /// Share of the photons from the upper one.
    pub upper_share: f64,
    /// Photons per solid angle relative to those of the central ray.
    pub intensity: f64,
}

impl Heel {
    /// Spectra for all directions from `spots` to `targets`.
    pub fn new(
        heel: &HeelEffect,
        spectrum: &Spectrum,
        central_ray: &Unit<Vector3<f64>>,
        spots: &[Point3<f64>],
        targets: &[Point3<f64>],
    ) -> Result<Self, ProjectionError> {
        if !heel.anode_towards_deg.is_finite() {
            return Err(ProjectionError::Anode {
                found_deg: heel.anode_towards_deg,
            });
        }
        let tube = spectrum.tube().ok_or(ProjectionError::HeelWithoutTube)?;
        let (sin, cos) = heel.anode_towards_deg.to_radians().sin_cos();
        let plane = SpotPlane::square_to(central_ray);
        let anode = plane.axes[0] * cos + plane.axes[1] * sin;
        let (sin, cos) = tube.anode_angle_deg.to_radians().sin_cos();
        let normal = central_ray.into_inner() * sin - anode * cos;
        let [model_low, model_high] = anode_angles_deg().map(f64::to_radians);
        let (mut low, mut high) = (f64::INFINITY, f64::NEG_INFINITY);
        for spot in spots {
            for target in targets {
                let angle = normal.dot(&(target - spot).normalize()).asin();
                low = low.min(angle.clamp(model_low, model_high));
                high = high.max(angle.clamp(model_low, model_high));
            }
        }
        let steps = ((high - low).to_degrees() / STEP_DEG).ceil().max(1.0);
        let step = (high - low) / steps;
        let at_angle = |angle: f64| {
            // Rounding must not take the angle outside the model.
            let [lowest, highest] = anode_angles_deg();
            let anode_angle_deg = angle.to_degrees().clamp(lowest, highest);
            Spectrum::tungsten(&TubeSpec {
                anode_angle_deg,
                ..tube.clone()
            })
            .map_err(|error| ProjectionError::Heel {
                anode_angle_deg,
                message: error.to_string(),
            })
        };
        let spectra = (0..=steps as usize)
            .map(|node| at_angle(low + step * node as f64))
            .collect::<Result<Vec<_>, _>>()?;
        let fluence = |of: &Spectrum| of.fluence_per_mas_cm2_at_1m().unwrap_or(0.0);
        let central = fluence(spectrum);
        let intensity: Vec<f64> = spectra.iter().map(|of| fluence(of) / central).collect();
        Ok(Self {
            normal,
            first: low,
            step,
            largest: intensity.iter().copied().fold(0.0, f64::max),
            spectra,
            intensity,
        })
    }

    /// Spectra and intensity for a direction (unit vector, device frame).
    #[inline]
    pub fn mixture(&self, direction: &Vector3<f64>) -> Mixture {
        let angle = self.normal.dot(direction).asin();
        let at = if self.step > 0.0 {
            ((angle - self.first) / self.step).clamp(0.0, (self.spectra.len() - 1) as f64)
        } else {
            0.0
        };
        let lower = (at as usize).min(self.spectra.len() - 2);
        let t = at - lower as f64;
        let upper = t * self.intensity[lower + 1];
        let intensity = (1.0 - t) * self.intensity[lower] + upper;
        Mixture {
            lower,
            upper_share: upper / intensity,
            intensity,
        }
    }
}

/// Points on a lattice over a rectangle of the plane at `distance_mm`, edges included.
pub(crate) fn lattice_on(low: [f64; 2], high: [f64; 2], distance_mm: f64) -> Vec<Point3<f64>> {
    let along = |axis: usize, i: u32| {
        low[axis] + (high[axis] - low[axis]) * f64::from(i) / f64::from(LOOK - 1)
    };
    (0..LOOK * LOOK)
        .map(|n| Point2::new(along(0, n % LOOK), along(1, n / LOOK)))
        .map(|at| Point3::new(at.x, at.y, distance_mm))
        .collect()
}

#[cfg(test)]
mod tests {
    use nalgebra::Isometry3;

    use super::*;
    use crate::beam::detector::Detector;
    use crate::beam::emitter::Emitter;
    use crate::beam::projection::Projection;
    use crate::beam::source::Source;

    /// 70 kV, 14° anode, 2.5 mm Al: photons per solid angle and mean energy off the central ray relative to those on it,
    /// against SpekPy 2.5.4 off its axis, `Spek(kvp=70, th=14, x=x, z=100).filter("Al", 2.5)`, times its squared
    /// distance. SpekPy's beam passes the filter obliquely, which reduces it by up to 0.9 % at 17.6 cm; ours does not.
    #[test]
    fn heel_effect_agrees_with_spekpy_off_the_axis() {
        let source = Source {
            heel_effect: Some(HeelEffect {
                anode_towards_deg: 180.0,
            }),
            ..Source::default()
        };
        let spectrum = Spectrum::tungsten(&TubeSpec {
            kvp: 70.0,
            anode_angle_deg: 14.0,
            filters: vec!["Al:2.5".parse().unwrap()],
        });
        let projection = Projection {
            source,
            ..Projection::new(
                Isometry3::identity(),
                1_000.0,
                Detector::centred(10, 10, 40.0),
            )
        };
        let emitter = Emitter::new(&projection, &spectrum.unwrap()).unwrap();
        for (x_cm, intensity, mean_kev) in [
            (-17.6, 0.799_61, 41.370),
            (-10.5, 0.932_30, 40.017),
            (-7.0, 0.964_17, 39.665),
            (-3.5, 0.985_59, 39.405),
            (3.5, 1.009_37, 39.055),
            (7.0, 1.014_92, 38.935),
            (10.5, 1.017_48, 38.842),
            (17.6, 1.015_70, 38.716),
        ] {
            let mixture = emitter.mixture(&Vector3::new(x_cm, 0.0, 100.0).normalize());
            let [lower, upper] =
                [0, 1].map(|i| emitter.spectra()[mixture.lower + i].mean_energy_kev());
            let mean = lower + mixture.upper_share * (upper - lower);
            let ratio = mixture.intensity / intensity;
            assert!((ratio - 1.0).abs() < 0.012, "{x_cm} cm: {ratio}");
            assert!(
                (mean / mean_kev - 1.0).abs() < 0.004,
                "{x_cm} cm: {mean} keV"
            );
        }
    }
}
