//! What comes of tentative collisions: nothing, absorption, with or without a K x-ray, or scattering.

use crate::transport::attenuation::CUTOFF_KEV;
use crate::transport::lanes::advance::{Blocks, Steps};
use crate::transport::lanes::compton_attempt::{Attempt, Attempts};
use crate::transport::lanes::draws::{Depths, unit};
use crate::transport::lanes::entry::Aim;
use crate::transport::lanes::flights::{Flights, LANES, each};
use crate::transport::lanes::picked::Picked;
use crate::transport::lanes::turn::{Turn, Turns};
use crate::transport::lanes::{Lanes, Photon};
use crate::transport::score::Score;
use crate::transport::tally::Category;
use crate::transport::voxel_codes::VoxelCode;

/// Where a tentative collision takes place.
#[derive(Debug, Clone, Copy, Default)]
struct Site {
    lane: u8,
    voxel: usize,
    code: VoxelCode,
}

impl Site {
    #[inline(always)]
    fn lane(&self) -> usize {
        usize::from(self.lane) % LANES
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
    /// Accepts or rejects tentative collisions and carries out the accepted ones.
    pub(super) fn collide(
        &mut self,
        tentative: &Picked,
        ended: &mut Picked,
        blocks: &Blocks,
        steps: &Steps,
        score: &mut impl Score,
    ) {
        let mut site = [Site::default(); LANES];
        let size = self.transport.lattice.size;
        for (site, lane) in site.iter_mut().zip(tentative.iter()) {
            let [x, y, z] = each(&steps.voxel, lane);
            let voxel = x as usize + size[0] * (y as usize + size[1] * z as usize);
            *site = Site {
                lane: lane as u8,
                voxel,
                code: self.transport.codes[voxel],
            };
        }
        self.draw(tentative);
        let mut depths = [0.0; LANES];
        self.isa.run(Depths {
            word: &self.draws.block[1],
            depth: &mut depths,
            count: tentative.count.next_multiple_of(16),
        });
        let (mut compton, mut rayleigh, mut k_rays) = (Picked::new(), Picked::new(), Picked::new());
        for (i, lane) in tentative.iter().enumerate() {
            let photon = &self.photons[lane];
            let code = site[i].code;
            let sums = self
                .transport
                .attenuation
                .at(code.material(), photon.energy);
            let density = code.density_g_cm3();
            let lot = unit(self.draws.block[0][i]) * blocks.bound[lane];
            self.flights.depth[lane] = depths[i];
            let absorbed = lot < density * sums.photoelectric;
            let not_rayleigh = lot < density * sums.with_compton;
            compton.push_if(i, not_rayleigh & !absorbed);
            rayleigh.push_if(i, (lot < density * sums.total) & !not_rayleigh);
            if absorbed {
                let slot = usize::from(photon.slot);
                let energy_kev = f64::from(photon.energy_kev);
                let lot = unit(self.draws.block[3][i]);
                let tables = &self.transport.samplers[usize::from(code.material())];
                if let Some(line_kev) = tables.k_fluorescence(energy_kev, lot.into()) {
                    let left_kev = self.emit_k_ray(lane, line_kev);
                    score.deposit(slot, site[i].voxel, left_kev);
                    k_rays.push_if(i, true);
                } else {
                    score.deposit(slot, site[i].voxel, energy_kev);
                    score.finish(slot);
                    ended.push_if(lane, true);
                }
            }
        }
        let sites = compton.iter().chain(rayleigh.iter()).chain(k_rays.iter());
        let mut turns = Turns::new();
        let mut scattered = [Site::default(); LANES];
        for (n, i) in sites.enumerate() {
            scattered[n] = site[i];
            turns.azimuth[n] = self.draws.block[2][i];
        }
        let kinds = [compton.count, rayleigh.count];
        let scattered = &scattered[..compton.count + rayleigh.count + k_rays.count];
        if !scattered.is_empty() {
            self.scatter(scattered, kinds, &mut turns, ended, score);
        }
    }

    /// A K x-ray takes the place of the photon that was absorbed; what is left of that one's energy, keV.
    #[cold]
    fn emit_k_ray(&mut self, lane: usize, line_kev: f64) -> f64 {
        let photon = &mut self.photons[lane];
        let absorbed_kev = f64::from(photon.energy_kev);
        photon.energy_kev = line_kev as f32;
        photon.category = Category::Multiple;
        photon.energy = self.transport.attenuation.locate(line_kev);
        photon.row = self.transport.majorants.row(photon.energy);
        absorbed_kev - f64::from(photon.energy_kev)
    }

    /// Scatters photons: the first `compton` of them off electrons, then `rayleigh` off whole atoms. The others are K x-rays,
    /// which leave in any direction alike.
    fn scatter(
        &mut self,
        scattered: &[Site],
        [compton, rayleigh]: [usize; 2],
        turns: &mut Turns,
        ended: &mut Picked,
        score: &mut impl Score,
    ) {
        let mut lanes = Picked::new();
        for (n, site) in scattered.iter().enumerate() {
            let lane = site.lane();
            lanes.push_if(lane, true);
            let direction = each(&self.flights.direction, lane);
            for (to, from) in turns.direction.iter_mut().zip(direction) {
                to[n] = from;
            }
        }
        self.draw(&lanes);
        let attempts = self.attempt_compton(&scattered[..compton]);
        for (n, site) in scattered[..compton].iter().enumerate() {
            let (half, scattered_kev) = self.compton(site, &attempts, n);
            turns.cos_theta[n] = 1.0 - 2.0 * half;
            let photon = &mut self.photons[site.lane()];
            let slot = usize::from(photon.slot);
            let before_kev = f64::from(photon.energy_kev);
            photon.energy_kev = scattered_kev;
            photon.scatter(Category::Compton);
            if f64::from(scattered_kev) < CUTOFF_KEV {
                // What is left of the photon stays here too.
                score.deposit(slot, site.voxel, before_kev);
                score.finish(slot);
                ended.push_if(site.lane(), true);
            } else {
                score.deposit(slot, site.voxel, before_kev - f64::from(scattered_kev));
                photon.energy = self.transport.attenuation.locate(scattered_kev.into());
                photon.row = self.transport.majorants.row(photon.energy);
            }
        }
        let coherent = scattered.iter().enumerate().skip(compton).take(rayleigh);
        for (n, site) in coherent {
            let photon = &self.photons[site.lane()];
            let mut rng = self.generator(photon).after(self.draws.block(n));
            let tables = &self.transport.samplers[usize::from(site.code.material())];
            let cos_theta = tables.sample_rayleigh(photon.energy_kev.into(), &mut rng);
            turns.cos_theta[n] = cos_theta as f32;
            let photon = &mut self.photons[site.lane()];
            photon.step = rng.step();
            photon.scatter(Category::Rayleigh);
        }
        for n in compton + rayleigh..scattered.len() {
            turns.cos_theta[n] = 1.0 - 2.0 * unit(self.draws.block[0][n]);
        }
        let count = scattered.len().next_multiple_of(16);
        self.isa.run(Turn { turns, count });
        let mut flights = Flights::new();
        flights.direction = turns.direction;
        for (n, site) in scattered.iter().enumerate() {
            let position = each(&self.flights.position, site.lane());
            for (to, from) in flights.position.iter_mut().zip(position) {
                to[n] = from;
            }
            flights.depth[n] = self.flights.depth[site.lane()];
        }
        self.isa.run(Aim {
            space: &self.space,
            flights: &mut flights,
            count,
        });
        for (n, site) in scattered.iter().enumerate() {
            self.flights.copy(site.lane(), &flights, n);
        }
    }

    /// One attempt at each Compton scattering, if the tables of its material let attempts be made together.
    fn attempt_compton(&self, sites: &[Site]) -> Attempts {
        let mut attempts = Attempts::new();
        for (n, site) in sites.iter().enumerate() {
            let energy_kev = self.photons[site.lane()].energy_kev;
            let tables = &self.transport.samplers[usize::from(site.code.material())];
            let [angle, shell, ..] = self.draws.block(n);
            if let Some((half, electron)) =
                tables.attempt_compton(energy_kev, unit(angle), unit(shell))
            {
                attempts.energy_kev[n] = energy_kev;
                attempts.half[n] = half;
                attempts.binding_kev[n] = electron.binding_kev;
                attempts.momentum[n] = electron.momentum;
            }
        }
        self.isa.run(Attempt {
            attempts: &mut attempts,
            momentum: &self.draws.block[2],
            way: &self.draws.block[3],
            count: sites.len().next_multiple_of(16),
        });
        attempts
    }

    /// sin²(θ/2) and the energy in keV after Compton scattering; what an attempt leaves open is drawn anew.
    #[inline(always)]
    fn compton(&mut self, site: &Site, attempts: &Attempts, n: usize) -> (f32, f32) {
        let half = attempts.half[n];
        let scattered_kev = attempts.scattered_kev[n];
        if scattered_kev > 0.0 {
            return (half, scattered_kev);
        }
        self.compton_anew(site, (scattered_kev == 0.0).then_some(half))
    }

    #[cold]
    #[inline(never)]
    fn compton_anew(&mut self, site: &Site, half: Option<f32>) -> (f32, f32) {
        let photon = &self.photons[site.lane()];
        let energy_kev = f64::from(photon.energy_kev);
        let mut rng = self.generator(photon);
        let tables = &self.transport.samplers[usize::from(site.code.material())];
        let (cos_theta, scattered_kev) = match half {
            Some(half) => {
                let cos_theta = 1.0 - 2.0 * f64::from(half);
                let scattered_kev = tables.compton_energy_at(energy_kev, cos_theta, || rng.unit());
                (cos_theta, scattered_kev)
            }
            None => tables.sample_compton(energy_kev, &mut rng),
        };
        self.photons[site.lane()].step = rng.step();
        ((0.5 * (1.0 - cos_theta)) as f32, scattered_kev as f32)
    }
}
