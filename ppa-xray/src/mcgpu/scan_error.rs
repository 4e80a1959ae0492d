//! Errors of scans that are interrupted and resumed.

use std::path::PathBuf;

use crate::image::output::OutputError;
use crate::mcgpu::dose_file::ScanDoseError;
use crate::run::analog_run::RunError;
use crate::run::tally_error::TallyError;
use crate::transport::tracking::TransportError;

/// Why a scan cannot be resumed, simulated or stored.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum ScanError {
    /// The tally file cannot be read or written, or is damaged.
    #[error(transparent)]
    Tally(#[from] TallyError),
    /// The tally file was written for another scan.
    #[error(
        "{} belongs to another scan: the input file, a file that it names, the seed, the number of histories, the engine or the version of ppa differ",
        path.display()
    )]
    OtherScan {
        /// The tally file.
        path: PathBuf,
    },
    /// The exposure is invalid.
    #[error(transparent)]
    Transport(#[from] TransportError),
    /// The histories of a projection cannot be followed.
    #[error(transparent)]
    Run(#[from] RunError),
    /// The dose belongs to another simulation.
    #[error(transparent)]
    Dose(#[from] ScanDoseError),
    /// An image or dose file cannot be written.
    #[error(transparent)]
    Output(#[from] OutputError),
    /// The tally file of a complete scan cannot be removed.
    #[error("cannot remove {}", path.display())]
    Remove {
        /// The tally file.
        path: PathBuf,
        /// Error of the file system.
        source: std::io::Error,
    },
}
