//! The dataset: poses, findings, splits, images of a pose, and limbs.

use std::sync::Arc;

use axum::Json;
use axum::extract::{Path, Query, State as Extracted};
use axum::response::Response;
use ppa_dataset::layout::{LimbId, Side, View};
use ppa_dataset::published::{GrayImage16, inspect};
use ppa_dataset::split::Split;
use ppa_dataset::{BodyShape, Findings, LimbFinding, Manifest};
use ppa_generate::Case;
use ppa_report::{PoseRow, pose_rows};
use serde::Serialize;

use super::answer::{png_file, work};
use super::document::{Document, document};
use super::generation::Dataset;
use crate::commands::{DatasetCommands, of_dataset};
use crate::error::StudioError;
use crate::false_colours::side_by_side;
use crate::generation::own_threads;
use crate::png::png;
use crate::state::State;

/// The open files.
#[derive(Serialize)]
pub(super) struct Opened {
    limb: bool,
    plan: bool,
    /// Name of the opened dataset, if any.
    dataset: Option<String>,
    /// Folder of the watched frames, if any.
    watched: Option<String>,
}

pub(super) async fn opened(Extracted(state): Extracted<Arc<State>>) -> Json<Opened> {
    let dataset = state.opened_dataset.as_ref();
    let name = dataset.and_then(|root| root.file_name());
    let limb = state.limb().is_ok();
    Json(Opened {
        limb,
        plan: limb || state.opened_plan().is_some(),
        dataset: name.map(|name| name.to_string_lossy().into_owned()),
        watched: state
            .live
            .as_ref()
            .map(|live| live.watch.folder.display().to_string()),
    })
}

/// Data of the quality report.
#[derive(Serialize)]
pub(super) struct Quality {
    poses: Vec<PoseRow>,
    findings: Vec<LimbFinding>,
    splits: Vec<SplitState>,
    /// Limbs that can be opened because the plan names their cases.
    at_hand: Vec<LimbId>,
    commands: DatasetCommands,
}

#[derive(Serialize)]
struct SplitState {
    name: String,
    /// Parts with their patients.
    parts: Vec<(String, Vec<u32>)>,
    /// Why the split cannot be used.
    error: Option<String>,
}

impl SplitState {
    fn of(name: String, root: &std::path::Path, patients: &[u32]) -> Self {
        let read = Split::read(&Split::path(root, &name));
        match read.and_then(|split| split.check(patients).map(|()| split)) {
            Ok(split) => Self {
                name,
                parts: split.parts.into_iter().collect(),
                error: None,
            },
            Err(error) => Self {
                name,
                parts: Vec::new(),
                error: Some(ppa_core::text::error_chain(&error)),
            },
        }
    }
}

/// Answers with the quality report of a dataset, or `null` if the plan's dataset is not made yet.
pub(super) async fn quality(
    Extracted(state): Extracted<Arc<State>>,
    Query(Dataset { folder }): Query<Dataset>,
) -> Result<Json<Option<Quality>>, Response> {
    let ticket = state.quality.enter();
    work(state, move |state| {
        let _turn = state.quality.turn(&ticket)?;
        let root = state.dataset(&folder)?;
        if state.opened_dataset.is_none() && !root.join(Manifest::FILE).exists() {
            return Ok(Json(None));
        }
        let poses = pose_rows(&root)?;
        let mut patients: Vec<u32> = poses.iter().map(|pose| pose.limb.patient).collect();
        patients.dedup();
        let names = Split::names(&root)?;
        let splits = names
            .into_iter()
            .map(|name| SplitState::of(name, &root, &patients));
        Ok(Json(Some(Quality {
            findings: Findings::read(&root)?.0,
            splits: splits.collect(),
            at_hand: at_hand(state),
            commands: of_dataset(&root),
            poses,
        })))
    })
    .await
}

/// Returns the limbs of the plan whose cases can be read.
fn at_hand(state: &State) -> Vec<LimbId> {
    let plan = state.plan();
    let limbs = plan.cases.iter().filter_map(|planned| {
        let (case, patient) = (Case::read(&planned.file).ok()?, planned.patient);
        let side = case.side;
        Some(LimbId { patient, side })
    });
    limbs.collect()
}

/// Result of the check of a dataset's files.
#[derive(Serialize)]
pub(super) struct Checked {
    depth_images: usize,
    radiographs: usize,
    flaws: Vec<String>,
}

/// Decodes all images and compares them with the lists; of several requests, only the newest is answered.
pub(super) async fn check(
    Extracted(state): Extracted<Arc<State>>,
    Json(Dataset { folder }): Json<Dataset>,
) -> Result<Json<Checked>, Response> {
    let ticket = state.check.enter();
    work(state, move |state| {
        let _turn = state.check.turn(&ticket)?;
        let root = state.dataset(&folder)?;
        let found = own_threads()?.install(|| inspect(&root))?;
        let flaws = found.flaws.iter();
        Ok(Json(Checked {
            depth_images: found.depth_images,
            radiographs: found.radiographs,
            flaws: flaws
                .map(|flaw| ppa_core::text::error_chain(flaw))
                .collect(),
        }))
    })
    .await
}

/// Answers with a PNG of a pose's depth images of both cameras in false colour.
pub(super) async fn depth(
    Extracted(state): Extracted<Arc<State>>,
    Path((patient, side, shape, step)): Path<(u32, Side, BodyShape, u32)>,
    Query(Dataset { folder }): Query<Dataset>,
) -> Result<Response, Response> {
    let png = work(state, move |state| {
        let root = state.dataset(&folder)?;
        let limb = LimbId { patient, side };
        let images =
            View::ALL.map(|view| GrayImage16::read(&root.join(limb.depth(shape, view, step))));
        let images: Vec<GrayImage16> = images.into_iter().collect::<Result<_, _>>()?;
        Ok::<_, StudioError>(png(side_by_side(&images).0)?)
    })
    .await?;
    Ok(png_file(png))
}

/// Answers with the radiograph of a pose, PNG.
pub(super) async fn radiograph(
    Extracted(state): Extracted<Arc<State>>,
    Path((patient, side, step)): Path<(u32, Side, u32)>,
    Query(Dataset { folder }): Query<Dataset>,
) -> Result<Response, Response> {
    let png = work(state, move |state| {
        let file = LimbId { patient, side }.radiograph_png(step);
        let path = state.dataset(&folder)?.join(file);
        let read = ppa_core::regular_file::read(&path);
        let read = read.map_err(ppa_dataset::files::FileError::at("read", &path));
        Ok::<_, StudioError>(read?)
    })
    .await?;
    Ok(png_file(png))
}

/// Opens a limb of the plan, so that steps 1 to 5 show it.
pub(super) async fn open(
    Extracted(state): Extracted<Arc<State>>,
    Json(limb): Json<LimbId>,
) -> Result<Json<Document>, Response> {
    work(state, move |state| {
        state.open_limb(limb)?;
        document(state).map(Json)
    })
    .await
}
