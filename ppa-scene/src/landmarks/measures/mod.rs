//! Measures of a limb and its landmarks, from which the gates decide.

mod fibula;
mod neighbour;
mod sections;
mod shaft;
mod size;
mod support;

use ppa_ct::Volume;
use ppa_mesh::Mesh;

pub use fibula::Fibula;
pub use neighbour::Neighbour;
pub use shaft::Shaft;
pub use size::LimbSize;
pub use support::Support;

use crate::landmarks::choices::LandmarkError;
use crate::landmarks::found::Landmarks;
use sections::LimbSections;

/// Numbers of one limb; `ct` frame, mm.
#[derive(Debug, Clone, PartialEq)]
pub struct LimbMeasures {
    /// Length, volume and girth.
    pub size: LimbSize,
    /// How the limb touches its supporting plane.
    pub support: Support,
    /// Traces of another limb.
    pub neighbour: Option<Neighbour>,
    /// The shaft of the largest bone; `None` where too little of one is seen.
    pub shaft: Option<Shaft>,
    /// The thinner of two adjacent bones; `None` if there is no such pair.
    pub fibula: Option<Fibula>,
}

impl LimbMeasures {
    /// Measures a limb whose landmarks are known.
    ///
    /// `limb` is the skin in the `ct` frame, `mask` one value per voxel of `volume`.
    ///
    /// # Errors
    /// [`LandmarkError::Reslice`] when the scan cannot be cut across the limb.
    pub fn of(
        volume: &Volume,
        limb: &Mesh,
        mask: &[bool],
        landmarks: &Landmarks,
    ) -> Result<Self, LandmarkError> {
        let sections = LimbSections::of(volume, mask, landmarks)?;
        Ok(Self {
            size: LimbSize::of(volume, mask, &sections),
            support: Support::of(limb, landmarks, volume.grid())?,
            neighbour: Neighbour::of(&sections),
            shaft: Shaft::of(&sections, landmarks),
            fibula: Fibula::of(&sections, landmarks),
        })
    }
}
