//! The limb with its landmarks: state, changes, undo and saving.

use std::collections::BTreeMap;
use std::path::Path;
use std::sync::Arc;

use axum::Json;
use axum::extract::{Query, Request, State as Extracted};
use axum::middleware::Next;
use axum::response::Response;
use ppa_dataset::files::write_whole;
use ppa_dataset::{Finding, FindingCode};
use ppa_generate::{Case, SceneSetupError, Technique, XraySettings};
use ppa_mesh::{Ball, LimbReport, VoxelBox};
use ppa_scene::{LandmarkOverrides, Landmarks, LimbKind, Side};
use ppa_xray::TubeLoad;
use serde::{Deserialize, Serialize};

use super::answer::{failed, work};
use crate::commands::{self, Commands};
use crate::error::StudioError;
use crate::state::State;
use crate::what_if::WhatIf;

/// Everything that the page shows of the limb except images.
#[derive(Serialize)]
pub(super) struct Document {
    revision: u64,
    /// Name of the opened file, without its folder.
    name: String,
    side: Side,
    limb: LimbKind,
    /// Why landmarks must be set by hand, or `None` if they were found.
    note: Option<String>,
    grid: GridState,
    iso_hu: f64,
    /// Point chosen inside the limb.
    inside: Option<[f64; 3]>,
    /// Part of the scan that is used, if not all.
    crop: Option<VoxelBox>,
    /// Balls of the scan that are cut off.
    removed: Vec<Ball>,
    /// Maximum HU of the surface.
    core_hu: f64,
    choices: LandmarkOverrides,
    landmarks: Landmarks,
    /// Landmarks found without manual choices.
    automatic: Option<Landmarks>,
    /// Front of the mortise, `ct` frame, if known.
    mortise: Option<[f64; 3]>,
    findings: Vec<Finding>,
    acknowledged: Vec<FindingCode>,
    report: LimbReport,
    files: Files,
    can_undo: bool,
    can_redo: bool,
    commands: Commands,
    planned: Planned,
}

/// Values of the plan, for sliders that have not been moved.
#[derive(Serialize)]
struct Planned {
    distal_mm: f64,
    proximal_mm: f64,
    tilt_deg: f64,
    beam_across_mm: f64,
    beam_along_mm: f64,
    exposure: Exposure,
    /// Exposures of the techniques, by name.
    techniques: BTreeMap<&'static str, Exposure>,
}

#[derive(Serialize)]
struct Exposure {
    kvp: f64,
    filters: Vec<String>,
    tube_load: Option<TubeLoad>,
}

impl Exposure {
    fn of(settings: &XraySettings) -> Self {
        Self {
            kvp: settings.kvp,
            filters: settings.filters.clone(),
            tube_load: settings.tube_load,
        }
    }

    fn of_technique(technique: Technique) -> Self {
        let mut settings = XraySettings::default();
        technique.apply(&mut settings);
        Self::of(&settings)
    }
}

#[derive(Serialize)]
struct GridState {
    size: [usize; 3],
    spacing_mm: [f64; 3],
    /// Rows of the transform from voxel indices to the `ct` frame.
    ct_from_voxel: [[f64; 4]; 4],
}

#[derive(Serialize)]
struct Files {
    original: String,
    edited: String,
    has_edits: bool,
    /// Whether the original exists: an opened scan may have no case yet.
    is_saved: bool,
    plan: Option<String>,
    saved_plan: String,
}

type Answer = Result<Json<Document>, Response>;

pub(super) async fn state(Extracted(state): Extracted<Arc<State>>) -> Answer {
    work(state, |state| document(state).map(Json)).await
}

/// The limb of a page.
#[derive(Deserialize)]
pub(super) struct OfPage {
    /// File of its case, as in [`Files::original`].
    limb: Option<String>,
}

/// Refuses changes by a page that shows another limb: another page may have opened one, or the program was restarted.
pub(super) async fn of_open_limb(
    Extracted(state): Extracted<Arc<State>>,
    Query(OfPage { limb: shown }): Query<OfPage>,
    request: Request,
    next: Next,
) -> Result<Response, Response> {
    let open = state.limb().map_err(failed)?;
    let open = open.case_file().original().to_owned();
    if shown.is_some_and(|shown| shown != open.to_string_lossy()) {
        return Err(failed(StudioError::OtherLimb(open)));
    }
    Ok(next.run(request).await)
}

/// Sets the landmark choices; landmarks of absent keys are found automatically.
pub(super) async fn choices(
    Extracted(state): Extracted<Arc<State>>,
    Json(choices): Json<LandmarkOverrides>,
) -> Answer {
    edit(state, move |case| Case { choices, ..case }).await
}

/// Changes of the settings that find the skin.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct SurfaceChange {
    iso_hu: Option<f64>,
    side: Option<Side>,
    /// A point in the wanted limb, or `null` for the automatic choice.
    #[serde(default, with = "double_option")]
    inside: Option<Option<[f64; 3]>>,
    /// Part of the scan to use, or `null` for all of it.
    #[serde(default, with = "double_option")]
    crop: Option<Option<VoxelBox>>,
    /// Balls to cut off.
    removed: Option<Vec<Ball>>,
}

/// Distinguishes an absent key from `null`.
mod double_option {
    use serde::{Deserialize, Deserializer};

    pub fn deserialize<'de, T: Deserialize<'de>, D: Deserializer<'de>>(
        deserializer: D,
    ) -> Result<Option<Option<T>>, D::Error> {
        Option::deserialize(deserializer).map(Some)
    }
}

pub(super) async fn surface(
    Extracted(state): Extracted<Arc<State>>,
    Json(change): Json<SurfaceChange>,
) -> Answer {
    edit(state, move |mut case| {
        case.surface.iso_hu = change.iso_hu.unwrap_or(case.surface.iso_hu);
        if let Some(inside) = change.inside {
            // Bodies were kept as parts of the previous limb.
            case.surface.inside = inside;
            case.surface.kept.clear();
        }
        case.surface.crop = change.crop.unwrap_or(case.surface.crop);
        case.surface.removed = change.removed.unwrap_or(case.surface.removed);
        case.side = change.side.unwrap_or(case.side);
        case
    })
    .await
}

/// A point in a body of the scan, `ct` frame, mm.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct InBody {
    point: [f64; 3],
}

/// Keeps a body as part of the limb, or removes it.
pub(super) async fn body(
    Extracted(state): Extracted<Arc<State>>,
    Json(InBody { point }): Json<InBody>,
) -> Answer {
    work(state, move |state| {
        state.edit(|desk| desk.keep_or_remove(point))?;
        document(state).map(Json)
    })
    .await
}

pub(super) async fn acknowledged(
    Extracted(state): Extracted<Arc<State>>,
    Json(codes): Json<Vec<FindingCode>>,
) -> Answer {
    edit(state, move |case| Case {
        acknowledged: codes,
        ..case
    })
    .await
}

pub(super) async fn undo(Extracted(state): Extracted<Arc<State>>) -> Answer {
    work(state, |state| {
        state.edit(|desk| desk.undo())?;
        document(state).map(Json)
    })
    .await
}

pub(super) async fn redo(Extracted(state): Extracted<Arc<State>>) -> Answer {
    work(state, |state| {
        state.edit(|desk| desk.redo())?;
        document(state).map(Json)
    })
    .await
}

/// Overwrites the opened case.
pub(super) async fn save(Extracted(state): Extracted<Arc<State>>) -> Answer {
    work(state, |state| {
        state.save_case()?;
        document(state).map(Json)
    })
    .await
}

/// Request to save a plan or its cameras.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct ToSave {
    what_if: WhatIf,
    /// Whether the user agreed to replace an existing file.
    #[serde(default)]
    replace: bool,
}

#[derive(Serialize)]
pub(super) struct Saved {
    file: String,
}

impl Saved {
    fn of(file: &Path) -> Json<Self> {
        let file = file.to_string_lossy().into_owned();
        Json(Self { file })
    }
}

/// Saves a plan with the page's changes.
pub(super) async fn plan(
    Extracted(state): Extracted<Arc<State>>,
    Json(ToSave { what_if, replace }): Json<ToSave>,
) -> Result<Json<Saved>, Response> {
    work(state, move |state| {
        let (plan, file) = (state.plan_with(&what_if)?, state.limb()?.saved_plan());
        if file.exists() && !replace {
            return Err(StudioError::Exists(file));
        }
        plan.write(&file)?;
        Ok(Saved::of(&file))
    })
    .await
}

/// Saves the moved cameras as a rig that plans and commands can read.
pub(super) async fn cameras(
    Extracted(state): Extracted<Arc<State>>,
    Json(ToSave { what_if, replace }): Json<ToSave>,
) -> Result<Json<Saved>, Response> {
    work(state, move |state| {
        let plan = what_if.plan(&state.plan())?;
        let rig = plan.depth.cameras().map_err(SceneSetupError::from)?;
        let file = state.limb()?.saved_cameras();
        if file.exists() && !replace {
            return Err(StudioError::Exists(file));
        }
        let text = serde_json::to_string_pretty(&rig).expect("names and numbers are JSON");
        write_whole(&file, text.as_bytes())?;
        Ok(Saved::of(&file))
    })
    .await
}

async fn edit(state: Arc<State>, change: impl FnOnce(Case) -> Case + Send + 'static) -> Answer {
    work(state, |state| {
        state.edit(|desk| {
            let case = desk.shown().case.clone();
            desk.change(change(case))
        })?;
        document(state).map(Json)
    })
    .await
}

/// Returns everything that the page shows of the limb except images.
pub(super) fn document(state: &State) -> Result<Document, StudioError> {
    let limb = state.limb()?;
    let [can_undo, can_redo] = limb.desk().can_step();
    let shown = limb.shown();
    let prepared = shown.prepared();
    let grid = prepared.volume.grid();
    let matrix = grid.ct_from_voxel().to_homogeneous();
    let row = |i: usize| [0, 1, 2, 3].map(|j| matrix[(i, j)]);
    let (saved_plan, plan) = (limb.saved_plan(), state.plan());
    let file = limb.case_file();
    let original = file.original();
    let name = original.file_name().unwrap_or_default().to_string_lossy();
    let text = |path: &std::path::Path| path.to_string_lossy().into_owned();
    Ok(Document {
        revision: shown.revision,
        name: name.into_owned(),
        side: shown.case.side,
        limb: prepared.landmarks.limb,
        note: state.note.clone(),
        grid: GridState {
            size: grid.size(),
            spacing_mm: grid.spacing_mm().into(),
            ct_from_voxel: [0, 1, 2, 3].map(row),
        },
        iso_hu: shown.case.surface.iso_hu,
        inside: shown.case.surface.inside,
        crop: shown.case.surface.crop,
        removed: shown.case.surface.removed.clone(),
        core_hu: shown.case.surface.core_hu,
        choices: shown.case.choices.clone(),
        landmarks: prepared.landmarks.clone(),
        automatic: shown.automatic.clone(),
        mortise: limb.mortise,
        findings: prepared.findings.clone(),
        acknowledged: shown.case.acknowledged.clone(),
        report: prepared.limb.report.clone(),
        commands: commands::of_case(&shown.case, original),
        files: Files {
            original: text(original),
            edited: text(file.edited()),
            has_edits: file.has_edits(),
            is_saved: original.exists(),
            plan: state.opened_plan().as_deref().map(text),
            saved_plan: text(&saved_plan),
        },
        can_undo,
        can_redo,
        planned: Planned {
            distal_mm: plan.soft_tissue.distal_mm,
            proximal_mm: plan.soft_tissue.proximal_mm,
            tilt_deg: plan.positioning.tilt_deg,
            beam_across_mm: plan.positioning.beam_shift_mm[0],
            beam_along_mm: plan.positioning.beam_shift_mm[1],
            exposure: Exposure::of(&plan.xray),
            techniques: Technique::ALL
                .map(|(name, technique)| (name, Exposure::of_technique(technique)))
                .into(),
        },
    })
}
