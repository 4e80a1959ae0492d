//! Options of every command that reads a scan.

use std::path::PathBuf;

use clap::Args;
use ppa_ct::{ReadError, ReadOptions, Scan, SeriesChoice, read_with};

#[derive(Debug, Args)]
pub struct ScanArgs {
    /// DICOM folder or file, or a volume in one file such as .nii.gz
    #[arg(value_name = "CT")]
    pub path: PathBuf,
    /// Series to read from a DICOM folder that contains several: its number or UID
    #[arg(long, value_name = "NUMBER")]
    series: Option<SeriesChoice>,
    /// Interpolate DICOM slices that are missing or unevenly spaced, instead of refusing the series
    #[arg(long)]
    fill_gaps: bool,
    /// Read modalities other than CT and values not in HU, instead of refusing them
    #[arg(long)]
    force: bool,
}

impl ScanArgs {
    pub fn options(&self) -> ReadOptions {
        ReadOptions {
            series: self.series.clone(),
            fill_gaps: self.fill_gaps,
            force: self.force,
        }
    }

    pub fn read(&self) -> Result<Scan, ReadError> {
        read_with(&self.path, &self.options())
    }
}
