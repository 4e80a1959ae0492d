//! The scene of the verification: a sphere of one material in the middle of a narrow beam, with a detector divided into rings behind it.

use std::f64::consts::PI;

use nalgebra::{Isometry3, Point3, Vector3};
use ppa_ct::Grid;

use crate::beam::detector::Detector;
use crate::beam::projection::Projection;
use crate::beam::source::{Collimation, Source};
use crate::beam::spectrum::Spectrum;
use crate::engine::analog::{AnalogSettings, analog};
use crate::engine::fast::fast;
use crate::engine::fast_settings::FastSettings;
use crate::image::radiograph::Radiograph;
use crate::matter::compton::ComptonModel;
use crate::matter::material::Material;
use crate::phantom::voxels::VoxelPhantom;

/// Voxels across the sphere.
const ACROSS: usize = 40;
const RADIUS_MM: f64 = 4.0;
/// Distances from the focus to the middle of the sphere, and from there to the detector.
pub(super) const SOURCE_MM: f64 = 300.0;
pub(super) const BEHIND_MM: f64 = 80.0;
/// Half the side of the field in the plane through the middle of the sphere.
const HALF_FIELD_MM: f64 = 4.4;
pub(super) const PIXELS: u32 = 40;
pub(super) const PIXEL_MM: f64 = 5.0;

/// Rings of the detector: up to 10°, 25°, 40° from the beam, and the rest to 60°.
pub(super) const RINGS: usize = 4;

pub(super) fn ring(pixel: usize) -> usize {
    let centre = detector().pixel_centre_mm(pixel);
    let angle_deg = (centre.coords.norm() / BEHIND_MM).atan().to_degrees();
    [10.0, 25.0, 40.0]
        .iter()
        .filter(|&&edge| angle_deg > edge)
        .count()
}

pub(super) fn detector() -> Detector {
    Detector::centred(PIXELS, PIXELS, PIXEL_MM)
}

pub(super) struct Scene {
    pub(super) material: Material,
    pub(super) density_g_cm3: f64,
    pub(super) energy_kev: f64,
}

impl Scene {
    /// Voxels whose centres are in the sphere.
    pub(super) fn phantom(&self) -> (VoxelPhantom, f64) {
        let voxel_mm = 2.0 * RADIUS_MM / ACROSS as f64;
        let first = Point3::from(Vector3::repeat(0.5 * voxel_mm - RADIUS_MM));
        let grid = Grid::axis_aligned([ACROSS; 3], Vector3::repeat(voxel_mm), first).unwrap();
        let density: Vec<f32> = (0..grid.len())
            .map(|index| {
                let centre = grid.centre(grid.voxel(index).map(|v| v as f64));
                if centre.coords.norm() < RADIUS_MM {
                    self.density_g_cm3 as f32
                } else {
                    0.0
                }
            })
            .collect();
        let filled = density.iter().filter(|density| **density > 0.0).count() as f64;
        // The sphere of the same volume.
        let radius_mm = (0.75 / PI * filled * voxel_mm.powi(3)).cbrt();
        let material = vec![0; grid.len()];
        let phantom = VoxelPhantom::new(grid, material, density, vec![self.material.clone()]);
        (phantom.unwrap(), radius_mm)
    }

    pub(super) fn projection(&self) -> Projection {
        let pose = Isometry3::translation(0.0, 0.0, -SOURCE_MM);
        let distance_mm = SOURCE_MM + BEHIND_MM;
        let side_mm = 2.0 * HALF_FIELD_MM * distance_mm / SOURCE_MM;
        Projection {
            source: Source {
                collimation: Collimation::Rectangle {
                    size_mm: [side_mm; 2],
                    centre_mm: [0.0; 2],
                },
                ..Source::default()
            },
            ..Projection::new(pose, distance_mm, detector())
        }
    }

    pub(super) fn simulate(&self, histories: u64, compton_model: ComptonModel) -> Radiograph {
        let spectrum = Spectrum::monoenergetic(self.energy_kev).unwrap();
        let settings = AnalogSettings {
            histories,
            seed: 3,
            compton_model,
        };
        analog(&self.phantom().0, &spectrum, &self.projection(), &settings).unwrap()
    }

    pub(super) fn fast(&self, scatter_histories: u64, scatter_pixel_mm: f64) -> Radiograph {
        let spectrum = Spectrum::monoenergetic(self.energy_kev).unwrap();
        let settings = FastSettings {
            dose_histories: f64::INFINITY,
            scatter_histories,
            scatter_pixel_mm,
            samples_per_side: 1,
            compton_model: ComptonModel::IncoherentFunction,
            seed: 4,
        };
        fast(&self.phantom().0, &spectrum, &self.projection(), &settings).unwrap()
    }

    /// Attenuation coefficient, 1/mm.
    pub(super) fn mu_per_mm(&self, energy_kev: f64) -> f64 {
        self.material.total_cm2_g(energy_kev).unwrap() * self.density_g_cm3 / 10.0
    }
}
