//! Forecast and generation of the plan's dataset.

use std::io::Cursor;
use std::sync::Arc;

use axum::Json;
use axum::extract::{Path, Query, State as Extracted};
use axum::http::header::{CONTENT_TYPE, HeaderValue};
use axum::response::{IntoResponse, Response};
use image::ImageFormat;
use ppa_dataset::layout::{LimbId, Side};
use ppa_generate::{Forecast, free_bytes};
use ppa_report::growing_contact_sheet;
use serde::{Deserialize, Serialize};

use super::answer::work;
use crate::commands::{PlanCommands, of_plan};
use crate::generation::{GenerationState, own_threads};
use crate::shards::ShardState;
use crate::state::State;
use crate::stoppable::StopOnDrop;

/// Maximum number of poses on a contact sheet.
const COLUMNS: usize = 8;

/// A dataset next to the plan.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct Dataset {
    /// Name of its folder.
    pub folder: String,
}

#[derive(Serialize)]
pub(super) struct Estimate {
    #[serde(flatten)]
    forecast: Forecast,
    threads: usize,
    /// Wall time if each thread has its own core.
    wall_hours: f64,
    /// Why the images do not fit on the disk, if so.
    no_room: Option<String>,
}

/// Forecasts the cost of the dataset from one pose of each limb; of several requests, only the newest is answered.
pub(super) async fn forecast(
    Extracted(state): Extracted<Arc<State>>,
    Json(Dataset { folder }): Json<Dataset>,
) -> Result<Json<Estimate>, Response> {
    let stop = state.forecast.begin();
    let _stop = StopOnDrop(stop.clone());
    work(state, move |state| {
        let root = state.dataset(&folder)?;
        let (_, plan) = state.plan_on_disk()?;
        let threads = own_threads()?;
        let forecast =
            threads.install(|| ppa_generate::forecast(&plan, &root, 0.0, &stop, &|_| {}))?;
        let fits = forecast.fits(&root);
        Ok(Json(Estimate {
            wall_hours: forecast.cpu_hours / threads.current_num_threads() as f64,
            threads: threads.current_num_threads(),
            no_room: fits.err().map(|error| error.to_string()),
            forecast,
        }))
    })
    .await
}

/// State of a dataset, with the commands that make it.
#[derive(Serialize)]
pub(super) struct Generated {
    #[serde(flatten)]
    state: GenerationState,
    free_bytes: Option<u64>,
    commands: PlanCommands,
}

type Answer = Result<Json<Generated>, Response>;

pub(super) async fn state(
    Extracted(state): Extracted<Arc<State>>,
    Query(Dataset { folder }): Query<Dataset>,
) -> Answer {
    work(state, move |state| generated(state, &folder)).await
}

/// Starts to make the missing part of the dataset.
pub(super) async fn start(
    Extracted(state): Extracted<Arc<State>>,
    Json(Dataset { folder }): Json<Dataset>,
) -> Answer {
    work(state, move |state| {
        let root = state.dataset(&folder)?;
        let (_, plan) = state.plan_on_disk()?;
        state.generation.start(plan, root)?;
        generated(state, &folder)
    })
    .await
}

/// Ends the run after the current poses.
pub(super) async fn pause(
    Extracted(state): Extracted<Arc<State>>,
    Json(Dataset { folder }): Json<Dataset>,
) -> Answer {
    work(state, move |state| {
        state.generation.pause();
        generated(state, &folder)
    })
    .await
}

fn generated(state: &State, folder: &str) -> Result<Json<Generated>, crate::error::StudioError> {
    let root = state.dataset(folder)?;
    let plan = state.plan_file().current().to_owned();
    Ok(Json(Generated {
        state: state.generation.state(&root)?,
        free_bytes: free_bytes(&root),
        commands: of_plan(&plan, &root),
    }))
}

/// Answers with the shards made by other machines.
pub(super) async fn shards(
    Extracted(state): Extracted<Arc<State>>,
    Query(Dataset { folder }): Query<Dataset>,
) -> Result<Json<Vec<ShardState>>, Response> {
    work(state, move |state| {
        let root = state.dataset(&folder)?;
        crate::shards::shards(&root).map(Json)
    })
    .await
}

/// Answers with a contact sheet of a limb's poses so far, PNG.
pub(super) async fn contact_sheet(
    Extracted(state): Extracted<Arc<State>>,
    Path((patient, side)): Path<(u32, Side)>,
    Query(Dataset { folder }): Query<Dataset>,
) -> Result<Response, Response> {
    let ticket = state.sheet.enter();
    let png = work(state, move |state| {
        let _turn = state.sheet.turn(&ticket)?;
        let root = state.dataset(&folder)?;
        let sheet = growing_contact_sheet(&root, LimbId { patient, side }, COLUMNS)?;
        let mut png = Cursor::new(Vec::new());
        sheet.write_to(&mut png, ImageFormat::Png)?;
        Ok(png.into_inner())
    })
    .await?;
    Ok(([(CONTENT_TYPE, HeaderValue::from_static("image/png"))], png).into_response())
}
