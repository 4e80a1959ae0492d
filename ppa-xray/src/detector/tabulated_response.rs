//! [`Response`] in `f32`, tabulated at equal energy steps, for the many sums of the fast engine.
//!
//! An absorption edge is smeared over 1/32 keV, except at the lines, which have nodes of their own.

use nalgebra::Vector3;

use crate::detector::absorption::Absorption;
use crate::detector::grid::{Crossing, Grid};
use crate::detector::response::Response;
use crate::matter::energy_range::{CUTOFF_KEV, MAX_ENERGY_KEV};
use crate::transport::tally::Moments;
use crate::vector_math::{WIDTH, pad};

/// Nodes per keV.
const NODES_PER_KEV: f32 = 32.0;

/// Energy deposited by photons of a set of energies: nodes evenly spaced above the cut-off, or the lines of a quadrature.
#[derive(Debug)]
struct Table {
    /// Mean energy and mean squared energy of a photon that reaches the converter, by node, for every cosine of
    /// [`Absorption::cosines`]; a single entry if they do not depend on the cosine.
    left: Vec<[Vec<f32>; 2]>,
    /// Attenuation of strips and interspace, 1/mm, by node; zero without a grid.
    attenuation: [Vec<f32>; 2],
}

/// Values of [`WIDTH`] photons.
type Lanes = [f32; WIDTH];

impl Table {
    fn new(response: &Response, energies_kev: &[f64]) -> Self {
        let padded = |of: &dyn Fn(f64) -> f64| {
            let mut values: Vec<f32> = energies_kev.iter().map(|&kev| of(kev) as f32).collect();
            pad(&mut values);
            values
        };
        let left = match response.absorption() {
            None => vec![[padded(&|kev| kev), padded(&|kev| kev * kev)]],
            Some(absorption) => Absorption::cosines()
                .map(|cos| {
                    [
                        padded(&|kev| absorption.moments(kev, cos).mean_kev),
                        padded(&|kev| absorption.moments(kev, cos).square_kev2),
                    ]
                })
                .collect(),
        };
        let part = |part: usize| {
            padded(&|kev| {
                response
                    .grid()
                    .map_or(0.0, |grid| grid.attenuation(kev)[part])
            })
        };
        Self {
            left,
            attenuation: [part(0), part(1)],
        }
    }

    /// The two cosines next to a cosine, and its position between them.
    fn columns(&self, cos: f64) -> ([&[Vec<f32>; 2]; 2], f32) {
        if let [only] = &self.left[..] {
            return ([only, only], 0.0);
        }
        let (column, s) = Absorption::column(cos);
        ([&self.left[column], &self.left[column + 1]], s as f32)
    }
}

/// A receptor, prepared for photons of the lines and of any other energy.
#[derive(Debug)]
pub(crate) struct TabulatedResponse<'a> {
    grid: Option<&'a Grid>,
    lines: Table,
    even: Table,
}

/// [`TabulatedResponse`] for photons of one direction.
pub(crate) struct Incidence<'a> {
    crossing: Option<Crossing>,
    response: &'a TabulatedResponse<'a>,
    cos: f64,
}

/// Table values for one photon.
#[derive(Default)]
struct Photon {
    attenuation: [f32; 2],
    left: [f32; 2],
}

impl<'a> TabulatedResponse<'a> {
    pub fn new(response: &'a Response, lines_kev: &[f64]) -> Self {
        let per_kev = f64::from(NODES_PER_KEV);
        let nodes = ((MAX_ENERGY_KEV - CUTOFF_KEV) * per_kev).ceil() as usize + 1;
        let even: Vec<f64> = (0..nodes)
            .map(|node| (CUTOFF_KEV + node as f64 / per_kev).min(MAX_ENERGY_KEV))
            .collect();
        Self {
            grid: response.grid(),
            lines: Table::new(response, lines_kev),
            even: Table::new(response, &even),
        }
    }

    /// Photons that cross the plane at device (x, y); `direction` is a unit vector in the device frame with z > 0.
    pub fn incidence(&self, at_mm: [f64; 2], direction: &Vector3<f64>) -> Incidence<'_> {
        Incidence {
            crossing: self.grid.map(|grid| grid.crossing(at_mm, direction)),
            response: self,
            cos: direction.z,
        }
    }
}

impl Incidence<'_> {
    /// Mean and mean square of the energy that photons deposit together; `photons` by line, padded.
    pub fn of_lines(&self, photons: &[f32]) -> Moments {
        let table = &self.response.lines;
        let ([near, far], s) = table.columns(self.cos);
        let [strip, space] = &table.attenuation;
        self.sum(photons, |chunk| {
            let lanes =
                |of: &[f32]| -> Lanes { std::array::from_fn(|lane| of[chunk * WIDTH + lane]) };
            let left = [0, 1].map(|moment| {
                let (near, far) = (lanes(&near[moment]), lanes(&far[moment]));
                std::array::from_fn(|lane| near[lane] + s * (far[lane] - near[lane]))
            });
            ([lanes(strip), lanes(space)], left)
        })
    }

    /// The same as [`Incidence::of_lines`] for photons of given energies; those below the cut-off deposit nothing.
    pub fn of_energies(&self, energies_kev: &[f32], photons: &[f32]) -> Moments {
        self.sum(photons, |chunk| {
            let (mut attenuation, mut left) = ([[0.0; WIDTH]; 2], [[0.0; WIDTH]; 2]);
            for lane in 0..WIDTH {
                let photon = self.photon(energies_kev[chunk * WIDTH + lane]);
                for part in 0..2 {
                    attenuation[part][lane] = photon.attenuation[part];
                    left[part][lane] = photon.left[part];
                }
            }
            (attenuation, left)
        })
    }

    /// Moments of the energy deposited by one photon.
    pub fn of_energy(&self, energy_kev: f64) -> Moments {
        let Photon {
            attenuation: [strip, space],
            left,
        } = self.photon(energy_kev as f32);
        let crossing = self.crossing.as_ref();
        let passes = crossing.map_or(1.0, |crossing| crossing.transmission_f32(strip, space));
        let [mean_kev, square_kev2] = left.map(|left| f64::from(passes * left));
        Moments {
            mean_kev,
            square_kev2,
        }
    }

    #[inline(always)]
    fn photon(&self, energy_kev: f32) -> Photon {
        let at = (energy_kev - CUTOFF_KEV as f32) * NODES_PER_KEV;
        if at < 0.0 {
            return Photon::default();
        }
        let table = &self.response.even;
        let [strip, space] = &table.attenuation;
        let node = (at as usize).min(strip.len() - 2);
        let t = at - node as f32;
        let between = |of: &[f32]| of[node] + t * (of[node + 1] - of[node]);
        let ([near, far], s) = table.columns(self.cos);
        Photon {
            attenuation: [between(strip), between(space)],
            left: [0, 1].map(|moment| {
                let (near, far) = (between(&near[moment]), between(&far[moment]));
                near + s * (far - near)
            }),
        }
    }

    /// Sums photons times the grid's transmission times the deposited energy, in fixed order; `of` returns attenuation and
    /// moments of [`WIDTH`] photons.
    #[inline(always)]
    fn sum(&self, photons: &[f32], of: impl Fn(usize) -> ([Lanes; 2], [Lanes; 2])) -> Moments {
        let mut sums = [[0.0_f32; WIDTH]; 2];
        for (chunk, photons) in photons.chunks_exact(WIDTH).enumerate() {
            let ([strip, space], left) = of(chunk);
            let passing: Lanes = match &self.crossing {
                None => std::array::from_fn(|lane| photons[lane]),
                Some(crossing) => std::array::from_fn(|lane| {
                    photons[lane] * crossing.transmission_f32(strip[lane], space[lane])
                }),
            };
            for (sums, left) in sums.iter_mut().zip(left) {
                for lane in 0..WIDTH {
                    sums[lane] += passing[lane] * left[lane];
                }
            }
        }
        let [mean_kev, square_kev2] = sums.map(|lanes| lanes.iter().copied().map(f64::from).sum());
        Moments {
            mean_kev,
            square_kev2,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::beam::receptor::{AntiScatterGrid, DetectorModel, Receptor};

    fn receptors() -> [Receptor; 2] {
        let real = Receptor {
            model: DetectorModel::Csi {
                thickness_um: 600.0,
                packing: 0.8,
            },
            grid: Some(AntiScatterGrid {
                focus_mm: Some(1_100.0),
                ..AntiScatterGrid::new(8.0, 40.0)
            }),
            ..Receptor::default()
        };
        [Receptor::default(), real]
    }

    /// Both tables against the response itself, away from the edges (33.2, 36.0 and 88.0 keV) and at lines next to one, from steep to
    /// grazing incidence.
    #[test]
    fn tables_have_the_moments_of_the_response() {
        for receptor in receptors() {
            let response = Response::new(&receptor, [0.0; 2]).unwrap();
            let lines_kev = [14.9, 33.168, 33.17, 59.3];
            let fast = TabulatedResponse::new(&response, &lines_kev);
            for direction in [
                [0.0, 0.0, 1.0],
                [0.003, 0.3, 0.9],
                [0.1, 0.02, 0.98],
                [0.7, 0.7, 0.2],
            ] {
                let direction = Vector3::from(direction).normalize();
                let at_mm = [20.0, -15.0];
                let incidence = fast.incidence(at_mm, &direction);
                let check = |energy_kev: f64, found: Moments| {
                    let exact = response.moments(energy_kev, at_mm, &direction);
                    for (found, exact) in [
                        (found.mean_kev, exact.mean_kev),
                        (found.square_kev2, exact.square_kev2),
                    ] {
                        let allowed = 2e-4 * exact + 1e-9;
                        assert!(
                            (found - exact).abs() <= allowed,
                            "{energy_kev} keV, {direction}: {found}, {exact}"
                        );
                    }
                };
                let one = |lane: usize| -> Lanes {
                    std::array::from_fn(|i| f32::from(u8::from(i == lane)))
                };
                for (line, &energy_kev) in lines_kev.iter().enumerate() {
                    check(energy_kev, incidence.of_lines(&one(line)));
                }
                let energies = [5.0, 20.3, 33.0, 34.01, 61.7, 110.0, 150.0, 4.99];
                for (lane, energy_kev) in energies.into_iter().enumerate() {
                    let found = incidence.of_energies(&energies.map(|kev| kev as f32), &one(lane));
                    assert_eq!(found, incidence.of_energy(energy_kev));
                    if energy_kev < CUTOFF_KEV {
                        assert_eq!(found, Moments::default());
                    } else {
                        check(energy_kev, found);
                    }
                }
            }
        }
    }
}
