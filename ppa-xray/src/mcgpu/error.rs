//! Errors of MC-GPU files.

use std::path::PathBuf;

use crate::beam::spectrum_error::SpectrumError;
use crate::image::output::OutputError;
use crate::matter::material_error::MaterialError;
use crate::phantom::voxels::PhantomError;

/// Why an MC-GPU input file, or a file named in it, cannot be used.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum McgpuError {
    /// The file cannot be read, or its gzip stream is broken.
    #[error("cannot read {}", path.display())]
    Read {
        /// The file.
        path: PathBuf,
        /// Error of the file system or of gzip.
        source: std::io::Error,
    },
    /// A file named in the input file does not exist.
    #[error(
        "{}, line {line}: {what} {} is not a file{hint}", input.display(), file.display()
    )]
    Missing {
        /// The input file.
        input: PathBuf,
        /// Line that names the file.
        line: u64,
        /// Purpose of the file, such as `material file 3`.
        what: String,
        /// The file, resolved against the input file.
        file: PathBuf,
        /// Suggestion for the line; empty or a sub-clause.
        hint: &'static str,
    },
    /// A line does not contain the expected value.
    #[error("{}, line {line}: found {found:?}, expected {expected}", path.display())]
    Line {
        /// The file.
        path: PathBuf,
        /// Line number, from 1.
        line: u64,
        /// Content of the line, shortened.
        found: String,
        /// Expected content.
        expected: String,
    },
    /// The file ends too early.
    #[error("{} ends after line {line}, expected {expected}", path.display())]
    Ends {
        /// The file.
        path: PathBuf,
        /// Number of the last line.
        line: u64,
        /// Expected next content.
        expected: String,
    },
    /// A section belongs to another version of MC-GPU.
    #[error(
        "{}, line {line}: section {section} is from another version ({found:?}), expected {expected} as in MC-GPU v1.3",
        path.display()
    )]
    Version {
        /// The input file.
        path: PathBuf,
        /// Line of the headline.
        line: u64,
        /// Name of the section.
        section: &'static str,
        /// The headline.
        found: String,
        /// Version of the section in MC-GPU v1.3.
        expected: &'static str,
    },
    /// The header specifies more voxels than the file can hold.
    #[error(
        "{}: the header specifies {} x {} x {} voxels, but {bytes} bytes hold at most {most}",
        path.display(), size[0], size[1], size[2]
    )]
    VoxelsMissing {
        /// The voxel file.
        path: PathBuf,
        /// Voxels along x, y, z.
        size: [u64; 3],
        /// Length of the file.
        bytes: u64,
        /// Voxels that a file of that length can hold.
        most: u64,
    },
    /// The voxels do not fit into memory.
    #[error(
        "{}: {} x {} x {} voxels need at least {needed_mb} MB of memory, but {available_mb} MB are available",
        path.display(), size[0], size[1], size[2]
    )]
    Memory {
        /// The voxel file.
        path: PathBuf,
        /// Voxels along x, y, z.
        size: [u64; 3],
        /// Memory needed, 10⁶ bytes.
        needed_mb: u64,
        /// Memory available, 10⁶ bytes.
        available_mb: u64,
    },
    /// A voxel refers to a material that the input file does not list.
    #[error("{} uses material {found}, but {} lists only {listed}", path.display(), input.display())]
    MaterialNumber {
        /// The voxel file.
        path: PathBuf,
        /// The input file.
        input: PathBuf,
        /// Highest material number of the voxels, from 1.
        found: u8,
        /// Number of materials listed.
        listed: usize,
    },
    /// The voxels whose dose is requested are outside the geometry.
    #[error(
        "{}: the dose region begins at voxel ({}, {}, {}), outside the geometry of {} x {} x {} voxels",
        path.display(), first[0], first[1], first[2], size[0], size[1], size[2]
    )]
    DoseRegion {
        /// The input file.
        path: PathBuf,
        /// First voxel, from 1.
        first: [usize; 3],
        /// Number of voxels of the geometry.
        size: [usize; 3],
    },
    /// The tables of a material do not cover the energies of the spectrum.
    #[error(
        "the spectrum {} extends from {low_kev} to {high_kev} keV, but {} only covers {table_low_kev} to {table_high_kev} keV",
        spectrum.display(), material.display()
    )]
    Energies {
        /// The spectrum file.
        spectrum: PathBuf,
        /// Lowest photon energy, keV.
        low_kev: f64,
        /// Highest photon energy, keV.
        high_kev: f64,
        /// The material file.
        material: PathBuf,
        /// Lowest energy of the tables, keV.
        table_low_kev: f64,
        /// Highest energy of the tables, keV.
        table_high_kev: f64,
    },
    /// The numbers of a material file are not a valid material.
    #[error("{} is not a usable material", path.display())]
    Material {
        /// The material file.
        path: PathBuf,
        /// What is wrong with the material.
        source: MaterialError,
    },
    /// The material of a `ppa:NAME` line is not in the library.
    #[error("{}, line {line}", input.display())]
    Named {
        /// The input file.
        input: PathBuf,
        /// Line that names the material.
        line: u64,
        /// What is wrong with the name.
        source: MaterialError,
    },
    /// The spectrum is invalid.
    #[error(transparent)]
    Spectrum(#[from] SpectrumError),
    /// The voxels are not a valid phantom.
    #[error("{} is not a usable geometry", path.display())]
    Phantom {
        /// The voxel file.
        path: PathBuf,
        /// What is wrong with the voxels.
        source: PhantomError,
    },
    /// Oblong pixels cannot be divided into a small number of square ones.
    #[error(
        "{}: pixels of {width_cm} cm by {height_cm} cm, expected sides in a ratio of two integers of at most 32",
        path.display()
    )]
    PixelShape {
        /// The input file.
        path: PathBuf,
        /// Width of a pixel, cm.
        width_cm: f64,
        /// Height of a pixel, cm.
        height_cm: f64,
    },
    /// An image or dose file cannot be written.
    #[error(transparent)]
    Output(#[from] OutputError),
}
