//! Why a pose could not be made.

use ppa_dataset::{FileError, Stopped};

use crate::cut_error::CutError;
use crate::radiograph::JointError;

/// Why a pose could not be made.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum PoseError {
    /// A body shape cannot be made.
    #[error(transparent)]
    Shape(#[from] ppa_mesh::ShapeError),
    /// A skin cannot be rendered.
    #[error(transparent)]
    Body(#[from] ppa_depth::BodyError),
    /// The limb could not be laid on the table.
    #[error(transparent)]
    Place(#[from] ppa_scene::PlaceError),
    /// A depth image cannot be made.
    #[error(transparent)]
    Depth(#[from] ppa_depth::DepthError),
    /// A region of interest cannot be computed.
    #[error(transparent)]
    Roi(#[from] ppa_depth::RoiError),
    /// More of a region is cut than the plan allows.
    #[error(transparent)]
    Cut(#[from] CutError),
    /// The view from the x-ray tube, which shows cuts, cannot be computed.
    #[error("the view from the x-ray tube cannot be computed")]
    Tube(#[from] ppa_depth::CameraError),
    /// The rotations of the plan are invalid.
    #[error(transparent)]
    Rotation(#[from] ppa_scene::SweepError),
    /// The voxels of the joint cannot be made.
    #[error(transparent)]
    Joint(#[from] JointError),
    /// The radiograph cannot be computed.
    #[error(transparent)]
    Transport(#[from] ppa_xray::TransportError),
    /// The histories of an analog radiograph cannot be followed.
    #[error(transparent)]
    Run(#[from] ppa_xray::RunError),
    /// The file of these histories cannot be read or written.
    #[error(transparent)]
    Tally(#[from] ppa_xray::TallyError),
    /// The run was stopped within a radiograph, whose histories are kept.
    #[error(transparent)]
    Stopped(#[from] Stopped),
    /// The radiograph's files cannot be written.
    #[error(transparent)]
    Output(#[from] ppa_xray::OutputError),
    /// A file cannot be read or written.
    #[error(transparent)]
    File(#[from] FileError),
}
