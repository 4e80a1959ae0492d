//! An MC-GPU input file and all files named in it.

use std::path::Path;

use ppa_core::random::Philox;
use rayon::prelude::*;

use crate::beam::detector::Detector;
use crate::beam::projection::Projection;
use crate::beam::source::{Collimation, Source};
use crate::beam::spectrum::Spectrum;
use crate::matter::material::Material;
use crate::mcgpu::error::McgpuError;
use crate::mcgpu::input::Input;
use crate::mcgpu::material_file::read_material;
use crate::mcgpu::sections::MaterialSource;
use crate::mcgpu::trajectory::Station;
use crate::mcgpu::voxel_file::VoxelFile;
use crate::phantom::voxels::VoxelPhantom;
use crate::transport::stream::Stream;

/// Largest number of square pixels along a side of an oblong one.
const MOST_PARTS: u32 = 32;

/// Smallest field, mm on the detector, for a pencil or fan beam without width.
const NARROWEST_MM: f64 = 1e-3;

/// An input file of MC-GPU v1.3 with its geometry, materials and spectrum, ready to run.
///
/// ```no_run
/// use std::ops::ControlFlow;
/// use ppa_xray::mcgpu::{ScanDose, Simulation};
/// # fn main() -> Result<(), Box<dyn std::error::Error>> {
/// let simulation = Simulation::read("scan.in")?;
/// let mut scan_dose = ScanDose::new(&simulation);
/// for station in simulation.input().stations() {
///     let length = simulation.input().run_length;
///     let (radiograph, dose) = simulation.analog(&station, length, |_| ControlFlow::Continue(()))?;
///     simulation.write_image("results".as_ref(), &station, &radiograph)?;
///     if let Some(dose) = dose {
///         scan_dose.add(&simulation, &dose)?;
///     }
/// }
/// scan_dose.write("results".as_ref(), &simulation)?;
/// # Ok(())
/// # }
/// ```
///
/// [`Simulation::projection`] gives the exposure for the fast engine.
#[derive(Debug)]
pub struct Simulation {
    input: Input,
    phantom: VoxelPhantom,
    /// Material number in the input file, from 0, of each material of the phantom.
    listed: Vec<u8>,
    spectrum: Spectrum,
    square_pixels: [u32; 2],
}

impl Simulation {
    /// Reads an input file and all files named in it; paths are relative to its folder.
    ///
    /// As in MC-GPU, material files that no voxel needs must exist but are not read.
    ///
    /// # Errors
    /// [`McgpuError`] naming the file, the line, what was found and what was expected.
    pub fn read(path: impl AsRef<Path>) -> Result<Self, McgpuError> {
        Self::with_input(Input::read(path)?)
    }

    /// Reads the files named in an input that was already read, and possibly changed.
    ///
    /// # Errors
    /// The same as [`Simulation::read`].
    pub fn with_input(input: Input) -> Result<Self, McgpuError> {
        let square_pixels = square_pixels(&input)?;
        check_files(&input)?;
        let spectrum = Spectrum::from_spc(&input.spectrum.path)?;
        let voxels = VoxelFile::read(&input.voxels.path)?;
        if let Some(dose) = &input.voxel_dose
            && (0..3).any(|axis| dose.first[axis] >= voxels.size[axis])
        {
            return Err(McgpuError::DoseRegion {
                path: input.path,
                first: dose.first.map(|voxel| voxel + 1),
                size: voxels.size,
            });
        }
        let listed = voxels.materials();
        if let Some(&highest) = listed
            .last()
            .filter(|&&last| usize::from(last) >= input.materials.len())
        {
            return Err(McgpuError::MaterialNumber {
                path: voxels.path,
                input: input.path,
                found: highest + 1,
                listed: input.materials.len(),
            });
        }
        let materials = listed
            .par_iter()
            .map(|&index| material(&input, usize::from(index), &spectrum))
            .collect::<Result<Vec<_>, _>>()?;
        let phantom = voxels
            .into_phantom(materials)
            .map_err(|source| McgpuError::Phantom {
                path: input.voxels.path.clone(),
                source,
            })?;
        Ok(Self {
            input,
            phantom,
            listed,
            spectrum,
            square_pixels,
        })
    }

    /// Contents of the input file.
    pub fn input(&self) -> &Input {
        &self.input
    }

    /// The voxels, in mm; the axes and the origin are those of the input file.
    pub fn phantom(&self) -> &VoxelPhantom {
        &self.phantom
    }

    /// Energies of the photons.
    pub fn spectrum(&self) -> &Spectrum {
        &self.spectrum
    }

    /// The exposure at one of [`Input::stations`].
    ///
    /// Oblong pixels are divided into square ones, which [`Simulation::image`] merges again.
    pub fn projection(&self, station: &Station) -> Projection {
        let input = &self.input;
        let [across, along] = self.square_pixels;
        let pixel_mm = 10.0 * input.detector_cm[0] / f64::from(input.pixels[0] * across);
        let source_detector_mm = 10.0 * input.source_detector_cm;
        let collimation = match input.apertures_deg {
            None => Collimation::Detector,
            Some(apertures_deg) => Collimation::Rectangle {
                size_mm: apertures_deg.map(|aperture_deg| {
                    let half = 0.5 * aperture_deg.to_radians();
                    (2.0 * source_detector_mm * half.tan()).max(NARROWEST_MM)
                }),
                centre_mm: [0.0; 2],
            },
        };
        let detector =
            Detector::centred(input.pixels[0] * across, input.pixels[1] * along, pixel_mm);
        Projection {
            source: Source {
                collimation,
                ..Source::default()
            },
            ..Projection::new(station.ct_from_device(), source_detector_mm, detector)
        }
    }

    /// Replaces the seed of the file.
    pub fn set_seed(&mut self, seed: u64) {
        self.input.seed = seed;
    }

    /// Seed of a projection: that of the file for the first one, and independent ones for the others.
    pub fn seed(&self, station: &Station) -> u64 {
        if station.number == 0 {
            return self.input.seed;
        }
        let index = u64::from(station.number);
        let mut rng = Philox::new(self.input.seed, Stream::Projection as u32, index);
        let mut word = || (rng.unit() * 4_294_967_296.0) as u64;
        word() << 32 | word()
    }

    /// Line of the material list, from 0, of each material of the phantom.
    pub(crate) fn listed(&self) -> &[u8] {
        &self.listed
    }

    /// Square pixels that make up a pixel of the image, along columns and rows.
    pub(crate) fn square_pixels(&self) -> [u32; 2] {
        self.square_pixels
    }
}

/// Checks that every file exists before any is read.
fn check_files(input: &Input) -> Result<(), McgpuError> {
    let mut files = vec![
        (
            "spectrum file".to_owned(),
            input.spectrum.line,
            &input.spectrum.path,
            "",
        ),
        (
            "voxel file".to_owned(),
            input.voxels.line,
            &input.voxels.path,
            "",
        ),
    ];
    for (index, material) in input.materials.iter().enumerate() {
        if let MaterialSource::File(path) = &material.source {
            let hint = "; use ppa:NAME for a material of the built-in library";
            files.push((
                format!("material file {}", index + 1),
                material.line,
                path,
                hint,
            ));
        }
    }
    match files.into_iter().find(|(_, _, path, _)| !path.is_file()) {
        None => Ok(()),
        Some((what, line, file, hint)) => Err(McgpuError::Missing {
            input: input.path.clone(),
            line,
            what,
            file: file.clone(),
            hint,
        }),
    }
}

/// Reads the material in a line of the list and checks that its tables cover the spectrum.
fn material(input: &Input, index: usize, spectrum: &Spectrum) -> Result<Material, McgpuError> {
    let listed = &input.materials[index];
    let path = match &listed.source {
        MaterialSource::File(path) => path,
        MaterialSource::Library(name) => {
            return Material::named(name).map_err(|source| McgpuError::Named {
                input: input.path.clone(),
                line: listed.line,
                source,
            });
        }
    };
    let material = read_material(path)?;
    let (low_kev, high_kev) = (spectrum.edges_kev()[0], spectrum.max_energy_kev());
    let [table_low_kev, table_high_kev] = material.energy_range_kev();
    if low_kev < table_low_kev || high_kev > table_high_kev {
        return Err(McgpuError::Energies {
            spectrum: input.spectrum.path.clone(),
            low_kev,
            high_kev,
            material: path.clone(),
            table_low_kev,
            table_high_kev,
        });
    }
    Ok(material)
}

/// Numbers of parts along columns and rows that make the pixels square.
fn square_pixels(input: &Input) -> Result<[u32; 2], McgpuError> {
    let [width_cm, height_cm] = [0, 1].map(|i| input.detector_cm[i] / f64::from(input.pixels[i]));
    (1..=MOST_PARTS)
        .map(|across| {
            let along = f64::from(across) * height_cm / width_cm;
            (across, along)
        })
        .find(|(_, along)| {
            let parts = along.round();
            (1.0..=f64::from(MOST_PARTS)).contains(&parts) && (along / parts - 1.0).abs() < 1e-6
        })
        .map(|(across, along)| [across, along.round() as u32])
        .ok_or_else(|| McgpuError::PixelShape {
            path: input.path.clone(),
            width_cm,
            height_cm,
        })
}
