//! Why the studio cannot be opened, or cannot do what the page asks for.

use std::path::PathBuf;

use ppa_generate::{CaseError, JointError, PlanError, PoseError, PrepareError, SceneSetupError};

/// Why the studio cannot be opened, or cannot do what the page asks for.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum StudioError {
    /// A scan was given without the side of the limb.
    #[error("{} is a scan: give the side of its limb, --side l or --side r", .0.display())]
    NoSide(PathBuf),
    /// A plan names no case.
    #[error("{} names no case", .0.display())]
    NoCase(PathBuf),
    /// A dataset or a training, which the page cannot show.
    #[error("{} is a folder without a scan: a scan, a case or a plan can be opened", .0.display())]
    NotAScan(PathBuf),
    /// The built-in phantom.
    #[error("the built-in phantom cannot be written")]
    Phantom(#[source] Box<dyn std::error::Error + Send + Sync>),
    /// The case.
    #[error(transparent)]
    Case(#[from] CaseError),
    /// The plan.
    #[error(transparent)]
    Plan(#[from] PlanError),
    /// The scan, the limb or its landmarks.
    #[error(transparent)]
    Prepare(#[from] PrepareError),
    /// Room, table, cameras or beam.
    #[error(transparent)]
    Scene(#[from] SceneSetupError),
    /// The pose.
    #[error(transparent)]
    Pose(#[from] PoseError),
    /// Where the limb rests.
    #[error(transparent)]
    Place(#[from] ppa_scene::PlaceError),
    /// Voxels for the radiograph.
    #[error(transparent)]
    Joint(#[from] JointError),
    /// The radiograph.
    #[error(transparent)]
    Transport(#[from] ppa_xray::TransportError),
    /// Its presentation.
    #[error(transparent)]
    Presentation(#[from] ppa_xray::PresentationError),
    /// Its exposure index.
    #[error(transparent)]
    Receptor(#[from] ppa_xray::ReceptorError),
    /// The bones of the case.
    #[error(transparent)]
    Bones(#[from] ppa_label::BoneFileError),
    /// Their joint space.
    #[error(transparent)]
    JointSpace(#[from] ppa_label::JointSpaceError),
    /// The coarse scan.
    #[error(transparent)]
    Volume(#[from] ppa_ct::VolumeError),
    /// Its surface.
    #[error(transparent)]
    Surface(#[from] ppa_mesh::SurfaceError),
    /// A picture.
    #[error("the picture cannot be encoded")]
    Picture(#[from] image::ImageError),
    /// A value that the page sent.
    #[error("{0}")]
    Invalid(String),
    /// The file with the changes was written by someone else.
    #[error("{} was changed by another program: nothing was saved", .0.display())]
    ChangedElsewhere(PathBuf),
    /// A file that the person has not agreed to replace.
    #[error("{} exists", .0.display())]
    Exists(PathBuf),
    /// A later request of the page has replaced this one.
    #[error("a later request replaced this one")]
    Superseded,
    /// Random bytes for the address.
    #[error("the operating system gives no random numbers: {0}")]
    Random(getrandom::Error),
    /// The listening socket.
    #[error("the page cannot be served")]
    Serve(#[source] std::io::Error),
}
