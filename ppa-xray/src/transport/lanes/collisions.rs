//! Outcome of tentative collisions: none, absorption with or without a K x-ray, or scattering.

use crate::transport::lanes::Lanes;
use crate::transport::lanes::advance::{Blocks, Steps};
use crate::transport::lanes::draws::{Depths, unit};
use crate::transport::lanes::flights::{LANES, each};
use crate::transport::lanes::isa::prefetch;
use crate::transport::lanes::picked::Picked;
use crate::transport::score::Score;
use crate::transport::tally::Category;
use crate::transport::voxel_codes::VoxelCode;

/// Where a tentative collision takes place.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Site {
    lane: u8,
    pub voxel: usize,
    pub code: VoxelCode,
}

impl Site {
    #[inline(always)]
    pub fn lane(&self) -> usize {
        usize::from(self.lane) % LANES
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
            prefetch(&self.transport.tables.codes, voxel);
            *site = Site {
                lane: lane as u8,
                voxel,
                code: VoxelCode::default(),
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
            let code = self.transport.tables.codes[site[i].voxel];
            site[i].code = code;
            let sums = self
                .transport
                .tables
                .attenuation
                .at(code.material(), photon.energy);
            let density = code.density_g_cm3();
            let xi = unit(self.draws.block[0][i]) * blocks.bound[lane];
            self.flights.depth[lane] = depths[i];
            let absorbed = xi < density * sums.photoelectric;
            let not_rayleigh = xi < density * sums.with_compton;
            compton.push_if(i, not_rayleigh & !absorbed);
            rayleigh.push_if(i, (xi < density * sums.total) & !not_rayleigh);
            if absorbed {
                let slot = usize::from(photon.slot);
                let energy_kev = f64::from(photon.energy_kev);
                let xi = unit(self.draws.block[3][i]);
                let tables = &self.transport.tables.samplers[usize::from(code.material())];
                if let Some(line_kev) = tables.k_fluorescence(energy_kev, xi.into()) {
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
        let mut scattered = [Site::default(); LANES];
        for (n, i) in sites.enumerate() {
            scattered[n] = site[i];
            self.scattering.angles.azimuth[n] = self.draws.block[2][i];
        }
        let kinds = [compton.count, rayleigh.count];
        let scattered = &scattered[..compton.count + rayleigh.count + k_rays.count];
        if !scattered.is_empty() {
            self.scatter(scattered, kinds, ended, score);
        }
    }

    /// A K x-ray takes the place of the photon that was absorbed; what is left of that one's energy, keV.
    #[cold]
    fn emit_k_ray(&mut self, lane: usize, line_kev: f64) -> f64 {
        let photon = &mut self.photons[lane];
        let absorbed_kev = f64::from(photon.energy_kev);
        photon.energy_kev = line_kev as f32;
        photon.category = Category::Multiple;
        photon.energy = self.transport.tables.attenuation.locate(line_kev);
        photon.row = self.transport.tables.majorants().row(photon.energy);
        absorbed_kev - f64::from(photon.energy_kev)
    }
}
