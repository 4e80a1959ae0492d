//! Requests of the page and their answers.

mod answer;
mod dataset;
mod document;
mod generation;
mod grading;
mod images;
mod live;
mod plan;
mod room;
mod scan;
mod training;

use std::sync::Arc;

use axum::Router;
use axum::extract::DefaultBodyLimit;
use axum::middleware::from_fn_with_state;
use axum::routing::{get, post};

use crate::guard::guard;
use crate::page;
use crate::state::State;

/// Maximum size of a request body, bytes: the longest is a set of landmarks.
const MAX_BODY: usize = 64 * 1024;

pub(crate) fn router(state: Arc<State>) -> Router {
    let changes = Router::new()
        .route("/choices", post(document::choices))
        .route("/surface", post(document::surface))
        .route("/body", post(document::body))
        .route("/acknowledged", post(document::acknowledged))
        .route("/undo", post(document::undo))
        .route("/redo", post(document::redo))
        .route("/save", post(document::save))
        .route_layer(from_fn_with_state(state.clone(), document::of_open_limb));
    let api = changes
        .route("/state", get(document::state))
        .route("/plan", post(document::plan))
        .route("/cameras", post(document::cameras))
        .route("/slice/{axis}/{index}", get(scan::slice))
        .route("/skin", get(scan::skin))
        .route("/removed", get(scan::removed))
        .route("/body_shape", post(scan::body_shape))
        .route("/surface_at", post(scan::surface_at))
        .route("/room", post(room::room))
        .route("/depth", post(images::depth))
        .route("/radiograph/{pass}", post(images::radiograph))
        .route("/dose", post(images::dose))
        .route("/label", post(room::label))
        .route("/coverage", post(room::coverage))
        .route("/commands", post(images::commands))
        .route("/plan/form", get(plan::form))
        .route("/plan/key", post(plan::key))
        .route("/plan/limits", post(plan::limits))
        .route("/plan/limbs", post(plan::limbs))
        .route("/plan/undo", post(plan::undo))
        .route("/plan/redo", post(plan::redo))
        .route("/plan/save", post(plan::save))
        .route("/forecast", post(generation::forecast))
        .route("/generation", get(generation::state))
        .route("/generation", post(generation::start))
        .route("/generation/pause", post(generation::pause))
        .route("/generation/shards", get(generation::shards))
        .route(
            "/contact_sheet/{patient}/{side}",
            get(generation::contact_sheet),
        )
        .route("/opened", get(dataset::opened))
        .route("/dataset", get(dataset::quality))
        .route("/dataset/check", post(dataset::check))
        .route("/dataset/open", post(dataset::open))
        .route(
            "/dataset/depth/{patient}/{side}/{shape}/{step}",
            get(dataset::depth),
        )
        .route(
            "/dataset/radiograph/{patient}/{side}/{step}",
            get(dataset::radiograph),
        )
        .route("/grading", post(grading::begin))
        .route("/grading/picture/{name}", get(grading::picture))
        .route("/grading/grade", post(grading::grade))
        .route("/grading/import", post(grading::import))
        .route("/trainings", get(training::list))
        .route("/training/log", get(training::log))
        .route("/training/errors", post(training::errors))
        .route("/training/image/{number}", get(training::image))
        .route("/live/{after}", get(live::newest));
    Router::new()
        .route("/", get(page::index))
        .route("/page/{name}", get(page::file))
        .nest("/api", api)
        .layer(DefaultBodyLimit::max(MAX_BODY))
        .layer(from_fn_with_state(state.clone(), guard))
        .with_state(state)
}
