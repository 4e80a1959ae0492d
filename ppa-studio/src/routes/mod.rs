//! What the page asks for, and the answers.

mod answer;
mod document;
mod images;
mod room;
mod scan;

use std::sync::Arc;

use axum::Router;
use axum::extract::DefaultBodyLimit;
use axum::middleware::from_fn_with_state;
use axum::routing::{get, post};

use crate::guard::guard;
use crate::page;
use crate::state::State;

/// Largest body of a request, bytes: the longest is a set of landmarks.
const MAX_BODY: usize = 64 * 1024;

pub(crate) fn router(state: Arc<State>) -> Router {
    let api = Router::new()
        .route("/state", get(document::state))
        .route("/choices", post(document::choices))
        .route("/surface", post(document::surface))
        .route("/acknowledged", post(document::acknowledged))
        .route("/undo", post(document::undo))
        .route("/redo", post(document::redo))
        .route("/save", post(document::save))
        .route("/plan", post(document::plan))
        .route("/slice/{axis}/{index}", get(scan::slice))
        .route("/skin", get(scan::skin))
        .route("/surface_at", post(scan::surface_at))
        .route("/room", post(room::room))
        .route("/depth", post(images::depth))
        .route("/radiograph/{pass}", post(images::radiograph))
        .route("/label", post(room::label))
        .route("/commands", post(images::commands));
    Router::new()
        .route("/", get(page::index))
        .route("/page/{name}", get(page::file))
        .nest("/api", api)
        .layer(DefaultBodyLimit::max(MAX_BODY))
        .layer(from_fn_with_state(state.clone(), guard))
        .with_state(state)
}
