//! Input of the studio: a scan, a case, a plan, a dataset, training runs, or the built-in phantom.

use std::error::Error;
use std::path::{Path, PathBuf};

use ppa_ct::{ReadOptions, Volume, write_nifti};
use ppa_dataset::files::FileError;
use ppa_dataset::labels::{BoneFile, BoneNumbers};
use ppa_dataset::manifest::DESCRIPTION_FILE;
use ppa_generate::{Case, Plan, PrepareError, plan_of_dataset, prepare, prepare_scan};
use ppa_mesh::LimbSettings;
use ppa_phantom::{LowerLeg, TableTop};
use ppa_scene::{LandmarkOverrides, LimbKind, Side};

use crate::error::StudioError;
use crate::live::Watch;
use crate::network::Networks;
use crate::trainings::Trainings;

/// Input to open.
#[derive(Debug, Clone, Default)]
pub struct Opening {
    /// A scan, case, plan, dataset, training run or folder of training runs. If absent, the built-in phantom, unless frames are watched.
    pub path: Option<PathBuf>,
    /// Side of the limb in a scan.
    pub side: Option<Side>,
    /// Networks that predict the quality of poses.
    pub networks: Option<Networks>,
    /// Frames that the networks predict from as they arrive.
    pub watch: Option<Watch>,
}

/// Folder, in the current one, of the phantom that is opened by default.
const PHANTOM_FOLDER: &str = "ppa-studio";

/// Voxel size of the phantom, mm.
const PHANTOM_SPACING_MM: f64 = 1.0;

impl Opening {
    /// Returns the opening of a path, without other options.
    pub fn of(path: &Path) -> Self {
        Self {
            path: Some(path.to_owned()),
            ..Self::default()
        }
    }

    /// Reads the input that is shown first.
    pub(crate) fn read(&self) -> Result<Opened, StudioError> {
        let Some(path) = &self.path else {
            return match self.watch {
                Some(_) => Ok(Opened::default()),
                None => Ok(Opened {
                    mortise: Some(
                        LowerLeg::p01()
                            .truth()
                            .mortise_direction
                            .into_inner()
                            .into(),
                    ),
                    ..Opened::of_case(phantom()?)?
                }),
            };
        };
        if path
            .extension()
            .is_some_and(|extension| extension == "toml")
        {
            return if is_plan(path) {
                of_plan(path)
            } else {
                Opened::of_case(path.clone())
            };
        }
        if path.join(DESCRIPTION_FILE).exists() {
            return of_dataset(path);
        }
        if path.is_dir() {
            let trainings = Trainings::below(path);
            if !trainings.is_empty()? {
                return Ok(Opened {
                    trainings: Some(trainings),
                    ..Opened::default()
                });
            }
        }
        let side = self.side.ok_or_else(|| StudioError::NoSide(path.clone()))?;
        let file = case_name(path);
        if file.exists() {
            return Opened::of_case(file);
        }
        let (case, note) = case_of_scan(path, side)?;
        Ok(Opened {
            limb: Some((file, case)),
            note,
            ..Opened::default()
        })
    }
}

/// The opened input.
#[derive(Default)]
pub(crate) struct Opened {
    /// A case, and its file, which need not exist yet.
    pub limb: Option<(PathBuf, Case)>,
    pub plan_file: Option<PathBuf>,
    pub dataset: Option<PathBuf>,
    pub trainings: Option<Trainings>,
    /// Why landmarks must be set by hand.
    pub note: Option<String>,
    /// Front of the mortise of the built-in phantom, `ct` frame.
    pub mortise: Option<[f64; 3]>,
}

impl Opened {
    fn of_case(file: PathBuf) -> Result<Self, StudioError> {
        let case = Case::read(&file)?;
        Ok(Self {
            limb: Some((file, case)),
            ..Self::default()
        })
    }
}

fn of_plan(path: &Path) -> Result<Opened, StudioError> {
    let plan = Plan::read(path)?;
    let case = plan.cases.first();
    let case = case.ok_or_else(|| StudioError::NoCase(path.to_owned()))?;
    Ok(Opened {
        plan_file: Some(path.to_owned()),
        ..Opened::of_case(case.file.clone())?
    })
}

/// Makes a case from a scan. If landmarks are not found, they must be set by hand, and the reason is returned.
fn case_of_scan(path: &Path, side: Side) -> Result<(Case, Option<String>), StudioError> {
    let reading = ReadOptions::default();
    let scan = ppa_ct::read_with(path, &reading).map_err(PrepareError::from)?;
    let prepared = |choices: &LandmarkOverrides| {
        let surface = LimbSettings::default();
        prepare_scan(scan.clone(), path, &reading, side, &surface, choices)
    };
    let by_hand = LandmarkOverrides {
        limb: Some(LimbKind::Other),
        ..LandmarkOverrides::default()
    };
    match prepared(&LandmarkOverrides::default()) {
        Err(PrepareError::Landmarks(error)) => Ok((prepared(&by_hand)?.0, Some(error.to_string()))),
        found => Ok((found?.0, None)),
    }
}

/// Returns a dataset and the path of the plan with the same name, which may not exist.
fn of_dataset(path: &Path) -> Result<Opened, StudioError> {
    let root = match path.file_name() {
        Some(_) => path.to_owned(),
        // Such as `.`.
        None => path.canonicalize().map_err(FileError::at("find", path))?,
    };
    Ok(Opened {
        plan_file: Some(plan_of_dataset(&root)),
        dataset: Some(root),
        ..Opened::default()
    })
}

/// Whether a TOML file is a plan: only plans list cases.
fn is_plan(path: &Path) -> bool {
    std::fs::read_to_string(path).is_ok_and(|text| text.lines().any(|l| l.trim() == "[[case]]"))
}

/// Returns the case file of a scan, in the current folder.
fn case_name(scan: &Path) -> PathBuf {
    let name = scan.file_name().unwrap_or_default().to_string_lossy();
    let stem = name.split('.').find(|part| !part.is_empty());
    PathBuf::from(format!("{}.case.toml", stem.unwrap_or("scan")))
}

/// Returns the case file of the built-in phantom. Writes it with scan and bones if it does not exist.
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

/// Writes the phantom's scan and the bone number of each voxel.
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
