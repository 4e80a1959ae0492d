//! Conversion of photons at the detector plane to energy in the detector.

use nalgebra::Vector3;
use ppa_core::random::Philox;

use crate::beam::receptor::{Receptor, ReceptorError};
use crate::detector::absorption::Absorption;
use crate::detector::grid::Grid;
use crate::transport::score::Arrival;
use crate::transport::tally::Moments;

/// An image receptor prepared for photons.
///
/// The signal of a pixel is the sum of the energies of many photons, so only the mean and mean square per photon
/// matter. Both engines use those computed here.
#[derive(Debug, Clone)]
pub(crate) struct Response {
    absorption: Option<Absorption>,
    grid: Option<Grid>,
}

impl Response {
    /// Prepares the receptor for a detector whose centre is at device (x, y).
    ///
    /// # Errors
    /// [`ReceptorError`] naming the invalid number or material.
    pub fn new(receptor: &Receptor, centre_mm: [f64; 2]) -> Result<Self, ReceptorError> {
        let grid = receptor.grid.as_ref();
        Ok(Self {
            absorption: Absorption::of(receptor)?,
            grid: grid.map(|grid| Grid::new(grid, centre_mm)).transpose()?,
        })
    }

    /// Whether every photon deposits its full energy.
    pub fn is_ideal(&self) -> bool {
        self.absorption.is_none() && self.grid.is_none()
    }

    /// The converter; `None` for the ideal detector.
    pub fn absorption(&self) -> Option<&Absorption> {
        self.absorption.as_ref()
    }

    pub fn grid(&self) -> Option<&Grid> {
        self.grid.as_ref()
    }

    /// Energies at which the deposited energy changes abruptly.
    pub fn edges_kev(&self) -> impl Iterator<Item = f64> {
        let absorption = self.absorption.iter().flat_map(Absorption::edges_kev);
        absorption
            .chain(self.grid.iter().flat_map(Grid::edges_kev))
            .copied()
    }

    /// Mean and mean square of the energy that a photon deposits when it crosses the plane at device (x, y), averaged over the phase of
    /// the strips if there is a grid.
    ///
    /// `direction` is a unit vector in the device frame with z > 0.
    #[inline]
    pub fn moments(&self, energy_kev: f64, at_mm: [f64; 2], direction: &Vector3<f64>) -> Moments {
        let passes = self.passes(energy_kev, at_mm, direction);
        self.absorbed(energy_kev, direction.z).scaled(passes)
    }

    /// Samples the energy that an arriving photon deposits, keV. The first two moments of the sample are [`Response::moments`], or, with a
    /// stationary grid, those at its position.
    ///
    /// The sample is ⟨ε²⟩/⟨ε⟩ with probability ⟨ε⟩²/⟨ε²⟩ (absorption times Swank factor), and 0 otherwise.
    #[inline]
    pub fn detect(&self, arrival: &Arrival, rng: &mut Philox) -> f64 {
        if self.is_ideal() {
            return arrival.energy_kev;
        }
        let at_mm = [arrival.x_mm, arrival.y_mm];
        let left = match &self.grid {
            Some(grid) if !grid.is_moving() => {
                let attenuation = grid.attenuation(arrival.energy_kev);
                let passes = grid.transmission_in_place(at_mm, &arrival.direction, attenuation);
                let left = self.absorbed(arrival.energy_kev, arrival.direction.z);
                left.scaled(passes)
            }
            _ => self.moments(arrival.energy_kev, at_mm, &arrival.direction),
        };
        let counts = left.mean_kev * left.mean_kev / left.square_kev2;
        if rng.unit() < counts {
            left.square_kev2 / left.mean_kev
        } else {
            0.0
        }
    }

    /// Probability of passing the grid.
    #[inline]
    fn passes(&self, energy_kev: f64, at_mm: [f64; 2], direction: &Vector3<f64>) -> f64 {
        match &self.grid {
            None => 1.0,
            Some(grid) => {
                let attenuation = grid.attenuation(energy_kev);
                grid.crossing(at_mm, direction).transmission(attenuation)
            }
        }
    }

    #[inline]
    fn absorbed(&self, energy_kev: f64, cos: f64) -> Moments {
        match &self.absorption {
            None => Moments {
                mean_kev: energy_kev,
                square_kev2: energy_kev * energy_kev,
            },
            Some(absorption) => absorption.moments(energy_kev, cos),
        }
    }
}

/// [`Response::moments`] at a fixed set of energies, for sums over a spectrum along many rays.
#[derive(Debug, Clone)]
pub(crate) struct LineResponse<'a> {
    grid: Option<&'a Grid>,
    energy_kev: Vec<f64>,
    /// Moments deposited by a photon of every line, by cosine.
    absorbed: Option<Vec<Vec<Moments>>>,
    /// Attenuation of strip and interspace of the grid at every line, 1/mm.
    attenuation: Vec<[f64; 2]>,
}

impl Response {
    pub fn at_lines(&self, energy_kev: &[f64]) -> LineResponse<'_> {
        let absorbed = self.absorption.as_ref().map(|absorption| {
            Absorption::cosines()
                .map(|cos| {
                    let moments = energy_kev.iter().map(|&e| absorption.moments(e, cos));
                    moments.collect()
                })
                .collect()
        });
        let attenuation = match &self.grid {
            None => Vec::new(),
            Some(grid) => energy_kev.iter().map(|&e| grid.attenuation(e)).collect(),
        };
        LineResponse {
            grid: self.grid.as_ref(),
            energy_kev: energy_kev.to_vec(),
            absorbed,
            attenuation,
        }
    }
}

impl LineResponse<'_> {
    /// [`Response::moments`] of every line.
    #[inline]
    pub fn moments(
        &self,
        at_mm: [f64; 2],
        direction: &Vector3<f64>,
    ) -> impl Iterator<Item = Moments> {
        let crossing = self.grid.map(|grid| grid.crossing(at_mm, direction));
        let (column, s) = Absorption::column(direction.z);
        self.energy_kev
            .iter()
            .enumerate()
            .map(move |(line, &energy_kev)| {
                let left = match &self.absorbed {
                    None => Moments {
                        mean_kev: energy_kev,
                        square_kev2: energy_kev * energy_kev,
                    },
                    Some(absorbed) => {
                        let [near, far] = [column, column + 1].map(|column| absorbed[column][line]);
                        [near.scaled(1.0 - s), far.scaled(s)].into_iter().sum()
                    }
                };
                left.scaled(crossing.map_or(1.0, |crossing| {
                    crossing.transmission(self.attenuation[line])
                }))
            })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::beam::receptor::{AntiScatterGrid, DetectorModel, LinesAlong};
    use crate::transport::tally::Category;

    fn receptor() -> Receptor {
        Receptor {
            model: DetectorModel::Csi {
                thickness_um: 500.0,
                packing: 0.8,
            },
            grid: Some(AntiScatterGrid {
                ratio: 8.0,
                lines_per_cm: 36.0,
                strip_mm: 0.06,
                strip: "lead".to_owned(),
                interspace: "polyethylene".to_owned(),
                focus_mm: Some(1_000.0),
                lines_along: LinesAlong::X,
                moving: true,
            }),
            ..Receptor::default()
        }
    }

    fn arrivals() -> impl Iterator<Item = Arrival> {
        [
            (35.0, 0.02, 0.98),
            (60.0, 0.1, 0.7),
            (60.0, 0.0, 1.0),
            (110.0, 0.3, 0.5),
        ]
        .into_iter()
        .map(|(energy_kev, slope, z)| Arrival {
            x_mm: 20.0,
            y_mm: 15.0,
            direction: Vector3::new(0.3, slope, z).normalize(),
            energy_kev,
            category: Category::Compton,
        })
    }

    /// Samples of an arrival have the moments of the table, and so have lines.
    #[test]
    fn draws_and_lines_have_the_moments_of_the_table() {
        let response = Response::new(&receptor(), [0.0; 2]).unwrap();
        for arrival in arrivals() {
            let at_mm = [arrival.x_mm, arrival.y_mm];
            let expected = response.moments(arrival.energy_kev, at_mm, &arrival.direction);
            let draws = 40_000_u32;
            let (mut sum, mut square) = (0.0, 0.0);
            let mut largest = 0.0_f64;
            for i in 0..draws {
                let mut rng = Philox::new(6, 0, u64::from(i));
                let left = response.detect(&arrival, &mut rng);
                largest = largest.max(left);
                sum += left;
                square += left * left;
            }
            let n = f64::from(draws);
            // Samples are 0 or one value, so both moments have the relative error of their count.
            let error = ((1.0 / (n * sum / n / largest)) - 1.0 / n).sqrt();
            let z = [
                (sum / n / expected.mean_kev - 1.0) / error,
                (square / n / expected.square_kev2 - 1.0) / error,
            ];
            assert!(z.iter().all(|z| z.abs() < 4.0), "{z:.1?} sigma"); // 1.3e-4 per arrival
            let lines = response.at_lines(&[20.0, arrival.energy_kev]);
            let line = lines.moments(at_mm, &arrival.direction).nth(1).unwrap();
            assert!((line.mean_kev / expected.mean_kev - 1.0).abs() < 1e-9);
            assert!((line.square_kev2 / expected.square_kev2 - 1.0).abs() < 1e-9);
        }
    }

    #[test]
    fn the_ideal_detector_takes_everything_and_draws_nothing() {
        let response = Response::new(&Receptor::default(), [0.0; 2]).unwrap();
        for arrival in arrivals() {
            let mut rng = Philox::new(6, 0, 0);
            assert_eq!(response.detect(&arrival, &mut rng), arrival.energy_kev);
            assert_eq!(rng.unit(), Philox::new(6, 0, 0).unit());
        }
    }
}
