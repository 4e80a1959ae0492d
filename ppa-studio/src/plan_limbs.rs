//! The limbs of a plan, and the cases in its folder.

use std::collections::BTreeSet;
use std::path::Path;

use ppa_core::Side;
use ppa_dataset::files::FileError;
use ppa_generate::{Case, Plan, edited_case, original_case};
use serde::Deserialize;
use toml_edit::{ArrayOfTables, Item, Table, value};

use crate::error::StudioError;
use crate::toml_value::put;

/// A change of the list of limbs; `number` is an index from 0.
#[derive(Deserialize)]
#[serde(rename_all = "snake_case", deny_unknown_fields)]
pub(crate) enum LimbChange {
    /// Adds a case file from the plan's folder.
    Add { case: String },
    /// Removes a limb from the plan.
    Remove { number: usize },
    /// Sets the patient of a limb.
    Patient { number: usize, patient: u32 },
    /// Uses the original case, or the one with the changes saved next to it.
    Case { number: usize, edits: bool },
}

impl LimbChange {
    /// Changes the tables of a plan's limbs; `plan` is the parsed plan, `folder` that of its file.
    pub fn apply(
        &self,
        limbs: &mut ArrayOfTables,
        plan: &Plan,
        folder: &Path,
    ) -> Result<(), StudioError> {
        match self {
            Self::Add { case } => {
                if !cases_beside(folder, plan)?.contains(case) {
                    return Err(StudioError::Invalid(format!(
                        "{case} is not a case file in the plan's folder, or is already in the plan"
                    )));
                }
                let file = folder.join(case);
                let patient = patient_of_case(&Case::read(&file)?, plan)?;
                require_other_limb(&file, patient, plan, None)?;
                let mut limb = Table::new();
                limb.insert("file", value(case.clone()));
                limb.insert("patient", value(i64::from(patient)));
                limbs.push(limb);
            }
            Self::Remove { number } => {
                let removed = limb_at(limbs, *number)?;
                let comments = removed.decor().prefix().cloned();
                if limbs.len() == 1 {
                    let message = "a plan needs at least one limb".to_owned();
                    return Err(StudioError::Invalid(message));
                }
                limbs.remove(*number);
                // Comments before the first limb apply to all limbs.
                if let (0, Some(comments), Some(first)) = (*number, comments, limbs.get_mut(0)) {
                    first.decor_mut().set_prefix(comments);
                }
            }
            Self::Patient { number, patient } => {
                let limb = limb_at(limbs, *number)?;
                if let Some(planned) = plan.cases.get(*number) {
                    require_other_limb(&planned.file, *patient, plan, Some(*number))?;
                }
                put(limb, "patient", Some(i64::from(*patient).into()));
            }
            Self::Case { number, edits } => {
                let limb = limb_at(limbs, *number)?;
                let file = limb.get("file").and_then(Item::as_str);
                let file = Path::new(file.unwrap_or_default());
                let original = original_case(file).unwrap_or_else(|| file.to_owned());
                let file = if *edits {
                    edited_case(&original)
                } else {
                    original
                };
                put(
                    limb,
                    "file",
                    Some(file.to_string_lossy().into_owned().into()),
                );
            }
        }
        Ok(())
    }
}

/// Returns the file names of the cases in the folder of a plan that it does not name.
pub(crate) fn cases_beside(folder: &Path, plan: &Plan) -> Result<BTreeSet<String>, StudioError> {
    let entries = std::fs::read_dir(folder).map_err(FileError::at("read", folder))?;
    // A plan cannot contain names that are not UTF-8.
    let names = entries.filter_map(|entry| entry.ok()?.file_name().into_string().ok());
    let is_case = |name: &String| {
        name.ends_with(".case.toml")
            && original_case(Path::new(name)).is_none()
            && folder.join(name).is_file()
    };
    let is_new = |name: &String| plan.patient_of(&folder.join(name)).is_none();
    Ok(names.filter(is_case).filter(is_new).collect())
}

/// Returns the patient number of a limb with the same scan in the plan, or a new number.
fn patient_of_case(case: &Case, plan: &Plan) -> Result<u32, StudioError> {
    let scan = &case.source.volume_sha256;
    // Cases that cannot be read are reported where they are used.
    let has_scan = |file: &Path| Case::read(file).is_ok_and(|c| c.source.volume_sha256 == *scan);
    if let Some(same) = plan.cases.iter().find(|limb| has_scan(&limb.file)) {
        return Ok(same.patient);
    }
    let Some(last) = plan.cases.iter().map(|limb| limb.patient).max() else {
        return Ok(0);
    };
    last.checked_add(1).ok_or_else(|| {
        StudioError::Invalid(format!(
            "patient number {last} in the plan is already the largest possible"
        ))
    })
}

/// Refuses a second limb of the same patient and side; `number` is the index of the limb itself, if it is in the plan.
fn require_other_limb(
    case: &Path,
    patient: u32,
    plan: &Plan,
    number: Option<usize>,
) -> Result<(), StudioError> {
    let side = |case: &Path| Case::read(case).ok().map(|case| case.side);
    let Some(wanted) = side(case) else {
        return Ok(());
    };
    let others = plan.cases.iter().enumerate();
    let mut others = others.filter(|(at, limb)| Some(*at) != number && limb.patient == patient);
    match others.find(|(_, limb)| side(&limb.file) == Some(wanted)) {
        None => Ok(()),
        Some((_, same)) => {
            let name = same.file.file_name().unwrap_or_default().to_string_lossy();
            let side = match wanted {
                Side::Right => "right",
                Side::Left => "left",
            };
            Err(StudioError::Invalid(format!(
                "{name} is already the {side} limb of patient {patient}"
            )))
        }
    }
}

fn limb_at(limbs: &mut ArrayOfTables, number: usize) -> Result<&mut Table, StudioError> {
    let limb = limbs.get_mut(number);
    limb.ok_or_else(|| StudioError::Invalid(format!("the plan has no limb {number}")))
}
