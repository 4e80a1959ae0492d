//! Air kerma at the entrance of the patient and at the detector.

use nalgebra::Point3;

use crate::matter::energy_range::{CUTOFF_KEV, MAX_ENERGY_KEV};
use crate::matter::energy_transfer::GRAY_PER_KEV_G;
use crate::matter::material::Material;
use crate::phantom::lattice::Walk;
use crate::transport::tracking::{SOLID_G_CM3, Transport};

/// Nodes per keV; the error of linear interpolation is then below 0.05 % at 5 keV and 1e-5 at 30 keV.
const NODES_PER_KEV: usize = 8;

/// Energy times the mass energy-transfer coefficient of air, by energy.
///
/// Electrons of these energies lose almost nothing to bremsstrahlung in air (0.03 % at 150 keV), so this is also the
/// absorption coefficient.
#[derive(Debug)]
pub(crate) struct AirKerma {
    /// keV cm²/g.
    table: Vec<f64>,
}

impl AirKerma {
    pub fn new() -> Self {
        let air = air();
        let nodes = (MAX_ENERGY_KEV - CUTOFF_KEV) as usize * NODES_PER_KEV;
        let table = (0..=nodes)
            .map(|node| air.kerma_kev_cm2_g(CUTOFF_KEV + node as f64 / NODES_PER_KEV as f64))
            .collect();
        Self { table }
    }

    /// Kerma of one photon per cm², keV/g.
    #[inline]
    pub fn kev_cm2_g(&self, energy_kev: f64) -> f64 {
        let at = (energy_kev - CUTOFF_KEV).max(0.0) * NODES_PER_KEV as f64;
        let node = (at as usize).min(self.table.len() - 2);
        let (low, high) = (self.table[node], self.table[node + 1]);
        low + (high - low) * (at - node as f64)
    }
}

fn air() -> Material {
    Material::named("air").expect("in the library")
}

/// Air kerma free in air (no backscatter) where the central ray enters the patient, Gy per history.
///
/// The patient begins at the first voxel on the central ray denser than 0.3 g/cm³; the voxels before it attenuate. `None`
/// if the central ray meets no such voxel before the detector plane or is blocked by the collimator.
pub(crate) fn entrance_gy_per_history(transport: &Transport) -> Option<f64> {
    let phantom = &transport.tables.phantom;
    let (lattice, projection) = (&transport.lattice, transport.projection);
    let central = projection.central_ray;
    let foot_mm = projection.source_detector_mm / central.z;
    let foot = (central.xy() * foot_mm).into();
    if !transport.emitter.fully_lit().contains(&foot) {
        return None;
    }
    let ray = lattice.ray(&Point3::origin(), &central);
    let (enter, leave) = lattice.clip(&ray)?;
    let end = leave.min(foot_mm);
    let mut walk = Walk::new(&ray, enter, lattice.size.map(|n| n as u32), 1.0);
    let mut path = vec![0.0; phantom.materials().len()];
    let mut at = enter;
    let skin_mm = loop {
        let density = phantom.density_g_cm3()[walk.index];
        if density > SOLID_G_CM3 {
            break at;
        }
        let (axis, next) = walk.exit();
        path[usize::from(phantom.material()[walk.index])] += (next - at) * f64::from(density);
        if next >= end || !walk.advance(axis) {
            return None;
        }
        at = next;
    };
    let air = air();
    let kerma_kev_cm2_g: f64 = transport
        .spectrum
        .bins()
        .map(|(energy_kev, probability)| {
            let depth: f64 = phantom
                .materials()
                .iter()
                .zip(&path)
                .map(|(material, mm_g_cm3)| {
                    material.cross_sections_unchecked(energy_kev).total() * mm_g_cm3 / 10.0
                })
                .sum();
            probability * air.kerma_kev_cm2_g(energy_kev) * (-depth).exp()
        })
        .sum();
    // Across the ray, and nearer to the focus.
    let lit_over_focal = transport
        .extrafocal
        .as_ref()
        .map_or(1.0, |beside| beside.lit_over_focal(foot, skin_mm / foot_mm));
    let focal_cm2 = transport.emitter.open_fluence_cm2(&Point3::origin(), foot);
    let foot_cm2 = lit_over_focal * focal_cm2 / central.z;
    let skin_cm2 = foot_cm2 * (foot_mm / skin_mm).powi(2);
    Some(kerma_kev_cm2_g * GRAY_PER_KEV_G * skin_cm2)
}
