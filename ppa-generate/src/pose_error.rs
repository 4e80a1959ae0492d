//! Why a pose could not be made.

use ppa_dataset::{FileError, Stopped};

use crate::cut_error::CutError;
use crate::radiograph::JointError;

/// Why a pose could not be made.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum PoseError {
    /// A body shape.
    #[error(transparent)]
    Shape(#[from] ppa_mesh::ShapeError),
    /// A skin that cannot be rendered.
    #[error(transparent)]
    Body(#[from] ppa_depth::BodyError),
    /// The limb could not be laid on the table.
    #[error(transparent)]
    Place(#[from] ppa_scene::PlaceError),
    /// A depth image.
    #[error(transparent)]
    Depth(#[from] ppa_depth::DepthError),
    /// A region of interest.
    #[error(transparent)]
    Roi(#[from] ppa_depth::RoiError),
    /// More of a region is cut than the plan allows.
    #[error(transparent)]
    Cut(#[from] CutError),
    /// The x-ray tube as a camera that looks for cuts.
    #[error("the view from the x-ray tube cannot be computed")]
    Tube(#[from] ppa_depth::CameraError),
    /// The rotations of the plan.
    #[error(transparent)]
    Rotation(#[from] ppa_scene::SweepError),
    /// The voxels of the joint.
    #[error(transparent)]
    Joint(#[from] JointError),
    /// The radiograph.
    #[error(transparent)]
    Transport(#[from] ppa_xray::TransportError),
    /// The histories of an analog radiograph.
    #[error(transparent)]
    Run(#[from] ppa_xray::RunError),
    /// The file that keeps them.
    #[error(transparent)]
    Tally(#[from] ppa_xray::TallyError),
    /// It was asked to stop within a radiograph, whose histories are kept.
    #[error(transparent)]
    Stopped(#[from] Stopped),
    /// The radiograph's files.
    #[error(transparent)]
    Output(#[from] ppa_xray::OutputError),
    /// A file.
    #[error(transparent)]
    File(#[from] FileError),
}
