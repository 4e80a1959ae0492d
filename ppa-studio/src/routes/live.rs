//! The newest pair of frames with its prediction.

use std::sync::Arc;

use axum::extract::{Path, State as Extracted};
use axum::http::StatusCode;
use axum::response::{IntoResponse, Response};
use serde::Serialize;

use super::answer::{picture, work};
use crate::live::LiveReport;
use crate::state::State;

/// Report on a pair.
#[derive(Serialize)]
struct Aged<'a> {
    #[serde(flatten)]
    report: &'a LiveReport,
    /// Age of its frames, seconds.
    age_s: f64,
}

/// Answers with the picture and report of the newest pair if its number is above `after`, otherwise with no content.
pub(super) async fn newest(
    Extracted(state): Extracted<Arc<State>>,
    Path(after): Path<u64>,
) -> Result<Response, Response> {
    let found = work(state, move |state| match &state.live {
        Some(live) => live.newest(after),
        None => Ok(None),
    })
    .await?;
    Ok(match found {
        Some(pair) => {
            let age_s = pair.age_s();
            let report = &pair.report;
            picture(pair.png.clone(), &Aged { report, age_s })
        }
        None => StatusCode::NO_CONTENT.into_response(),
    })
}
