//! Outcome of tentative collisions: rejection, absorption with or without a K x-ray, or scattering.

use crate::isa::prefetch;
use crate::phantom::interpolation::Interpolation;
use crate::transport::lanes::Lanes;
use crate::transport::lanes::advance::{Blocks, Steps};
use crate::transport::lanes::draws::{Depths, unit};
use crate::transport::lanes::flights::{LANES, each};
use crate::transport::lanes::picked::Picked;
use crate::transport::score::Score;
use crate::transport::tally::Category;
use crate::transport::voxel_codes::VoxelCode;

/// Site of a tentative collision.
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

/// Samples one of the eight voxels with centres around a position, with the probability of its trilinear weight: the voxel at the
/// position plus an offset that is uniform over one voxel. Indices start at the corner of the rim.
///
/// The offsets are the low bytes of random `words` whose other uses discard them, in steps of 2⁻⁸.
#[inline(always)]
fn neighbour(position: [f32; 3], voxel: [usize; 3], words: [u32; 4]) -> [usize; 3] {
    let [x, _, y, z] = words;
    let words = [x, y, z];
    std::array::from_fn(|axis| {
        let offset = ((words[axis] & 0xFF) as f32 + 0.5) * (1.0 / 256.0);
        // In [0, 2): below ½ the previous voxel, from 1½ on the next one.
        let from_before = position[axis] - voxel[axis] as f32 + offset;
        voxel[axis] + usize::from(from_before >= 0.5) + usize::from(from_before >= 1.5)
    })
}

impl Lanes<'_, '_> {
    /// Accepts or rejects tentative collisions and processes the accepted ones.
    pub(super) fn collide(
        &mut self,
        tentative: &Picked,
        ended: &mut Picked,
        blocks: &Blocks,
        steps: &Steps,
        score: &mut impl Score,
    ) {
        self.draw(tentative);
        let mut site = [Site::default(); LANES];
        let mut place = [0; LANES];
        let tables = &self.transport.tables;
        let (size, codes) = (self.transport.lattice.size, &tables.codes);
        let interpolation = tables.phantom.interpolation();
        for (i, lane) in tentative.iter().enumerate() {
            let voxel = each(&steps.voxel, lane).map(|index| index as usize);
            // Indices from the corner of the rim.
            let at = match interpolation {
                Interpolation::Nearest => voxel.map(|index| index + 1),
                Interpolation::Trilinear => {
                    let position = each(&self.flights.position, lane);
                    neighbour(position, voxel, self.draws.block(i))
                }
            };
            place[i] = codes.index(at);
            prefetch(codes.all(), place[i]);
            let [x, y, z] = [0, 1, 2].map(|axis| at[axis].clamp(1, size[axis]) - 1);
            site[i] = Site {
                lane: lane as u8,
                voxel: x + size[0] * (y + size[1] * z),
                code: VoxelCode::default(),
            };
        }
        let mut depths = [0.0; LANES];
        self.isa.run(Depths {
            word: &self.draws.block[1],
            depth: &mut depths,
            count: tentative.count.next_multiple_of(16),
        });
        let (mut compton, mut rayleigh, mut k_rays) = (Picked::new(), Picked::new(), Picked::new());
        for (i, lane) in tentative.iter().enumerate() {
            let photon = &self.photons[lane];
            let code = self.transport.tables.codes.all()[place[i]];
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

    /// Replaces the absorbed photon by a K x-ray; returns the rest of the absorbed energy, keV.
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
