//! What the studio opens: a scan, a case, a plan, or the built-in phantom.

use std::error::Error;
use std::path::{Path, PathBuf};

use ppa_ct::{ReadOptions, Volume, write_nifti};
use ppa_dataset::labels::{BoneFile, BoneNumbers};
use ppa_generate::{Case, Plan, prepare};
use ppa_mesh::LimbSettings;
use ppa_phantom::{LowerLeg, TableTop};
use ppa_scene::{LandmarkOverrides, Side};

use crate::error::StudioError;

/// What to open.
#[derive(Debug, Clone, Default)]
pub struct Opening {
    /// A scan, a case or a plan; the built-in phantom when absent.
    pub path: Option<PathBuf>,
    /// Side of the limb, for a scan.
    pub side: Option<Side>,
}

/// Folder of the phantom that is opened when nothing is given, in the current one.
const PHANTOM_FOLDER: &str = "ppa-studio";

/// Side of the phantom's voxels, mm.
const PHANTOM_SPACING_MM: f64 = 1.0;

impl Opening {
    /// A scan, a case or a plan.
    pub fn of(path: &Path) -> Self {
        Self {
            path: Some(path.to_owned()),
            side: None,
        }
    }

    /// The case, the place of its file, and the plan whose room and exposure it is shown with.
    pub(crate) fn read(&self) -> Result<Opened, StudioError> {
        let Some(path) = &self.path else {
            return Opened::with_default_plan(phantom()?);
        };
        if path
            .extension()
            .is_some_and(|extension| extension == "toml")
        {
            return if is_plan(path) {
                of_plan(path)
            } else {
                Opened::with_default_plan(path.clone())
            };
        }
        // A dataset or a training.
        let has = |name| path.join(name).exists();
        if has("dataset.json") || has("config.toml") {
            return Err(StudioError::NotAScan(path.clone()));
        }
        let side = self.side.ok_or_else(|| StudioError::NoSide(path.clone()))?;
        let file = case_name(path);
        if file.exists() {
            return Opened::with_default_plan(file);
        }
        let (surface, choices) = (LimbSettings::default(), LandmarkOverrides::default());
        let (case, _) = prepare(path, &ReadOptions::default(), side, &surface, &choices)?;
        Ok(Opened {
            case,
            case_file: file,
            plan: Plan::new(Vec::new()),
            plan_file: None,
        })
    }
}

/// What was opened.
pub(crate) struct Opened {
    pub case: Case,
    /// Where the case is or will be written.
    pub case_file: PathBuf,
    pub plan: Plan,
    pub plan_file: Option<PathBuf>,
}

impl Opened {
    fn with_default_plan(case_file: PathBuf) -> Result<Self, StudioError> {
        Ok(Self {
            case: Case::read(&case_file)?,
            case_file,
            plan: Plan::new(Vec::new()),
            plan_file: None,
        })
    }
}

fn of_plan(path: &Path) -> Result<Opened, StudioError> {
    let plan = Plan::read(path)?;
    let case = plan.cases.first();
    let case_file = case
        .map(|case| case.file.clone())
        .ok_or_else(|| StudioError::NoCase(path.to_owned()))?;
    Ok(Opened {
        case: Case::read(&case_file)?,
        case_file,
        plan,
        plan_file: Some(path.to_owned()),
    })
}

/// Whether a TOML file is a plan: only plans list cases.
fn is_plan(path: &Path) -> bool {
    std::fs::read_to_string(path).is_ok_and(|text| text.lines().any(|l| l.trim() == "[[case]]"))
}

/// The case of a scan, in the current folder.
fn case_name(scan: &Path) -> PathBuf {
    let name = scan.file_name().unwrap_or_default().to_string_lossy();
    let stem = name.split('.').find(|part| !part.is_empty());
    PathBuf::from(format!("{}.case.toml", stem.unwrap_or("scan")))
}

/// The built-in phantom, its bones and its case, written unless they are there.
fn phantom() -> Result<PathBuf, StudioError> {
    let folder = Path::new(PHANTOM_FOLDER);
    let case_file = folder.join("p01.case.toml");
    if case_file.exists() {
        return Ok(case_file);
    }
    let made = phantom_scan(folder);
    let (scan, bones) = made.map_err(StudioError::Phantom)?;
    let (surface, choices) = (LimbSettings::default(), LandmarkOverrides::default());
    let reading = ReadOptions::default();
    let (mut case, _) = prepare(&scan, &reading, Side::Right, &surface, &choices)?;
    case.bones = Some(BoneFile {
        path: bones,
        numbers: BoneNumbers::default(),
        segmented: false,
    });
    case.write(&case_file)?;
    Ok(case_file)
}

/// Writes the phantom's scan and which bone each of its voxels belongs to.
fn phantom_scan(folder: &Path) -> Result<(PathBuf, PathBuf), Box<dyn Error + Send + Sync>> {
    let (scan, bones) = (folder.join("p01.nii.gz"), folder.join("p01.bones.nii.gz"));
    std::fs::create_dir_all(folder)?;
    let leg = LowerLeg::p01();
    let volume = leg.voxelise(PHANTOM_SPACING_MM, TableTop::Present)?;
    let numbers = leg.bone_labels(volume.grid()).into_iter().map(f32::from);
    let labels = Volume::new(volume.grid().clone(), numbers.collect())?;
    write_nifti(&scan, &volume)?;
    write_nifti(&bones, &labels)?;
    Ok((scan, bones))
}
