//! The primary image without randomness: line integrals through the voxels, averaged over each pixel.

use nalgebra::{Point2, Point3, Unit, Vector3};
use rayon::prelude::*;

use crate::beam::emitter::SpectralLines;
use crate::beam::field::Field;
use crate::beam::projection::Projection;
use crate::beam::spectrum::Spectrum;
use crate::detector::response::LineResponse;
use crate::matter::compton::ComptonModel;
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
    let transport = Transport::new(phantom, spectrum, projection, ComptonModel::default())?;
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
    let emitter = &transport.emitter;
    let beam = Beam::new(transport);
    let spots = emitter.spot_points(SPOT_RAYS);
    let rays = f64::from(samples_per_side).powi(2);
    let columns = detector.columns as usize;
    Ok((0..detector.pixels())
        .into_par_iter()
        .with_min_len(columns.min(64))
        .map_init(
            || beam.scratch(),
            |scratch, pixel| {
                let mut sum = Moments::default();
                let centre = detector.pixel_centre_mm(pixel);
                let pixel = Field::centred([centre.x, centre.y], [detector.pixel_mm; 2]);
                // Rays fill the part of the pixel that lies in the field, so that its edges are sharp.
                let Some(lit) = pixel.overlap(emitter.field()) else {
                    return sum;
                };
                let size = lit.size_mm();
                let share_cm2 = size[0] * size[1] / 100.0 / rays;
                for sample in 0..samples_per_side * samples_per_side {
                    let (i, j) = (sample % samples_per_side, sample / samples_per_side);
                    let along = |i: u32| (f64::from(i) + 0.5) / f64::from(samples_per_side);
                    let at = Point2::new(
                        lit.low_mm[0] + along(i) * size[0],
                        lit.low_mm[1] + along(j) * size[1],
                    );
                    for (spot, weight) in &spots {
                        let photons = weight * share_cm2 * emitter.open_fluence_cm2(spot, at);
                        let behind = beam.behind(spot, at, scratch);
                        sum.mean_kev += photons * behind.mean_kev;
                        sum.square_kev2 += photons * behind.square_kev2;
                    }
                }
                sum
            },
        )
        .collect())
}

/// Points per side of a focal spot that is not a point.
const SPOT_RAYS: u32 = 4;

/// The spectrum with the attenuation of every material at every energy.
struct Beam<'a> {
    transport: &'a Transport<'a>,
    lines: SpectralLines,
    response: LineResponse<'a>,
    /// Material by material, mm⁻¹ per g/cm³.
    attenuation: Vec<f64>,
}

/// Buffers of one thread.
struct Scratch {
    /// Density times length per material, mm·g/cm³.
    mass: Vec<f64>,
    exponent: Vec<f64>,
    photons: Vec<f64>,
}

impl<'a> Beam<'a> {
    fn new(transport: &'a Transport<'a>) -> Self {
        let lines = transport.emitter.lines();
        let attenuation = (0..transport.phantom.materials().len())
            .flat_map(|material| {
                let energy_kev = &lines.energy_kev;
                energy_kev.iter().map(move |&energy_kev| {
                    let energy = transport.attenuation.locate(energy_kev);
                    f64::from(transport.attenuation.at(material as u8, energy).total)
                })
            })
            .collect();
        Self {
            transport,
            response: transport.response.at_lines(&lines.energy_kev),
            lines,
            attenuation,
        }
    }

    fn scratch(&self) -> Scratch {
        Scratch {
            mass: vec![0.0; self.transport.phantom.materials().len()],
            exponent: vec![0.0; self.lines.energy_kev.len()],
            photons: vec![0.0; self.lines.energy_kev.len()],
        }
    }

    /// Moments of the energy that one photon from `spot` to `at` leaves in the detector.
    fn behind(&self, spot: &Point3<f64>, at: Point2<f64>, scratch: &mut Scratch) -> Moments {
        let target = Point3::new(at.x, at.y, self.transport.projection.source_detector_mm);
        let (direction, length_mm) = Unit::new_and_get(target - spot);
        self.integrate(spot, &direction, length_mm, &mut scratch.mass);
        scratch.exponent.fill(0.0);
        let energy_kev = &self.lines.energy_kev;
        for (&mass, attenuation) in scratch
            .mass
            .iter()
            .zip(self.attenuation.chunks_exact(energy_kev.len()))
        {
            if mass > 0.0 {
                for (exponent, mu) in scratch.exponent.iter_mut().zip(attenuation) {
                    *exponent += mass * mu;
                }
            }
        }
        scratch.photons.fill(0.0);
        let mixture = self.transport.emitter.mixture(&direction);
        for (spectrum, share) in mixture.parts() {
            let weights = &self.lines.weights[spectrum];
            for (photons, weight) in scratch.photons.iter_mut().zip(weights) {
                *photons += share * weight;
            }
        }
        for (photons, exponent) in scratch.photons.iter_mut().zip(&scratch.exponent) {
            *photons *= (-exponent).exp();
        }
        self.response
            .signal(&mut scratch.photons, at.into(), &direction)
    }

    /// Density times length of every material between the source and the detector plane.
    fn integrate(
        &self,
        from: &Point3<f64>,
        direction: &Vector3<f64>,
        length_mm: f64,
        mass: &mut [f64],
    ) {
        mass.fill(0.0);
        let Transport {
            phantom, lattice, ..
        } = self.transport;
        let ray = lattice.ray(from, direction);
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
