//! Sections of an input file that consist of several values: run length, trajectory, dose box, materials.

use std::path::{Path, PathBuf};

use nalgebra::Vector3;

use crate::mcgpu::error::McgpuError;
use crate::mcgpu::lines::columns;
use crate::mcgpu::values::Values;

/// Numbers below this are seconds, not histories.
const SECONDS_BELOW: f64 = 1e5;

/// Largest number of materials for one byte per voxel.
const MATERIALS: usize = 255;

/// Largest number of projections; a helical scan of ten turns with one projection per degree needs fewer.
const PROJECTIONS: u32 = 10_000;

/// Length of the run of each projection.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum RunLength {
    /// Photons emitted into the field.
    Histories(u64),
    /// Wall-clock time.
    Seconds(f64),
}

/// The path of source and detector around an axis along z.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Trajectory {
    /// Projections of the entire scan; with 1 the other fields are not used.
    pub projections: u32,
    /// Rotation from one projection to the next, degrees, from x towards y.
    pub step_deg: f64,
    /// Range of projections to simulate, by the angle of the source as seen from the axis, 0 along x.
    pub angles_of_interest_deg: [f64; 2],
    /// Distance of the source from the axis, which intersects the first central beam, cm.
    pub source_axis_cm: f64,
    /// Rise along z from one projection to the next, cm.
    pub rise_cm: f64,
}

/// The box of voxels whose dose is requested.
#[derive(Debug, Clone, PartialEq)]
pub struct VoxelDose {
    /// Name of the file to write.
    pub file: String,
    /// First voxel along x, y, z, from 0.
    pub first: [usize; 3],
    /// Last voxel along x, y, z, from 0, inclusive.
    pub last: [usize; 3],
}

/// Source of the data of a material.
#[derive(Debug, Clone, PartialEq)]
pub enum MaterialSource {
    /// An MC-GPU material file, `.mcgpu` or `.mcgpu.gz`.
    File(PathBuf),
    /// A material of this library, written as `ppa:NAME`.
    Library(String),
}

/// A line of the material list.
#[derive(Debug, Clone, PartialEq)]
pub struct MaterialLine {
    /// Line of the input file, from 1.
    pub line: u64,
    /// Material named in the line.
    pub source: MaterialSource,
}

/// Whether lengths are at most a kilometre in either direction.
pub(super) fn all_lengths<const N: usize>(lengths_cm: [f64; N]) -> bool {
    lengths_cm.iter().all(|length| length.abs() <= 1e5)
}

impl Values {
    pub fn run_length(&mut self) -> Result<RunLength, McgpuError> {
        let expected = "the number of histories, or a time in seconds below 100000";
        let [found] = self.number(expected, |[n]| (1e-3..=1e18).contains(&n))?;
        Ok(if found < SECONDS_BELOW {
            RunLength::Seconds(found)
        } else {
            RunLength::Histories(found as u64)
        })
    }

    pub fn trajectory(
        &mut self,
        [u, v, w]: [f64; 3],
        source_detector_cm: f64,
    ) -> Result<Trajectory, McgpuError> {
        let expected = format!("the number of projections, 0 to {PROJECTIONS}");
        let [projections] = self.number(&expected, |[n]| {
            (0.0..=f64::from(PROJECTIONS)).contains(&n) && n.fract() == 0.0
        })?;
        // MC-GPU treats 0 as 1.
        let projections = projections.max(1.0) as u32;
        if projections == 1 {
            return Ok(Trajectory {
                projections,
                step_deg: 0.0,
                angles_of_interest_deg: [0.0, 360.0],
                source_axis_cm: 0.0,
                rise_cm: 0.0,
            });
        }
        if w.abs() > 1e-5 * Vector3::new(u, v, w).norm() {
            return Err(self.lines.unexpected(
                projections.to_string().as_bytes(),
                "1 projection, since the beam is not perpendicular to the axis z",
            ));
        }
        let angle = |angle: &f64| angle.abs() <= 1e6;
        let [step_deg] = self.number("the angle between projections in degrees", |[step]| {
            angle(&step)
        })?;
        let angles_of_interest_deg = self.number(
            "the first and the last angle of interest",
            |angles: [f64; 2]| angles.iter().all(angle) && angles[0] <= angles[1],
        )?;
        let expected = "the distance from the source to the axis in cm, 0 to that of the detector";
        let [source_axis_cm] = self.number(expected, |[distance]| {
            (0.0..=source_detector_cm).contains(&distance)
        })?;
        let [rise_cm] = self.number(
            "the vertical translation between projections in cm",
            all_lengths,
        )?;
        Ok(Trajectory {
            projections,
            step_deg,
            angles_of_interest_deg,
            source_axis_cm,
            rise_cm,
        })
    }

    pub fn voxel_dose(&mut self) -> Result<VoxelDose, McgpuError> {
        let file = self.output_name("a dose file name")?;
        let (mut first, mut last) = ([0; 3], [0; 3]);
        for (axis, name) in ["x", "y", "z"].into_iter().enumerate() {
            let expected = format!("the first and the last voxel along {name}, counted from 1");
            let [low, high] = self.number(&expected, |[low, high]: [f64; 2]| {
                low.fract() == 0.0 && high.fract() == 0.0 && 1.0 <= low && low <= high && high < 1e9
            })?;
            (first[axis], last[axis]) = (low as usize - 1, high as usize - 1);
        }
        Ok(VoxelDose { file, first, last })
    }

    pub fn materials(&mut self, folder: &Path) -> Result<Vec<MaterialLine>, McgpuError> {
        let mut materials = Vec::new();
        while let Some(value) = self.next()? {
            if materials.len() == MATERIALS {
                return Err(self
                    .lines
                    .unexpected(value.as_bytes(), "at most 255 materials"));
            }
            let word = columns(value.as_bytes()).next().unwrap_or_default();
            materials.push(MaterialLine {
                line: self.lines.number(),
                source: match word.strip_prefix("ppa:") {
                    Some(name) => MaterialSource::Library(name.into()),
                    None => MaterialSource::File(folder.join(word)),
                },
            });
        }
        if materials.is_empty() {
            return Err(self.lines.ends("at least one material file"));
        }
        Ok(materials)
    }
}
