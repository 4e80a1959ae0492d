//! Errors of opening the studio and of requests from its page.

use std::path::PathBuf;

use ppa_dataset::files::FileError;
use ppa_dataset::layout::LimbId;
use ppa_generate::{
    CaseError, FolderError, ForecastError, JointError, PlanError, PoseError, PrepareError,
    SceneSetupError,
};
use ppa_report::ContactSheetError;

/// Error of opening the studio or of a request from its page.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum StudioError {
    /// A scan was given without the side of the limb.
    #[error("{} is a scan: give the side of its limb, --side l or --side r", .0.display())]
    NoSide(PathBuf),
    /// The plan names no case.
    #[error("{} does not specify a case", .0.display())]
    NoCase(PathBuf),
    /// Frames are watched, but there are no networks.
    #[error("frames are watched, but no networks are given to judge them")]
    NoNetworks,
    /// A dataset, training runs or frames are open, but no limb.
    #[error("no limb is open")]
    NoLimb,
    /// A change of a limb that is not open any more; the open case.
    #[error("{} is open in another page, or since the program was started again: reload this page; nothing was changed", .0.display())]
    OtherLimb(PathBuf),
    /// The plan names no case for a limb.
    #[error("the plan next to the dataset has no case for {0}")]
    NotInPlan(LimbId),
    /// The quality report of a dataset.
    #[error(transparent)]
    Qa(#[from] ppa_report::QaError),
    /// The images and lists of a dataset.
    #[error(transparent)]
    Published(#[from] ppa_dataset::published::PublishedError),
    /// An image of a dataset.
    #[error(transparent)]
    Image(#[from] ppa_dataset::published::ImageFileError),
    /// A split of a dataset.
    #[error(transparent)]
    Split(#[from] ppa_dataset::SplitError),
    /// A table of readers.
    #[error(transparent)]
    Table(#[from] ppa_label::TableError),
    /// Pictures for readers.
    #[error(transparent)]
    ReaderPicture(#[from] ppa_label::PageError),
    /// A reader's grades.
    #[error(transparent)]
    Grades(#[from] ppa_label::GradeSheetError),
    /// Labels computed from readers' grades.
    #[error(transparent)]
    Import(#[from] ppa_label::ImportError),
    /// Networks that cannot be used.
    #[error(transparent)]
    Network(#[from] ppa_learn::frames::FramesError),
    /// A training run, or the images of its evaluation.
    #[error(transparent)]
    Train(#[from] ppa_learn::train::TrainError),
    /// An image of a training run.
    #[error(transparent)]
    TrainingData(#[from] ppa_learn::data::DataError),
    /// The evaluation of a training run.
    #[error(transparent)]
    Evaluate(#[from] ppa_learn::evaluate::EvaluateError),
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
    /// The cameras' coverage of the joint.
    #[error(transparent)]
    Coverage(#[from] ppa_generate::CoverageStudyError),
    /// The pose.
    #[error(transparent)]
    Pose(#[from] PoseError),
    /// The placement of the limb.
    #[error(transparent)]
    Place(#[from] ppa_scene::PlaceError),
    /// Voxels for the radiograph.
    #[error(transparent)]
    Joint(#[from] JointError),
    /// The radiograph.
    #[error(transparent)]
    Transport(#[from] ppa_xray::TransportError),
    /// The histories of the radiograph.
    #[error(transparent)]
    Run(#[from] ppa_xray::RunError),
    /// The doses of the radiograph.
    #[error(transparent)]
    Dose(#[from] ppa_xray::DoseError),
    /// The presentation of the radiograph.
    #[error(transparent)]
    Presentation(#[from] ppa_xray::PresentationError),
    /// The exposure index of the radiograph.
    #[error(transparent)]
    Receptor(#[from] ppa_xray::ReceptorError),
    /// The bones of the case.
    #[error(transparent)]
    Bones(#[from] ppa_label::BoneFileError),
    /// The joint space of the bones.
    #[error(transparent)]
    JointSpace(#[from] ppa_label::JointSpaceError),
    /// The coarse scan.
    #[error(transparent)]
    Volume(#[from] ppa_ct::VolumeError),
    /// The surface of the coarse scan.
    #[error(transparent)]
    Surface(#[from] ppa_mesh::SurfaceError),
    /// The text of a plan.
    #[error("the plan is not valid TOML")]
    Toml(#[source] toml::de::Error),
    /// The text of a plan that is edited.
    #[error(transparent)]
    TomlEdit(#[from] toml_edit::TomlError),
    /// A file.
    #[error(transparent)]
    File(#[from] FileError),
    /// The folder of a dataset.
    #[error(transparent)]
    Folder(#[from] FolderError),
    /// The folder of cluster jobs.
    #[error(transparent)]
    Cluster(#[from] ppa_cluster::FolderError),
    /// The forecast of a plan.
    #[error(transparent)]
    Forecast(#[from] ForecastError),
    /// The contact sheet of a dataset.
    #[error(transparent)]
    ContactSheet(#[from] ContactSheetError),
    /// A dataset is already being made.
    #[error("{} is being made: pause it first", .0.display())]
    Generating(PathBuf),
    /// Threads for a run.
    #[error("cannot start threads")]
    Threads(#[source] rayon::ThreadPoolBuildError),
    /// A picture.
    #[error("the picture cannot be encoded")]
    Picture(#[from] image::ImageError),
    /// A value that the page sent.
    #[error("{0}")]
    Invalid(String),
    /// Another program changed the file with the changes.
    #[error("{} was changed by another program: nothing was saved", .0.display())]
    ChangedElsewhere(PathBuf),
    /// A file that the user has not agreed to replace.
    #[error("{} exists", .0.display())]
    Exists(PathBuf),
    /// A dataset has no list of its images.
    #[error(
        "{} is not a complete dataset: manifest.jsonl is missing, which is written when all images are made",
        .0.display()
    )]
    NotMade(PathBuf),
    /// A later request of the page has replaced this one.
    #[error("a later request replaced this one")]
    Superseded,
    /// Random bytes for the token.
    #[error("the operating system does not provide random numbers: {0}")]
    Random(getrandom::Error),
    /// The address cannot be used.
    #[error("cannot listen on {address}")]
    Listen {
        /// The address.
        address: std::net::SocketAddr,
        /// The cause.
        source: std::io::Error,
    },
    /// The listening socket.
    #[error("the page cannot be served")]
    Serve(#[source] std::io::Error),
}
