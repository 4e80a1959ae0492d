//! Training runs: progress, curves, errors, and the images with the largest errors.

use std::sync::Arc;

use axum::Json;
use axum::extract::{Path, Query, State as Extracted};
use axum::response::Response;
use ppa_dataset::published::GrayImage16;
use ppa_learn::train::LogRow;
use serde::{Deserialize, Serialize};

use super::answer::{png_file, work};
use crate::commands::of_watch;
use crate::error::StudioError;
use crate::false_colours::side_by_side;
use crate::generation::own_threads;
use crate::newest::CancelOnDrop;
use crate::png::png;
use crate::state::State;
use crate::training_errors::Errors;
use crate::trainings::TrainingState;

/// The training runs found.
#[derive(Serialize)]
pub(super) struct List {
    /// Searched folder.
    folder: String,
    trainings: Vec<TrainingState>,
    /// Command that predicts from the watched frames, if any.
    watch: Option<String>,
}

/// Name of a training run in the list.
#[derive(Deserialize)]
pub(super) struct Named {
    run: String,
}

pub(super) async fn list(Extracted(state): Extracted<Arc<State>>) -> Result<Json<List>, Response> {
    work(state, |state| {
        let live = state.live.as_ref();
        Ok(Json(List {
            folder: state.trainings.start().display().to_string(),
            trainings: state.trainings.states()?,
            watch: live.map(|live| of_watch(&live.networks, &live.watch)),
        }))
    })
    .await
}

pub(super) async fn log(
    Extracted(state): Extracted<Arc<State>>,
    Query(Named { run }): Query<Named>,
) -> Result<Json<Vec<LogRow>>, Response> {
    work(state, move |state| state.trainings.log(&run).map(Json)).await
}

/// Predicts the evaluation images; of several requests, only the newest is answered, if its sender still waits.
pub(super) async fn errors(
    Extracted(state): Extracted<Arc<State>>,
    Json(Named { run }): Json<Named>,
) -> Result<Json<Errors>, Response> {
    let ticket = state.training_errors.turn.enter();
    let _cancel = CancelOnDrop(ticket.clone());
    work(state, move |state| {
        let _turn = state.training_errors.turn.turn(&ticket)?;
        let folder = state.trainings.folder(&run)?;
        // Images for the page do not wait for it.
        let compute = || state.training_errors.compute(&folder, &ticket);
        own_threads()?.install(compute).map(Json)
    })
    .await
}

/// Answers with an image with one of the largest errors in false colour, PNG.
pub(super) async fn image(
    Extracted(state): Extracted<Arc<State>>,
    Path(number): Path<usize>,
    Query(Named { run }): Query<Named>,
) -> Result<Response, Response> {
    let png = work(state, move |state| {
        let folder = state.trainings.folder(&run)?;
        let files = state.training_errors.images(&folder, number)?;
        let images: Result<Vec<_>, _> = files.iter().map(|file| GrayImage16::read(file)).collect();
        Ok::<_, StudioError>(png(side_by_side(&images?).0)?)
    })
    .await?;
    Ok(png_file(png))
}
