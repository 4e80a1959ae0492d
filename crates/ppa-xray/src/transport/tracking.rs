//! One photon history: source, Woodcock flight, interactions, detector plane.

use std::ops::Range;

use nalgebra::{Point3, Vector3};

use crate::beam::emitter::{Emission, Emitter};
use crate::beam::projection::{Projection, ProjectionError, scattered};
use crate::beam::spectrum::Spectrum;
use crate::detector::response::Response;
use crate::matter::sampler::MaterialTables;
use crate::phantom::lattice::{Lattice, Walk};
use crate::phantom::voxels::VoxelPhantom;
use crate::philox::Philox;
use crate::transport::attenuation::{
    Attenuation, CEILING_KEV, CUTOFF_KEV, Coefficients, Majorants,
};
use crate::transport::score::{Arrival, Score};
use crate::transport::stream::Stream;
use crate::transport::tally::Category;

/// Why a simulation cannot run.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum TransportError {
    /// Source, detector and phantom do not fit together.
    #[error(transparent)]
    Projection(#[from] ProjectionError),
    /// The spectrum reaches outside the range of the transport.
    #[error(
        "{percent:.3} % of the spectrum lies outside {CUTOFF_KEV} to {CEILING_KEV} keV, where photons are followed"
    )]
    Spectrum {
        /// Share of the photons outside the range.
        percent: f64,
    },
    /// A material has no data where the spectrum has photons.
    #[error(
        "{percent:.3} % of the spectrum lies outside {low_kev} to {high_kev} keV, where material {material:?} has data"
    )]
    MaterialRange {
        /// The material.
        material: String,
        /// Its lowest energy.
        low_kev: f64,
        /// Its highest energy.
        high_kev: f64,
        /// Share of the photons outside the range.
        percent: f64,
    },
    /// A number in the settings is out of range.
    #[error("{what} is {found}, expected {expected}")]
    Setting {
        /// Which setting.
        what: &'static str,
        /// What it was.
        found: f64,
        /// What it may be.
        expected: &'static str,
    },
}

/// Tissue denser than this (lung, foam) may lie neither behind the detector nor on the source.
pub(crate) const SOLID_G_CM3: f32 = 0.3;

/// Everything the histories of one projection share.
pub(crate) struct Transport<'a> {
    pub phantom: &'a VoxelPhantom,
    pub spectrum: &'a Spectrum,
    pub projection: &'a Projection,
    pub emitter: Emitter,
    pub response: Response,
    pub lattice: Lattice,
    pub attenuation: Attenuation,
    samplers: Vec<MaterialTables>,
    majorants: Majorants,
}

/// A photon under way, in the device frame.
struct Photon {
    position_mm: Point3<f64>,
    direction: Vector3<f64>,
    energy_kev: f64,
    category: Category,
}

/// How a straight flight ends.
enum Flight {
    Escape,
    Collision {
        distance_mm: f64,
        /// Index of the voxel in the phantom.
        voxel: usize,
        material: u8,
        coefficients: Coefficients,
        /// Uniform in [0, `coefficients.total`).
        lot: f32,
    },
}

impl<'a> Transport<'a> {
    pub fn new(
        phantom: &'a VoxelPhantom,
        spectrum: &'a Spectrum,
        projection: &'a Projection,
    ) -> Result<Self, TransportError> {
        let emitter = Emitter::new(projection, spectrum)?;
        let response = Response::new(&projection.receptor, projection.detector.centre_mm)
            .map_err(ProjectionError::from)?;
        check_placement(phantom, projection)?;
        let outside = |[low_kev, high_kev]: [f64; 2]| -> f64 {
            spectrum
                .bins()
                .filter(|(energy_kev, _)| !(low_kev..=high_kev).contains(energy_kev))
                .map(|(_, probability)| probability)
                .sum()
        };
        let percent = 100.0 * outside([CUTOFF_KEV, CEILING_KEV]);
        if percent > 1e-2 {
            return Err(TransportError::Spectrum { percent });
        }
        for material in phantom.materials() {
            let [low_kev, high_kev] = material.energy_range_kev();
            let percent = 100.0 * outside([low_kev, high_kev]);
            if percent > 1e-2 {
                return Err(TransportError::MaterialRange {
                    material: material.name().to_owned(),
                    low_kev,
                    high_kev,
                    percent,
                });
            }
        }
        let samplers: Vec<_> = phantom
            .materials()
            .iter()
            .map(MaterialTables::new)
            .collect();
        let attenuation = Attenuation::new(&samplers);
        Ok(Self {
            phantom,
            spectrum,
            projection,
            emitter,
            response,
            lattice: Lattice::new(phantom.grid(), &projection.ct_from_device),
            majorants: Majorants::new(phantom, &attenuation),
            attenuation,
            samplers,
        })
    }

    /// Follows the `histories` of a seed, one after the other, and tells `score` what they leave.
    pub fn follow(&self, seed: u64, histories: Range<u64>, score: &mut impl Score) {
        for history in histories {
            let mut rng = Philox::new(seed, Stream::History as u32, history);
            self.history(&mut rng, score);
            score.finish(0);
        }
    }

    fn history(&self, rng: &mut Philox, score: &mut impl Score) {
        let Emission {
            origin_mm,
            direction,
            energy_kev,
        } = self.emitter.emit(rng);
        let mut photon = Photon {
            position_mm: origin_mm,
            direction,
            energy_kev,
            category: Category::Primary,
        };
        score.emit(0, photon.energy_kev);
        while photon.energy_kev >= CUTOFF_KEV {
            let to_plane_mm = self.distance_to_plane_mm(&photon);
            match self.fly(&photon, to_plane_mm, rng) {
                Flight::Escape if to_plane_mm.is_finite() => {
                    let at = photon.position_mm + photon.direction * to_plane_mm;
                    let arrival = Arrival {
                        x_mm: at.x,
                        y_mm: at.y,
                        direction: photon.direction,
                        energy_kev: photon.energy_kev,
                        category: photon.category,
                    };
                    return score.arrive(0, &arrival, rng);
                }
                Flight::Escape => return score.escape(0, photon.energy_kev),
                Flight::Collision {
                    distance_mm,
                    voxel,
                    material,
                    coefficients,
                    lot,
                } => {
                    photon.position_mm += photon.direction * distance_mm;
                    let tables = &self.samplers[usize::from(material)];
                    if lot < coefficients.photoelectric {
                        return score.deposit(0, voxel, photon.energy_kev);
                    } else if lot < coefficients.with_compton {
                        let (cos_theta, energy_kev) = tables.sample_compton(photon.energy_kev, rng);
                        photon.scatter(cos_theta, Category::Compton, rng);
                        // Below the cutoff the rest of the photon stays here too.
                        let leaves = energy_kev >= CUTOFF_KEV;
                        let carried_kev = if leaves { energy_kev } else { 0.0 };
                        score.deposit(0, voxel, photon.energy_kev - carried_kev);
                        photon.energy_kev = energy_kev;
                    } else {
                        let cos_theta = tables.sample_rayleigh(photon.energy_kev, rng);
                        photon.scatter(cos_theta, Category::Rayleigh, rng);
                    }
                }
            }
        }
    }

    /// Infinite for a photon that flies away from the plane.
    #[inline]
    fn distance_to_plane_mm(&self, photon: &Photon) -> f64 {
        if photon.direction.z > 0.0 {
            (self.projection.source_detector_mm - photon.position_mm.z) / photon.direction.z
        } else {
            f64::INFINITY
        }
    }

    /// Woodcock tracking with a majorant per block: the optical depth to the next tentative
    /// collision is spent block by block, a real collision is accepted with probability μ/μ_max.
    fn fly(&self, photon: &Photon, to_plane_mm: f64, rng: &mut Philox) -> Flight {
        const EDGE: f64 = Majorants::EDGE as f64;
        let ray = self.lattice.ray(&photon.position_mm, &photon.direction);
        let Some((enter, leave)) = self.lattice.clip(&ray) else {
            return Flight::Escape;
        };
        let end = leave.min(to_plane_mm);
        if enter >= end {
            return Flight::Escape;
        }
        let energy = self.attenuation.locate(photon.energy_kev);
        let bounds = self.majorants.row(photon.energy_kev);
        let size = self.lattice.size;
        let mut walk = Walk::new(&ray, enter, self.majorants.blocks, EDGE);
        let mut at = enter;
        let mut depth = exponential(rng);
        loop {
            let bound = self.majorants.bound(bounds, walk.index);
            let (axis, next) = walk.exit();
            let block_end = next.min(end);
            loop {
                let tentative = at + depth / bound;
                if !matches!(
                    tentative.partial_cmp(&block_end),
                    Some(std::cmp::Ordering::Less)
                ) {
                    depth -= (block_end - at).max(0.0) * bound;
                    at = block_end;
                    break;
                }
                at = tentative;
                let cell = ray.origin + ray.slope * at;
                // Rounding may place the point just outside the block, where the bound does not hold.
                let voxel = |axis: usize| {
                    let low = walk.cell[axis] as usize * Majorants::EDGE as usize;
                    let high = (low + Majorants::EDGE as usize).min(size[axis]) - 1;
                    (cell[axis] as usize).clamp(low, high)
                };
                let index = voxel(0) + size[0] * (voxel(1) + size[1] * voxel(2));
                let material = self.phantom.material()[index];
                let density = self.phantom.density_g_cm3()[index];
                let coefficients = self.attenuation.at(material, energy);
                let lot = rng.unit() * bound;
                if lot < f64::from(density * coefficients.total) {
                    return Flight::Collision {
                        distance_mm: at,
                        voxel: index,
                        material,
                        coefficients,
                        lot: lot as f32 / density,
                    };
                }
                depth = exponential(rng);
            }
            if next >= end || !walk.advance(axis) {
                return Flight::Escape;
            }
        }
    }
}

impl Photon {
    #[inline]
    fn scatter(&mut self, cos_theta: f64, by: Category, rng: &mut Philox) {
        self.direction = scattered(&self.direction, cos_theta, rng);
        self.category = match self.category {
            Category::Primary => by,
            _ => Category::Multiple,
        };
    }
}

/// Exponentially distributed with mean 1.
#[inline]
fn exponential(rng: &mut Philox) -> f64 {
    // 1 − u lies in (0, 1], so the logarithm stays finite.
    -(1.0 - rng.unit()).ln()
}

fn check_placement(phantom: &VoxelPhantom, projection: &Projection) -> Result<(), ProjectionError> {
    let device_from_ct = projection.ct_from_device.inverse();
    let corners = phantom.corners_ct().map(|corner| device_from_ct * corner);
    if !projection.field_may_meet(&corners) {
        return Err(ProjectionError::FieldMissesPhantom);
    }
    let grid = phantom.grid();
    let plane_mm = projection.source_detector_mm;
    if corners.iter().any(|corner| corner.z > plane_mm) {
        let hidden = phantom
            .density_g_cm3()
            .iter()
            .enumerate()
            .filter(|(_, density)| **density > SOLID_G_CM3)
            .map(|(index, &density)| (grid.voxel(index), density))
            .map(|(voxel, density)| {
                let centre = device_from_ct * grid.centre(voxel.map(|v| v as f64));
                (voxel, density, centre.z - plane_mm)
            })
            .find(|(_, _, depth_mm)| *depth_mm > 0.0);
        if let Some((voxel, density_g_cm3, depth_mm)) = hidden {
            return Err(ProjectionError::DetectorInsidePhantom {
                voxel,
                density_g_cm3,
                depth_mm,
            });
        }
    }
    let source = grid.voxel_from_ct() * Point3::from(projection.ct_from_device.translation.vector);
    let nearest = source.coords.map(f64::round);
    let inside =
        (0..3).all(|axis| nearest[axis] >= 0.0 && nearest[axis] < grid.size()[axis] as f64);
    if inside {
        let voxel = [0, 1, 2].map(|axis| nearest[axis] as usize);
        let density_g_cm3 = phantom.density_g_cm3()[grid.index(voxel)];
        if density_g_cm3 > SOLID_G_CM3 {
            return Err(ProjectionError::SourceInsidePhantom {
                voxel,
                density_g_cm3,
            });
        }
    }
    Ok(())
}
