//! K x-rays of a foil against their integral.

use nalgebra::{Point3, Vector3};
use ppa_core::random::Philox;
use ppa_ct::Grid;

use super::projection;
use crate::beam::detector::Detector;
use crate::beam::spectrum::Spectrum;
use crate::engine::exposure::Exposure;
use crate::matter::compton::ComptonModel;
use crate::matter::material::Material;
use crate::phantom::voxels::VoxelPhantom;
use crate::transport::score::{Arrival, Score};
use crate::transport::tally::Category;

/// Photons at the energies of K lines, by the side of the foil on which they leave.
#[derive(Default)]
struct KRays {
    lines: Vec<f64>,
    /// Towards the detector, away from it.
    leave: [f64; 2],
}

impl KRays {
    fn count(&mut self, side: usize, energy_kev: f64) -> bool {
        let is_line = |line: &f64| (*line - energy_kev).abs() < 1e-5;
        let is_k_ray = self.lines.iter().any(is_line);
        self.leave[side] += f64::from(u8::from(is_k_ray));
        is_k_ray
    }
}

impl Score for KRays {
    fn arrive(&mut self, _: usize, arrival: &Arrival, _: &mut Philox) {
        let is_k_ray = self.count(0, arrival.energy_kev);
        assert!(!is_k_ray || arrival.category == Category::Multiple);
    }

    fn escape(&mut self, _: usize, energy_kev: f64) {
        self.count(1, energy_kev);
    }
}

/// K x-rays that leave an iodine foil of 0.02 mm on either side, against the integral over depth and direction of
/// emission times transmission.
///
/// Scattered photons may still be absorbed, and scattered K x-rays may still leave. Attenuation without scattering gives the
/// upper limit and attenuation with it the lower one, 1 % apart. 4.5 standard errors beyond (7e-6 each), 2.5 %.
#[test]
fn k_x_rays_leave_a_foil_as_the_integral_says() {
    let (side_mm, thickness_mm, incident_kev) = (400.0, 0.02, 60.0);
    let grid = Grid::axis_aligned(
        [1, 1, 1],
        Vector3::new(side_mm, side_mm, thickness_mm),
        Point3::origin(),
    );
    let iodine = Material::named("iodine").unwrap();
    let (density, density_f32) = (iodine.density_g_cm3(), iodine.density_g_cm3() as f32);
    let lines = iodine.k_fluorescence(incident_kev);
    let at = iodine.cross_sections(incident_kev).unwrap();
    let phantom = VoxelPhantom::new(
        grid.unwrap(),
        vec![0],
        vec![density_f32],
        vec![iodine.clone()],
    );
    let phantom = phantom.unwrap();
    let spectrum = Spectrum::monoenergetic(incident_kev).unwrap();
    let mut projection = projection();
    projection.detector = Detector::centred(10, 10, 1.0);
    let model = ComptonModel::default();
    let exposure = Exposure::new(&phantom, &spectrum, &projection, model).unwrap();
    let transport = exposure.transport;
    let mut found = KRays {
        lines: lines
            .iter()
            .map(|line| f64::from(line.energy_kev as f32))
            .collect(),
        ..KRays::default()
    };
    let histories = 2_000_000;
    transport.follow(3, 0..histories, &mut found);

    let per_mm = |cm2_g: f64| cm2_g * density / 10.0;
    let middle = |i: u32, count: u32| (f64::from(i) + 0.5) / f64::from(count);
    // Half of the photons emitted at a depth go to either side, uniformly in the cosine.
    let out = |mu: f64, way_mm: f64| -> f64 {
        let cosines = (0..400).map(|i| (-mu * way_mm / middle(i, 400)).exp());
        0.5 * cosines.sum::<f64>() / 400.0
    };
    let leaving = |is_back: bool, scattering: f64| -> f64 {
        let depths = (0..100).map(|i| thickness_mm * middle(i, 100));
        let from_depth = |depth_mm: f64| -> f64 {
            let way_mm = if is_back {
                depth_mm
            } else {
                thickness_mm - depth_mm
            };
            let of_lines = lines.iter().map(|line| {
                let k = iodine.cross_sections(line.energy_kev).unwrap();
                let attenuation = k.photoelectric + scattering * (k.compton + k.rayleigh);
                line.probability * out(per_mm(attenuation), way_mm)
            });
            let attenuation = at.photoelectric + scattering * (at.compton + at.rayleigh);
            let absorbed = per_mm(at.photoelectric) * (-per_mm(attenuation) * depth_mm).exp();
            absorbed * of_lines.sum::<f64>()
        };
        depths.map(from_depth).sum::<f64>() * thickness_mm / 100.0 * histories as f64
    };
    for (side, found) in found.leave.into_iter().enumerate() {
        let [least, most] = [1.0, 0.0].map(|scattering| leaving(side == 1, scattering));
        let sigma = found.sqrt();
        println!("side {side}: {found} ± {sigma:.0}, {least:.0} to {most:.0}");
        assert!(least - 4.5 * sigma < found && found < most + 4.5 * sigma);
    }
}
