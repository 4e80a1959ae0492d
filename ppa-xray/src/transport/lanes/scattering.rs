//! Scattering of photons and emission of K x-rays: new directions and energies.

use crate::matter::energy_range::CUTOFF_KEV;
use crate::transport::lanes::collisions::Site;
use crate::transport::lanes::compton_attempt::{Attempt, Attempts};
use crate::transport::lanes::draws::unit;
use crate::transport::lanes::entry::Aim;
use crate::transport::lanes::flights::Flights;
use crate::transport::lanes::picked::Picked;
use crate::transport::lanes::rotation::{Rotate, ScatterAngles};
use crate::transport::lanes::{Lanes, Photon};
use crate::transport::score::Score;
use crate::transport::tally::Category;

/// Buffers for the photons that scatter in one round, stored contiguously; old, harmless numbers follow them.
pub(super) struct Scattering {
    flights: Flights,
    pub angles: ScatterAngles,
    attempts: Attempts,
}

impl Scattering {
    pub fn new() -> Self {
        Self {
            flights: Flights::new(),
            angles: ScatterAngles::new(),
            attempts: Attempts::new(),
        }
    }
}

impl Photon {
    #[inline(always)]
    fn scatter(&mut self, by: Category) {
        self.category = match self.category {
            Category::Primary => by,
            _ => Category::Multiple,
        };
    }
}

impl Lanes<'_, '_> {
    /// Scatters photons: the first `compton` of them off electrons, then `rayleigh` off atoms. The others are K x-rays,
    /// which are emitted isotropically.
    pub(super) fn scatter(
        &mut self,
        scattered: &[Site],
        [compton, rayleigh]: [usize; 2],
        ended: &mut Picked,
        score: &mut impl Score,
    ) {
        let mut lanes = Picked::new();
        for (n, site) in scattered.iter().enumerate() {
            let lane = site.lane();
            lanes.push_if(lane, true);
            let flights = &mut self.scattering.flights;
            for axis in 0..3 {
                flights.direction[axis][n] = self.flights.direction[axis][lane];
                flights.position[axis][n] = self.flights.position[axis][lane];
            }
        }
        self.draw(&lanes);
        self.attempt_compton(&scattered[..compton]);
        for (n, site) in scattered[..compton].iter().enumerate() {
            let (sin2_half_theta, scattered_kev) = self.compton(site, n);
            self.scattering.angles.cos_theta[n] = 1.0 - 2.0 * sin2_half_theta;
            let photon = &mut self.photons[site.lane()];
            let slot = usize::from(photon.slot);
            let before_kev = f64::from(photon.energy_kev);
            photon.energy_kev = scattered_kev;
            photon.scatter(Category::Compton);
            if f64::from(scattered_kev) < CUTOFF_KEV {
                // The remaining energy of the photon is deposited here too.
                score.deposit(slot, site.voxel, before_kev);
                score.finish(slot);
                ended.push_if(site.lane(), true);
            } else {
                score.deposit(slot, site.voxel, before_kev - f64::from(scattered_kev));
                photon.energy = self
                    .transport
                    .tables
                    .attenuation
                    .locate(scattered_kev.into());
                photon.row = self.transport.tables.majorants().row(photon.energy);
            }
        }
        let coherent = scattered.iter().enumerate().skip(compton).take(rayleigh);
        for (n, site) in coherent {
            let photon = &self.photons[site.lane()];
            let mut rng = self.generator(photon).after(self.draws.block(n));
            let tables = &self.transport.tables.samplers[usize::from(site.code.material())];
            let cos_theta = tables.sample_rayleigh(photon.energy_kev.into(), &mut rng);
            self.scattering.angles.cos_theta[n] = cos_theta as f32;
            let photon = &mut self.photons[site.lane()];
            photon.step = rng.step();
            photon.scatter(Category::Rayleigh);
        }
        for n in compton + rayleigh..scattered.len() {
            self.scattering.angles.cos_theta[n] = 1.0 - 2.0 * unit(self.draws.block[0][n]);
        }
        let count = scattered.len().next_multiple_of(16);
        let Scattering {
            flights, angles, ..
        } = &mut self.scattering;
        self.isa.run(Rotate {
            angles,
            direction: &mut flights.direction,
            count,
        });
        self.isa.run(Aim {
            space: &self.space,
            flights,
            count,
        });
        for (n, site) in scattered.iter().enumerate() {
            self.flights.turn(site.lane(), &self.scattering.flights, n);
        }
    }

    /// Makes one attempt at each Compton scattering, if the tables of the material allow vectorised attempts.
    fn attempt_compton(&mut self, sites: &[Site]) {
        let attempts = &mut self.scattering.attempts;
        for (n, site) in sites.iter().enumerate() {
            let energy_kev = self.photons[site.lane()].energy_kev;
            let tables = &self.transport.tables.samplers[usize::from(site.code.material())];
            let [angle, shell, ..] = self.draws.block(n);
            match tables.attempt_compton(energy_kev, unit(angle), unit(shell)) {
                Some((sin2_half_theta, electron)) => {
                    attempts.energy_kev[n] = energy_kev;
                    attempts.sin2_half_theta[n] = sin2_half_theta;
                    attempts.binding_kev[n] = electron.binding_kev;
                    attempts.momentum[n] = electron.momentum;
                }
                // A photon without energy cannot free an electron.
                None => attempts.energy_kev[n] = 0.0,
            }
        }
        self.isa.run(Attempt {
            attempts,
            momentum: &self.draws.block[2],
            sign_word: &self.draws.block[3],
            count: sites.len().next_multiple_of(16),
        });
    }

    /// Samples sin²(θ/2) and the energy in keV after Compton scattering; photons whose attempts all failed are sampled one by one.
    #[inline(always)]
    fn compton(&mut self, site: &Site, n: usize) -> (f32, f32) {
        let sin2_half_theta = self.scattering.attempts.sin2_half_theta[n];
        let scattered_kev = self.scattering.attempts.scattered_kev[n];
        if scattered_kev > 0.0 {
            return (sin2_half_theta, scattered_kev);
        }
        self.sample_one_compton(site, (scattered_kev == 0.0).then_some(sin2_half_theta))
    }

    #[cold]
    #[inline(never)]
    fn sample_one_compton(&mut self, site: &Site, sin2_half_theta: Option<f32>) -> (f32, f32) {
        let photon = &self.photons[site.lane()];
        let energy_kev = f64::from(photon.energy_kev);
        let mut rng = self.generator(photon);
        let tables = &self.transport.tables.samplers[usize::from(site.code.material())];
        let (cos_theta, scattered_kev) = match sin2_half_theta {
            Some(sin2_half_theta) => {
                let cos_theta = 1.0 - 2.0 * f64::from(sin2_half_theta);
                let scattered_kev = tables.compton_energy_at(energy_kev, cos_theta, || rng.unit());
                (cos_theta, scattered_kev)
            }
            None => tables.sample_compton(energy_kev, &mut rng),
        };
        self.photons[site.lane()].step = rng.step();
        ((0.5 * (1.0 - cos_theta)) as f32, scattered_kev as f32)
    }
}
