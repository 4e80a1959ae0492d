//! Photons of one exposure as they leave the focal spot: sampled one by one, or as the fluence at a point.

use nalgebra::{Point2, Point3, Vector3};
use ppa_core::random::Philox;

use crate::beam::blades::Blades;
use crate::beam::field::Field;
use crate::beam::heel::{Heel, Mixture, lattice_on};
use crate::beam::projection::Projection;
use crate::beam::projection_error::ProjectionError;
use crate::beam::source::{FocalSpot, SpotPlane};
use crate::beam::spectral_lines::SpectralLines;
use crate::beam::spectrum::Spectrum;

/// A photon that leaves the focal spot, in the device frame.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Emission {
    pub origin_mm: Point3<f64>,
    /// Unit vector.
    pub direction: Vector3<f64>,
    pub energy_kev: f64,
}

/// The source of one exposure.
///
/// Every point of the focal spot emits photons into the field, uniformly in solid angle apart from the heel effect.
/// A history is a photon that is emitted into the field.
#[derive(Debug, Clone)]
pub(crate) struct Emitter {
    spectrum: Spectrum,
    spot: FocalSpot,
    plane: SpotPlane,
    blades: Blades,
    /// The field reached by photons from any point of the spot.
    field: Field,
    distance_mm: f64,
    /// Smallest distance from the spot to the detector plane, along z.
    nearest_mm: f64,
    heel: Option<Heel>,
    /// ∫ I dΩ over the field, averaged over the spot: I is 1 on the central ray.
    emitted_sr: f64,
}

/// Points per side of the spot and the field over which the intensity is integrated.
const SPOT_POINTS: usize = 5;
const FIELD_POINTS: u32 = 96;

impl Emitter {
    /// The emitter of the focal spot.
    ///
    /// # Errors
    /// [`ProjectionError`] if heel effect, focal spot or field are invalid.
    pub fn new(projection: &Projection, spectrum: &Spectrum) -> Result<Self, ProjectionError> {
        projection.validate()?;
        Self::of_spot(projection, spectrum, projection.source.focal_spot)
    }

    /// An emitter with another area than the focal spot; the projection must be valid.
    ///
    /// # Errors
    /// [`ProjectionError`] if the heel effect is invalid.
    pub fn of_spot(
        projection: &Projection,
        spectrum: &Spectrum,
        spot: FocalSpot,
    ) -> Result<Self, ProjectionError> {
        let plane = SpotPlane::square_to(&projection.central_ray);
        let distance_mm = projection.source_detector_mm;
        let blades = Blades::new(
            projection.field(),
            distance_mm,
            projection.source.blades_mm,
            [plane.axes[0].x, plane.axes[1].y],
        );
        let field = blades.reached(&spot);
        let tilt: f64 = plane.axes.iter().map(|axis| axis.z.abs()).sum();
        // The largest area is a tenth of the distance, which reduces the distance by less than a tenth.
        let nearest_mm = distance_mm - spot.reach_mm() * tilt;
        let spots = points_of(&spot, &plane, SPOT_POINTS);
        let heel = match &projection.source.heel_effect {
            None => None,
            Some(heel) => {
                let targets = lattice_on(field.low_mm, field.high_mm, distance_mm);
                let ray = &projection.central_ray;
                Some(Heel::new(heel, spectrum, ray, &spots, &targets)?)
            }
        };
        let mut emitter = Self {
            spectrum: spectrum.clone(),
            spot,
            plane,
            blades,
            field,
            distance_mm,
            nearest_mm,
            heel,
            emitted_sr: 1.0,
        };
        let sent_sr = spots.iter().map(|spot| emitter.emitted_from_sr(spot));
        emitter.emitted_sr = sent_sr.sum::<f64>() / spots.len() as f64;
        Ok(emitter)
    }

    /// ∫ I dΩ over the field, averaged over the spot: I is 1 on the central ray.
    pub fn emitted_sr(&self) -> f64 {
        self.emitted_sr
    }

    /// ∫ I dΩ over the field for photons from one point of the spot.
    fn emitted_from_sr(&self, spot: &Point3<f64>) -> f64 {
        let height_mm = self.distance_mm - spot.z;
        let field = self.blades.field_from(spot);
        if self.heel.is_none() {
            return field.solid_angle_sr(spot.xy(), height_mm);
        }
        let size = field.size_mm();
        let share = |i: u32| (f64::from(i) + 0.5) / f64::from(FIELD_POINTS);
        let cell_mm2 = size[0] * size[1] / f64::from(FIELD_POINTS * FIELD_POINTS);
        (0..FIELD_POINTS * FIELD_POINTS)
            .map(|n| {
                let x = field.low_mm[0] + size[0] * share(n % FIELD_POINTS);
                let y = field.low_mm[1] + size[1] * share(n / FIELD_POINTS);
                self.intensity_per_mm2(spot, Point2::new(x, y)) * cell_mm2
            })
            .sum()
    }

    /// I dΩ/dA at a point of the detector plane.
    fn intensity_per_mm2(&self, spot: &Point3<f64>, at: Point2<f64>) -> f64 {
        let ray = Point3::new(at.x, at.y, self.distance_mm) - spot;
        let length_mm = ray.norm();
        let intensity = match &self.heel {
            None => 1.0,
            Some(heel) => heel.mixture(&(ray / length_mm)).intensity,
        };
        intensity * ray.z / length_mm.powi(3)
    }

    /// Samples a photon, with a variable number of random numbers.
    #[inline]
    pub fn emit(&self, rng: &mut Philox) -> Emission {
        let d = self.distance_mm;
        let size = self.field.size_mm();
        loop {
            // Points uniform over the field are kept with probability ∝ I cos³θ / height², which leaves I dΩ.
            let spot = self.spot.sample(rng);
            let x = self.field.low_mm[0] + size[0] * rng.unit();
            let y = self.field.low_mm[1] + size[1] * rng.unit();
            let (origin_mm, ray, nearness) = if self.spot.is_point() {
                (Point3::origin(), Vector3::new(x, y, d), 1.0)
            } else {
                let origin_mm = self.plane.at(spot);
                if !self.lights(&origin_mm, Point2::new(x, y)) {
                    continue;
                }
                let ray = Point3::new(x, y, d) - origin_mm;
                (origin_mm, ray, (self.nearest_mm / ray.z).powi(2))
            };
            let length_mm = ray.norm();
            let cos = ray.z / length_mm;
            let direction = ray / length_mm;
            let mixture = self.mixture(&direction);
            let brightness = match &self.heel {
                None => 1.0,
                Some(heel) => mixture.intensity / heel.largest,
            };
            if rng.unit() < cos * cos * cos * nearness * brightness {
                let energy_kev = match &self.heel {
                    None => self.spectrum.sample(rng.unit()),
                    Some(heel) => {
                        let upper = usize::from(rng.unit() < mixture.upper_share);
                        heel.spectra[mixture.lower + upper].sample(rng.unit())
                    }
                };
                return Emission {
                    origin_mm,
                    direction,
                    energy_kev,
                };
            }
        }
    }

    /// The spectrum of a plain beam, whose photons all leave the origin uniformly in solid angle.
    pub fn plain_beam(&self) -> Option<&Spectrum> {
        (self.spot.is_point() && self.heel.is_none()).then_some(&self.spectrum)
    }

    /// Field of the beam in the detector plane, penumbra included; no photon is emitted outside it.
    pub fn field(&self) -> &Field {
        &self.field
    }

    /// The field illuminated by the entire focal spot.
    pub fn fully_lit(&self) -> Field {
        self.blades.fully_lit(&self.spot)
    }

    /// Whether the blades let photons from a point of the focal spot through to a point of the detector plane.
    #[inline]
    pub fn lights(&self, spot: &Point3<f64>, at: Point2<f64>) -> bool {
        self.blades.field_from(spot).contains(&at)
    }

    /// Share of a cell of the focal spot, of `count` strips along each axis as in [`FocalSpot::strips_mm`], that the blades let through.
    pub fn lit_share(&self, strips: [usize; 2], count: usize, at: Point2<f64>) -> f64 {
        self.blades.lit_share(&self.spot, strips, count, at)
    }

    /// The part of the focal spot that lights a point, see [`Blades::lit_part`].
    pub fn lit_part(&self, at: Point2<f64>) -> [[f64; 2]; 2] {
        self.blades.lit_part(&self.spot, at)
    }

    /// The focal spot.
    pub fn spot(&self) -> &FocalSpot {
        &self.spot
    }

    /// A point of the focal spot's plane, device frame, by its offsets in mm.
    #[inline]
    pub fn spot_at(&self, offsets_mm: [f64; 2]) -> Point3<f64> {
        self.plane.at(offsets_mm)
    }

    /// `per_side`² points of the focal spot, device frame, with equal intensity; a single one for a point source.
    pub fn spot_points(&self, per_side: usize) -> Vec<Point3<f64>> {
        points_of(&self.spot, &self.plane, per_side)
    }

    /// Samples a point of the focal spot by its intensity; a point source uses no random numbers.
    #[inline]
    pub fn draw_spot(&self, rng: &mut Philox) -> Point3<f64> {
        self.plane.at(self.spot.sample(rng))
    }

    /// Photons per cm² and history at device (x, y) of the bare detector plane if all left from `spot`,
    /// where [`Emitter::lights`] is true; [`Emitter::mixture`] gives their spectra.
    pub fn open_fluence_cm2(&self, spot: &Point3<f64>, at: Point2<f64>) -> f64 {
        100.0 * self.intensity_per_mm2(spot, at) / self.emitted_sr
    }

    /// The spectra of the photons: one, or several with heel effect.
    pub fn spectra(&self) -> &[Spectrum] {
        match &self.heel {
            None => std::slice::from_ref(&self.spectrum),
            Some(heel) => &heel.spectra,
        }
    }

    /// [`Emitter::spectra`] as lines.
    pub fn lines(&self) -> SpectralLines {
        SpectralLines::of(self.spectra())
    }

    /// The two [`Emitter::spectra`] of photons in a direction (unit vector): `lower`, and `lower + 1` for
    /// `upper_share` of them.
    #[inline]
    pub fn mixture(&self, direction: &Vector3<f64>) -> Mixture {
        match &self.heel {
            None => Mixture {
                lower: 0,
                upper_share: 0.0,
                intensity: 1.0,
            },
            Some(heel) => heel.mixture(direction),
        }
    }

    /// Photons that the spot emits into the field per mAs, if the spectrum came from the tube model.
    pub fn photons_per_mas(&self) -> Option<f64> {
        const CM2_PER_SR_AT_1M: f64 = 1e4;
        let fluence = self.spectrum.fluence_per_mas_cm2_at_1m()?;
        Some(fluence * CM2_PER_SR_AT_1M * self.emitted_sr)
    }
}

fn points_of(spot: &FocalSpot, plane: &SpotPlane, per_side: usize) -> Vec<Point3<f64>> {
    let strips = spot.strips_mm(if spot.is_point() { 1 } else { per_side });
    let row = |&y: &f64| strips.iter().map(move |&x| plane.at([x, y]));
    strips.iter().flat_map(row).collect()
}

#[cfg(test)]
mod tests {
    use nalgebra::Isometry3;

    use super::*;
    use crate::beam::detector::Detector;
    use crate::beam::source::{Collimation, Source};
    use crate::beam::tube::TubeSpec;
    use crate::scenes::demanding_source;

    const DISTANCE_MM: f64 = 1_000.0;

    fn spectrum() -> Spectrum {
        let filters = vec!["Al:2.5".parse().unwrap()];
        Spectrum::tungsten(&TubeSpec {
            kvp: 70.0,
            anode_angle_deg: 14.0,
            filters,
        })
        .unwrap()
    }

    fn projection(source: Source) -> Projection {
        let detector = Detector::centred(10, 10, 40.0);
        Projection {
            source,
            ..Projection::new(Isometry3::identity(), DISTANCE_MM, detector)
        }
    }

    fn demanding() -> Projection {
        let mut turned = projection(demanding_source()).with_detector_turned(0.2, -0.3);
        let [x, y] = turned.detector.centre_mm;
        turned.source.collimation = Collimation::Rectangle {
            size_mm: [300.0, 500.0],
            centre_mm: [x + 60.0, y - 20.0],
        };
        turned
    }

    /// The positions of sampled photons follow the fluence: chi² over 6 x 6 cells of the field, 35 degrees
    /// of freedom, for a plain and for a demanding source, and for an area of 80 mm.
    #[test]
    fn photons_fall_as_the_fluence_says() {
        let area = FocalSpot {
            size_mm: 80.0,
            ..FocalSpot::default()
        };
        let emitters = [
            Emitter::new(&projection(Source::default()), &spectrum()),
            Emitter::new(&demanding(), &spectrum()),
            Emitter::of_spot(&demanding(), &spectrum(), area),
        ];
        for emitter in emitters {
            let emitter = emitter.unwrap();
            let (field, draws) = (*emitter.field(), 60_000_u32);
            let size = field.size_mm();
            let mut found = [0.0_f64; 36];
            for i in 0..draws {
                let photon = emitter.emit(&mut Philox::new(1, 0, u64::from(i)));
                let length = (emitter.distance_mm - photon.origin_mm.z) / photon.direction.z;
                let at = photon.origin_mm + photon.direction * length;
                let cell = [0, 1].map(|axis| {
                    let share = (at[axis] - field.low_mm[axis]) / size[axis];
                    assert!((-1e-9..1.0 + 1e-9).contains(&share), "outside the field");
                    ((6.0 * share) as usize).min(5)
                });
                found[cell[0] + 6 * cell[1]] += 1.0;
            }
            let spots = emitter.spot_points(6);
            let mut expected = [0.0_f64; 36];
            let fine = 48;
            for n in 0..fine * fine {
                let share = [n % fine, n / fine].map(|i| (i as f64 + 0.5) / fine as f64);
                let at = Point2::from([0, 1].map(|a| field.low_mm[a] + share[a] * size[a]));
                let cm2 = size[0] * size[1] / 100.0 / (fine * fine) as f64;
                for (index, spot) in spots.iter().enumerate() {
                    let lit = emitter.lit_share([index % 6, index / 6], 6, at);
                    expected[6 * n / fine % 6 + 6 * (6 * (n / fine) / fine)] +=
                        cm2 * lit * emitter.open_fluence_cm2(spot, at) / spots.len() as f64;
                }
            }
            let sum: f64 = expected.iter().sum();
            assert!(
                (sum - 1.0).abs() < 1e-3,
                "one photon per history, got {sum}"
            );
            let chi2: f64 = found
                .iter()
                .zip(expected)
                .map(|(found, p)| {
                    let expected = p * f64::from(draws);
                    (found - expected).powi(2) / expected
                })
                .sum();
            assert!(chi2 < 77.0, "chi² = {chi2:.1} with 35 degrees of freedom"); // 5e-5
        }
    }

    /// Energies sampled towards the anode and away from it have the mean of the mixture in that direction.
    #[test]
    fn energies_are_those_of_the_take_off_angle() {
        let emitter = Emitter::new(&demanding(), &spectrum()).unwrap();
        let lines = emitter.lines();
        let (mut difference, mut variance) = ([0.0_f64; 2], [0.0_f64; 2]);
        for i in 0..20_000 {
            let photon = emitter.emit(&mut Philox::new(2, 0, i));
            let mixture = emitter.mixture(&photon.direction);
            let mean = |power| -> f64 {
                let lines = lines.energy_kev.iter().zip(lines.mixed(mixture));
                lines.map(|(e, photons)| photons * e.powi(power)).sum()
            };
            let side = usize::from(mixture.intensity > 1.0);
            difference[side] += photon.energy_kev - mean(1);
            variance[side] += mean(2) - mean(1).powi(2);
        }
        for side in 0..2 {
            let z = difference[side] / variance[side].sqrt();
            assert!(z.abs() < 4.0, "side {side}: {z:.1} sigma"); // 1.3e-4 for both
        }
        let softest = emitter.spectra().last().unwrap().mean_energy_kev();
        let hardest = emitter.spectra()[0].mean_energy_kev();
        assert!(hardest > softest + 0.3, "{hardest} and {softest} keV");
    }
}
