//! Criteria for a table top, and errors when none is found.

use serde::{Deserialize, Serialize};

use crate::room::device::XrayDevice;

/// Criteria for a table top.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct PlaneSettings {
    /// Largest distance from the plane of a point that belongs to it, mm.
    pub threshold_mm: f64,
    /// Planes tried per search.
    pub iterations: u32,
    /// Upward direction, to which the normal of the result points.
    pub up: [f64; 3],
    /// Largest angle between normal and up, degrees.
    pub max_tilt_deg: f64,
    /// Cell of the lattice that separates connected patches, mm.
    pub cell_mm: f64,
    /// Smallest area of a table top, mm².
    pub min_area_mm2: f64,
    /// Box to search in (low and high corner), mm.
    pub region: Option<[[f64; 3]; 2]>,
    /// Central beam: the source and a direction. The table is the first large patch that it hits;
    /// without a beam it is the largest patch.
    pub beam: Option<[[f64; 3]; 2]>,
    /// Smallest distance from the source to the table, mm: excludes collimator and housing.
    pub min_beam_mm: f64,
}

impl Default for PlaneSettings {
    fn default() -> Self {
        Self {
            threshold_mm: 10.0,
            iterations: 1000,
            up: [0.0, 0.0, 1.0],
            max_tilt_deg: 20.0,
            cell_mm: 60.0,
            min_area_mm2: 60_000.0,
            region: None,
            beam: None,
            min_beam_mm: 300.0,
        }
    }
}

impl PlaneSettings {
    /// The default for a device: up is against its beam, the table is what the beam hits first.
    pub fn for_device(device: &XrayDevice) -> Self {
        let (source, beam) = (device.source(), device.beam_direction());
        Self {
            up: (-beam).into(),
            beam: Some([source.coords.into(), beam.into()]),
            ..Self::default()
        }
    }

    /// Checks that the numbers are in range.
    pub(crate) fn check(&self) -> Result<(), PlaneError> {
        let positive = [
            ("threshold_mm", self.threshold_mm),
            ("iterations", f64::from(self.iterations)),
            ("cell_mm", self.cell_mm),
            ("min_area_mm2", self.min_area_mm2),
        ];
        for (name, found) in positive {
            if !(found > 0.0 && found.is_finite()) {
                return Err(PlaneError::Setting {
                    name,
                    found,
                    expected: "a positive number",
                });
            }
        }
        if !(0.0..=90.0).contains(&self.max_tilt_deg) {
            return Err(PlaneError::Setting {
                name: "max_tilt_deg",
                found: self.max_tilt_deg,
                expected: "0 to 90 degrees",
            });
        }
        if let Some([low, high]) = self.region
            && let Some(axis) = (0..3).find(|axis| {
                low[*axis].is_nan() || high[*axis].is_nan() || low[*axis] > high[*axis]
            })
        {
            return Err(PlaneError::Setting {
                name: "region",
                found: low[axis],
                expected: "a low corner below the high one",
            });
        }
        if self.min_beam_mm.is_nan() {
            return Err(PlaneError::Setting {
                name: "min_beam_mm",
                found: self.min_beam_mm,
                expected: "a length",
            });
        }
        Ok(())
    }
}

/// Why no table was found.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum PlaneError {
    /// A setting is out of range.
    #[error("{name} is {found}, expected {expected}")]
    Setting {
        /// Field of [`PlaneSettings`].
        name: &'static str,
        /// Its value.
        found: f64,
        /// What it should be.
        expected: &'static str,
    },
    /// Too few points to fit a plane.
    #[error("{found} finite points in the region, expected at least {expected}")]
    TooFewPoints {
        /// Points left after the region was cut out.
        found: usize,
        /// Points needed.
        expected: usize,
    },
    /// The points span no plane.
    #[error("all {found} points in the region lie on one line, expected a surface")]
    OneLine {
        /// Number of points searched.
        found: usize,
    },
    /// No patch is flat, level, large enough and in the right place.
    #[error(
        "no plane found: none of the {points} points lie in a connected flat patch of {min_area_mm2} mm² \
         or more, within {max_tilt_deg} degrees of level{}",
        if *beam { ", under the central beam" } else { "" }
    )]
    NoPlane {
        /// Number of points searched.
        points: usize,
        /// Requested smallest area.
        min_area_mm2: f64,
        /// Requested largest tilt.
        max_tilt_deg: f64,
        /// Whether the patch had to be under the beam.
        beam: bool,
    },
}
