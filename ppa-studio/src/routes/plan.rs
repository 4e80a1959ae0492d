//! The plan: its form, changes and saving.

use std::collections::BTreeSet;
use std::path::Path;
use std::sync::Arc;

use axum::Json;
use axum::extract::State as Extracted;
use axum::response::Response;
use ppa_generate::{PlanCase, edited_case, original_case};
use ppa_xray::{Composition, Segment};
use serde::{Deserialize, Serialize};

use super::answer::work;
use crate::error::StudioError;
use crate::plan_file::PlanFile;
use crate::plan_form::{Field, fields};
use crate::plan_limbs::{LimbChange, cases_beside};
use crate::plan_limits::{self, Limits};
use crate::state::State;

/// A plan with its files.
#[derive(Serialize)]
pub(super) struct PlanForm {
    original: String,
    /// File that holds the displayed plan.
    current: String,
    has_edits: bool,
    /// Whether the original exists: an opened case may have no plan yet.
    is_saved: bool,
    /// Name of the folder that `ppa generate` makes from the original.
    dataset: String,
    limbs: Vec<Limb>,
    /// Cases in the plan's folder that the plan does not name.
    other_cases: BTreeSet<String>,
    can_undo: bool,
    can_redo: bool,
    fields: Vec<Field>,
    /// Table of materials in use.
    materials: Vec<Material>,
}

/// A row of the table of materials.
#[derive(Serialize)]
struct Material {
    segment: String,
    /// Lowest HU; `None` for the first segment.
    from_hu: Option<f32>,
    /// One material, or two for a mixture.
    materials: Vec<String>,
    /// Knots of the density, HU and g/cm³.
    density: Vec<[f32; 2]>,
}

/// A limb of the plan.
#[derive(Serialize)]
struct Limb {
    patient: u32,
    /// Name of its case file, without the folder.
    case: String,
    uses_edits: bool,
    /// Whether the other case file, edited or original, exists.
    has_edits: bool,
}

type Answer = Result<Json<PlanForm>, Response>;

pub(super) async fn form(Extracted(state): Extracted<Arc<State>>) -> Answer {
    work(state, |state| plan_form(state).map(Json)).await
}

/// Change of a key's value.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct KeyChange {
    key: String,
    /// Typed value; `null` removes the key, so that its default applies.
    value: Option<String>,
}

pub(super) async fn key(
    Extracted(state): Extracted<Arc<State>>,
    Json(KeyChange { key, value }): Json<KeyChange>,
) -> Answer {
    work(state, move |state| {
        state.edit_plan(|file, text| file.changed(text, &key, value.as_deref()))?;
        plan_form(state).map(Json)
    })
    .await
}

/// A key of the form.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct LimitsOf {
    key: String,
}

/// Answers with the range of numbers that the plan accepts for a key.
pub(super) async fn limits(
    Extracted(state): Extracted<Arc<State>>,
    Json(LimitsOf { key }): Json<LimitsOf>,
) -> Result<Json<Option<Limits>>, Response> {
    work(state, move |state| {
        let file = state.plan_file();
        let text = file.text(|| state.case_on_disk())?;
        let fields = form_fields(state, &file, &text)?;
        let field = fields.iter().find(|field| field.key == key);
        let field = field.ok_or_else(|| StudioError::Invalid(format!("the form has no {key}")))?;
        Ok(Json(plan_limits::limits(&file, &text, field)))
    })
    .await
}

pub(super) async fn limbs(
    Extracted(state): Extracted<Arc<State>>,
    Json(change): Json<LimbChange>,
) -> Answer {
    work(state, move |state| {
        state.edit_plan(|file, text| file.with_limbs(text, &change))?;
        plan_form(state).map(Json)
    })
    .await
}

pub(super) async fn undo(Extracted(state): Extracted<Arc<State>>) -> Answer {
    work(state, |state| {
        state.step_plan(PlanFile::undo)?;
        plan_form(state).map(Json)
    })
    .await
}

pub(super) async fn redo(Extracted(state): Extracted<Arc<State>>) -> Answer {
    work(state, |state| {
        state.step_plan(PlanFile::redo)?;
        plan_form(state).map(Json)
    })
    .await
}

/// Overwrites the opened plan.
pub(super) async fn save(Extracted(state): Extracted<Arc<State>>) -> Answer {
    work(state, |state| {
        state.save_plan()?;
        plan_form(state).map(Json)
    })
    .await
}

fn plan_form(state: &State) -> Result<PlanForm, StudioError> {
    let file = state.plan_file();
    let text = file.text(|| state.case_on_disk())?;
    let plan = file.plan(&text)?;
    let shown = |path: &Path| path.to_string_lossy().into_owned();
    let dataset = file.original().with_extension("");
    let [can_undo, can_redo] = file.can_step();
    Ok(PlanForm {
        original: shown(file.original()),
        current: shown(file.current()),
        has_edits: file.has_edits(),
        is_saved: file.original().exists(),
        dataset: dataset
            .file_name()
            .unwrap_or_default()
            .to_string_lossy()
            .into_owned(),
        limbs: plan.cases.iter().map(limb).collect(),
        other_cases: cases_beside(file.folder(), &plan)?,
        can_undo,
        can_redo,
        fields: form_fields(state, &file, &text)?,
        materials: plan
            .xray
            .calibration
            .segments
            .iter()
            .map(material)
            .collect(),
    })
}

fn form_fields(state: &State, file: &PlanFile, text: &str) -> Result<Vec<Field>, StudioError> {
    fields(
        text,
        // A rig that cannot be read is reported where it is used.
        file.plan(text)?.depth.cameras().ok().as_ref(),
        &state.plan_files.beside(file.folder())?,
    )
}

fn material(segment: &Segment) -> Material {
    Material {
        segment: segment.name.clone(),
        from_hu: segment.from_hu,
        materials: match &segment.composition {
            Composition::Pure(material) => vec![material.clone()],
            Composition::Mixture(ends) => ends.iter().map(|end| end.material.clone()).collect(),
        },
        density: segment.density.clone(),
    }
}

fn limb(planned: &PlanCase) -> Limb {
    let original = original_case(&planned.file);
    let other = match &original {
        Some(original) => original.clone(),
        None => edited_case(&planned.file),
    };
    Limb {
        patient: planned.patient,
        case: planned
            .file
            .file_name()
            .unwrap_or_default()
            .to_string_lossy()
            .into_owned(),
        uses_edits: original.is_some(),
        has_edits: other.exists(),
    }
}
