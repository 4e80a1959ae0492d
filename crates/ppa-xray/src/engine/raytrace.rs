//! The primary image without randomness: line integrals through the voxels, averaged over each pixel.

use nalgebra::{Point2, Point3, Vector3};
use rayon::prelude::*;

use crate::beam::projection::Projection;
use crate::beam::spectrum::Spectrum;
use crate::phantom::lattice::Walk;
use crate::phantom::voxels::VoxelPhantom;
use crate::transport::tally::Moments;
use crate::transport::tracking::{Transport, TransportError};

/// Energy of unscattered photons per pixel, row-major, eV/cm² per history.
///
/// Each pixel is the mean over `samples_per_side`² evenly spread rays; rays through pixel centres alone are
/// off by up to 13 % at sharp edges. Voxels are homogeneous, as in the transport.
///
/// # Errors
/// As [`crate::engine::analog`]; also when `samples_per_side` is not 1 to 64.
pub fn primary(
    phantom: &VoxelPhantom,
    spectrum: &Spectrum,
    projection: &Projection,
    samples_per_side: u32,
) -> Result<Vec<f64>, TransportError> {
    let transport = Transport::new(phantom, spectrum, projection)?;
    let ev_cm2 = 1e3 / projection.detector.pixel_cm2();
    let moments = primary_moments(&transport, samples_per_side)?;
    Ok(moments.iter().map(|m| m.mean_kev * ev_cm2).collect())
}

/// First two moments per history of the primary energy in every pixel.
pub(crate) fn primary_moments(
    transport: &Transport,
    samples_per_side: u32,
) -> Result<Vec<Moments>, TransportError> {
    if !(1..=64).contains(&samples_per_side) {
        return Err(TransportError::Setting {
            what: "the number of rays per pixel side",
            found: f64::from(samples_per_side),
            expected: "1 to 64",
        });
    }
    let detector = transport.projection.detector;
    let beam = Beam::new(transport);
    let [half_x, half_y] = detector.half_mm();
    let step_mm = detector.pixel_mm / f64::from(samples_per_side);
    let share_cm2 = detector.pixel_cm2() / f64::from(samples_per_side).powi(2);
    let columns = detector.columns as usize;
    Ok((0..detector.pixels())
        .into_par_iter()
        .with_min_len(columns.min(64))
        .map_init(
            || beam.scratch(),
            |scratch, pixel| {
                let left = (pixel % columns) as f64 * detector.pixel_mm - half_x;
                let top = (pixel / columns) as f64 * detector.pixel_mm - half_y;
                let mut sum = Moments::default();
                for sample in 0..samples_per_side * samples_per_side {
                    let (i, j) = (sample % samples_per_side, sample / samples_per_side);
                    let at = Point2::new(
                        left + (f64::from(i) + 0.5) * step_mm,
                        top + (f64::from(j) + 0.5) * step_mm,
                    );
                    let photons = transport.projection.open_fluence_cm2(at) * share_cm2;
                    let behind = beam.behind(at, scratch);
                    sum.mean_kev += photons * behind.mean_kev;
                    sum.square_kev2 += photons * behind.square_kev2;
                }
                sum
            },
        )
        .collect())
}

/// The spectrum with the attenuation of every material at every energy.
struct Beam<'a> {
    transport: &'a Transport<'a>,
    energy_kev: Vec<f64>,
    weight: Vec<f64>,
    /// Material by material, mm⁻¹ per g/cm³.
    attenuation: Vec<f64>,
}

/// Buffers of one thread.
struct Scratch {
    /// Density times length per material, mm·g/cm³.
    mass: Vec<f64>,
    exponent: Vec<f64>,
}

impl<'a> Beam<'a> {
    fn new(transport: &'a Transport<'a>) -> Self {
        let lines = spectral_lines(transport.spectrum);
        let (energy_kev, weight): (Vec<f64>, Vec<f64>) = lines.into_iter().unzip();
        let attenuation = (0..transport.phantom.materials().len())
            .flat_map(|material| {
                let energy_kev = &energy_kev;
                energy_kev.iter().map(move |&energy_kev| {
                    let energy = transport.attenuation.locate(energy_kev);
                    f64::from(transport.attenuation.at(material as u8, energy).total)
                })
            })
            .collect();
        Self {
            transport,
            energy_kev,
            weight,
            attenuation,
        }
    }

    fn scratch(&self) -> Scratch {
        Scratch {
            mass: vec![0.0; self.transport.phantom.materials().len()],
            exponent: vec![0.0; self.energy_kev.len()],
        }
    }

    /// Moments of the energy that one photon towards `at` brings to the detector plane.
    fn behind(&self, at: Point2<f64>, scratch: &mut Scratch) -> Moments {
        self.integrate(at, &mut scratch.mass);
        scratch.exponent.fill(0.0);
        let lines = self.energy_kev.len();
        for (&mass, attenuation) in scratch
            .mass
            .iter()
            .zip(self.attenuation.chunks_exact(lines))
        {
            if mass > 0.0 {
                for (exponent, mu) in scratch.exponent.iter_mut().zip(attenuation) {
                    *exponent += mass * mu;
                }
            }
        }
        let mut sum = Moments::default();
        for ((&exponent, &weight), &energy_kev) in scratch
            .exponent
            .iter()
            .zip(&self.weight)
            .zip(&self.energy_kev)
        {
            let energy = weight * (-exponent).exp() * energy_kev;
            sum.mean_kev += energy;
            sum.square_kev2 += energy * energy_kev;
        }
        sum
    }

    /// Density times length of every material between the source and the detector plane.
    fn integrate(&self, at: Point2<f64>, mass: &mut [f64]) {
        mass.fill(0.0);
        let Transport {
            phantom, lattice, ..
        } = self.transport;
        let target = Vector3::new(at.x, at.y, self.transport.projection.source_detector_mm);
        let length_mm = target.norm();
        let ray = lattice.ray(&Point3::origin(), &(target / length_mm));
        let Some((enter, leave)) = lattice.clip(&ray) else {
            return;
        };
        let end = leave.min(length_mm);
        if enter >= end {
            return;
        }
        let mut walk = Walk::new(&ray, enter, lattice.size.map(|n| n as u32), 1.0);
        let mut from = enter;
        loop {
            let (axis, next) = walk.exit();
            let to = next.min(end);
            let material = phantom.material()[walk.index];
            let density = phantom.density_g_cm3()[walk.index];
            mass[usize::from(material)] += f64::from(density) * (to - from);
            from = to;
            if next >= end || !walk.advance(axis) {
                return;
            }
        }
    }
}

/// Energies and probabilities to integrate over; what carries less than 1e-9 of the photons is left out.
fn spectral_lines(spectrum: &Spectrum) -> Vec<(f64, f64)> {
    spectrum
        .bins()
        .filter(|&(energy_kev, probability)| {
            probability > 1e-9
                && (crate::transport::attenuation::CUTOFF_KEV
                    ..=crate::transport::attenuation::CEILING_KEV)
                    .contains(&energy_kev)
        })
        .collect()
}
