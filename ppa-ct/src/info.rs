//! Output of `ppa ct info`.

use serde::Serialize;

use crate::scan::{Scan, SeriesSummary, Warning};
use crate::volume::Volume;

/// Facts about a scan under stable keys.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Info {
    /// Voxels along i, j, k.
    pub size: [usize; 3],
    /// Distance between neighbouring centres along i, j, k.
    pub spacing_mm: [f64; 3],
    /// Centre of the first voxel, LPS.
    pub origin_mm: [f64; 3],
    /// Rows of the matrix whose columns are the unit axes i, j, k in LPS.
    pub direction: [[f64; 3]; 3],
    /// Smallest value.
    pub hu_min: f32,
    /// Largest value.
    pub hu_max: f32,
    /// Sum over all voxels; exact if the values are integers.
    pub hu_sum: f64,
    /// Modality the source declares.
    pub modality: Option<String>,
    /// DICOM series read; empty for other formats.
    pub series: Vec<SeriesSummary>,
    /// Warnings of the reader.
    pub warnings: Vec<Warning>,
}

impl Info {
    /// Collects the facts about `scan`.
    pub fn of(scan: &Scan) -> Self {
        let facts = Self::of_volume(&scan.volume);
        Self {
            modality: scan.modality.clone(),
            series: scan.series.clone(),
            warnings: scan.warnings.clone(),
            ..facts
        }
    }

    /// Collects the facts about a volume that was not read from a file.
    pub fn of_volume(volume: &Volume) -> Self {
        let grid = volume.grid();
        let direction = grid.direction();
        let (hu_min, hu_max) = volume.values().range();
        Self {
            size: grid.size(),
            spacing_mm: grid.spacing_mm().into(),
            origin_mm: grid.origin_mm().coords.into(),
            direction: [0, 1, 2].map(|row| [0, 1, 2].map(|axis| direction[(row, axis)])),
            hu_min,
            hu_max,
            hu_sum: volume.values().sum(),
            modality: None,
            series: Vec::new(),
            warnings: Vec::new(),
        }
    }
}
