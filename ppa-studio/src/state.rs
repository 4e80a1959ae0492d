//! All state of a running studio.

use std::path::{Component, Path, PathBuf};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::SystemTime;

use ppa_dataset::layout::LimbId;
use ppa_generate::{Case, Plan, PlanCase, original_case};

use crate::case_file::new_plan;
use crate::desk::Desk;
use crate::error::StudioError;
use crate::generation::Generation;
use crate::limb::Limb;
use crate::live::Live;
use crate::network::Network;
use crate::newest::Newest;
use crate::opening::Opening;
use crate::plan_file::PlanFile;
use crate::plan_files::PlanFiles;
use crate::plan_limbs::LimbChange;
use crate::stoppable::Stoppable;
use crate::token::Token;
use crate::training_errors::TrainingErrors;
use crate::trainings::Trainings;
use crate::what_if::WhatIf;

/// Open files and running tasks.
pub(crate) struct State {
    pub token: Token,
    /// When the program started.
    pub started: SystemTime,
    /// Running request for depth images.
    pub depth: Newest,
    /// Running request for a radiograph or its dose.
    pub radiograph: Newest,
    /// Running request for the surface of the coarse scan.
    pub surface: Newest,
    /// Running request for a label.
    pub label: Newest,
    /// Running request for the cameras' coverage of the joint.
    pub coverage: Newest,
    /// Generation of a dataset.
    pub generation: Generation,
    /// Running forecast.
    pub forecast: Stoppable,
    /// Running request for a contact sheet.
    pub sheet: Newest,
    /// Running request for the list of poses.
    pub quality: Newest,
    /// Running check of all images.
    pub check: Newest,
    /// Lock that allows one change of readers' grades at a time.
    pub grading: Mutex<()>,
    /// Networks that predict the quality of poses, if any.
    pub network: Option<Network>,
    /// Watched frames that they predict from, if any.
    pub live: Option<Live>,
    /// Files that the plan may name.
    pub plan_files: PlanFiles,
    /// Training runs that were opened, or are next to the plan or the networks.
    pub trainings: Trainings,
    /// Errors of the training runs.
    pub training_errors: TrainingErrors,
    /// Why landmarks must be set by hand, or `None` if they were found.
    pub note: Option<String>,
    /// The opened dataset, if any.
    pub opened_dataset: Option<PathBuf>,
    plan: Mutex<Arc<Plan>>,
    plan_file: Mutex<PlanFile>,
    limb: Mutex<Option<Arc<Limb>>>,
}

impl State {
    /// Opens the given files and restores the changes saved next to them.
    pub fn open(opening: &Opening, token: Token) -> Result<Self, StudioError> {
        // Networks first: reading the input may write files, those of the built-in phantom.
        let network = opening.networks.clone().map(Network::open).transpose()?;
        let live = match (&opening.networks, opening.watch.clone()) {
            (_, None) => None,
            (Some(networks), Some(watch)) => Some(Live::open(networks, watch)?),
            (None, Some(_)) => return Err(StudioError::NoNetworks),
        };
        let opened = opening.read()?;
        let plan_file = match (opened.plan_file, &opened.limb) {
            (Some(file), _) => file,
            (None, Some((file, _))) => new_plan(file),
            // No file: plans are made for limbs only, and no limb can be opened.
            (None, None) => PathBuf::new(),
        };
        let plan_file = PlanFile::new(plan_file);
        let trainings = match (opened.trainings, &opening.networks) {
            (Some(trainings), _) => trainings,
            // Only networks are open.
            (None, Some(networks)) if opened.limb.is_none() && opened.dataset.is_none() => {
                Trainings::beside(&networks.left)
            }
            (None, _) => Trainings::beside(plan_file.original()),
        };
        let plan = if plan_file.current().exists() {
            Plan::read(plan_file.current())?
        } else {
            Plan::new(Vec::new())
        };
        let limb = opened.limb.map(|(file, case)| Limb::open(file, case));
        let mut limb = limb.transpose()?;
        if let Some(limb) = &mut limb {
            limb.mortise = opened.mortise;
        }
        Ok(Self {
            token,
            started: SystemTime::now(),
            depth: Newest::default(),
            radiograph: Newest::default(),
            surface: Newest::default(),
            label: Newest::default(),
            coverage: Newest::default(),
            generation: Generation::default(),
            forecast: Stoppable::default(),
            sheet: Newest::default(),
            quality: Newest::default(),
            check: Newest::default(),
            grading: Mutex::default(),
            network,
            live,
            plan_files: PlanFiles::default(),
            trainings,
            training_errors: TrainingErrors::default(),
            note: opened.note,
            opened_dataset: opened.dataset,
            plan: Mutex::new(Arc::new(plan)),
            plan_file: Mutex::new(plan_file),
            limb: Mutex::new(limb.map(Arc::new)),
        })
    }

    /// Returns the open limb.
    ///
    /// # Errors
    /// [`StudioError::NoLimb`] if no limb is open.
    pub fn limb(&self) -> Result<Arc<Limb>, StudioError> {
        let limb = self.limb.lock();
        let limb = limb.unwrap_or_else(PoisonError::into_inner).clone();
        limb.ok_or(StudioError::NoLimb)
    }

    /// Opens another limb of the plan.
    ///
    /// # Errors
    /// [`StudioError::NotInPlan`] for a limb that the plan does not name.
    pub fn open_limb(&self, id: LimbId) -> Result<(), StudioError> {
        let found = self.plan().cases.iter().find_map(|planned| {
            let case = Case::read(&planned.file).ok()?;
            let of = LimbId {
                patient: planned.patient,
                side: case.side,
            };
            (of == id).then(|| (planned.file.clone(), case))
        });
        let (file, case) = found.ok_or(StudioError::NotInPlan(id))?;
        self.depth.cancel();
        self.radiograph.cancel();
        let limb = Arc::new(Limb::open(file, case)?);
        let mut open = self.limb.lock().unwrap_or_else(PoisonError::into_inner);
        *open = Some(limb);
        Ok(())
    }

    /// Changes the displayed limb and saves it next to the case.
    pub fn edit(
        &self,
        change: impl FnOnce(&mut Desk) -> Result<(), StudioError>,
    ) -> Result<(), StudioError> {
        self.depth.cancel();
        self.radiograph.cancel();
        self.limb()?.edit(change)
    }

    /// Overwrites the opened case with its changes. A plan with the file of the changes, which is removed, then has the case.
    ///
    /// # Errors
    /// [`StudioError`] if a file cannot be written.
    pub fn save_case(&self) -> Result<(), StudioError> {
        let limb = self.limb()?;
        let case = limb.shown().case.clone();
        let original = {
            let mut file = limb.case_file();
            file.save(&case)?;
            file.original().canonicalize().ok()
        };
        let has_edits = |planned: &PlanCase| {
            let of = original_case(&planned.file).and_then(|of| of.canonicalize().ok());
            of.is_some() && of == original
        };
        if let Some(number) = self.plan().cases.iter().position(has_edits) {
            let change = LimbChange::Case {
                number,
                edits: false,
            };
            self.edit_plan(|file, text| file.with_limbs(text, &change))?;
        }
        Ok(())
    }

    /// Returns the plan of the displayed room and exposure.
    pub fn plan(&self) -> Arc<Plan> {
        let plan = self.plan.lock();
        plan.unwrap_or_else(PoisonError::into_inner).clone()
    }

    pub fn plan_file(&self) -> MutexGuard<'_, PlanFile> {
        let file = self.plan_file.lock();
        file.unwrap_or_else(PoisonError::into_inner)
    }

    /// Returns the file that holds the displayed case.
    pub fn case_on_disk(&self) -> Result<PathBuf, StudioError> {
        Ok(self.limb()?.case_on_disk())
    }

    /// Returns the patient number of the open limb in the plan, or 0, as in a new plan.
    pub fn patient(&self) -> Result<u32, StudioError> {
        let file = self.limb()?.case_file().original().to_owned();
        Ok(self.plan().patient_of(&file).unwrap_or(0))
    }

    /// Returns the file of the displayed plan, or `None` if it is not stored in a file yet.
    pub fn opened_plan(&self) -> Option<PathBuf> {
        let file = self.plan_file().current().to_owned();
        file.exists().then_some(file)
    }

    /// Changes the text of the plan and saves it next to the original.
    pub fn edit_plan(
        &self,
        change: impl FnOnce(&PlanFile, &str) -> Result<(String, Plan), StudioError>,
    ) -> Result<(), StudioError> {
        let mut file = self.plan_file();
        let before = file.text(|| self.case_on_disk())?;
        let (text, plan) = change(&file, &before)?;
        if text != before {
            file.change(before, text)?;
            self.show_plan(plan);
        }
        Ok(())
    }

    /// Applies the plan text returned by [`PlanFile::undo`] or [`PlanFile::redo`].
    pub fn step_plan(
        &self,
        step: impl FnOnce(&mut PlanFile, String) -> Result<Option<String>, StudioError>,
    ) -> Result<(), StudioError> {
        let mut file = self.plan_file();
        let now = file.text(|| self.case_on_disk())?;
        if let Some(text) = step(&mut file, now)? {
            self.show_plan(file.plan(&text)?);
        }
        Ok(())
    }

    /// Uses a plan for room and exposure.
    fn show_plan(&self, plan: Plan) {
        let shown = self.plan.lock();
        *shown.unwrap_or_else(PoisonError::into_inner) = Arc::new(plan);
    }

    /// Returns the displayed plan and its file, which is written if it does not exist.
    pub fn plan_on_disk(&self) -> Result<(PathBuf, Arc<Plan>), StudioError> {
        let mut file = self.plan_file();
        // Missing changes are those that the user removed.
        if !file.has_edits() && !file.original().exists() {
            self.write_plan(&mut file)?;
        }
        Ok((file.current().to_owned(), self.plan()))
    }

    /// Overwrites the opened plan with its changes.
    pub fn save_plan(&self) -> Result<(), StudioError> {
        self.write_plan(&mut self.plan_file())
    }

    fn write_plan(&self, file: &mut PlanFile) -> Result<(), StudioError> {
        let text = file.text(|| self.case_on_disk())?;
        let plan = file.plan(&text)?;
        file.save(&text)?;
        self.show_plan(plan);
        Ok(())
    }

    /// Returns the folder of the opened dataset, or of a dataset next to the plan.
    ///
    /// # Errors
    /// [`StudioError::Invalid`] unless `name` is the name of a folder there.
    pub fn dataset(&self, name: &str) -> Result<PathBuf, StudioError> {
        let opened = self.opened_dataset.as_ref();
        if let Some(root) = opened.filter(|root| root.file_name().is_some_and(|of| of == name)) {
            return Ok(root.clone());
        }
        named_folder(self.plan_file().folder(), name, "the plan")
    }

    /// Returns the plan with the page's changes, for the displayed case.
    pub fn plan_with(&self, what_if: &WhatIf) -> Result<Plan, StudioError> {
        let mut plan = what_if.plan(&self.plan())?;
        if plan.cases.is_empty() {
            plan.cases.push(PlanCase {
                file: self.case_on_disk()?,
                patient: 0,
            });
        }
        Ok(plan)
    }
}

/// Returns the folder `name` in `folder`; an error describes its place as next to `neighbour`.
///
/// # Errors
/// [`StudioError::Invalid`] for anything but a plain name, and for a link.
pub(crate) fn named_folder(
    folder: &Path,
    name: &str,
    neighbour: &str,
) -> Result<PathBuf, StudioError> {
    let mut parts = Path::new(name).components();
    let is_name = matches!(parts.next(), Some(Component::Normal(part)) if part == name);
    let found = folder.join(name);
    if is_name && !found.is_symlink() {
        return Ok(found);
    }
    Err(StudioError::Invalid(format!(
        "{name:?} is not the name of a folder next to {neighbour}"
    )))
}
