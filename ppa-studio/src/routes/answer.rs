//! Answers: JSON, bytes, or an error as one sentence.

use std::sync::Arc;

use axum::Json;
use axum::http::StatusCode;
use axum::http::header::{CONTENT_TYPE, HeaderName, HeaderValue};
use axum::response::{IntoResponse, Response};
use serde::Serialize;

use crate::error::StudioError;
use crate::state::State;

/// Header with the JSON report of an image.
pub(super) const REPORT: HeaderName = HeaderName::from_static("x-report");

/// An error message for the user of the page.
#[derive(Serialize)]
struct Sentence {
    error: String,
}

/// Does longer work outside the threads that serve requests.
pub(super) async fn work<T: Send + 'static>(
    state: Arc<State>,
    work: impl FnOnce(&State) -> Result<T, StudioError> + Send + 'static,
) -> Result<T, Response> {
    match tokio::task::spawn_blocking(move || work(&state)).await {
        Ok(done) => done.map_err(failed),
        // A panic is a bug, but must not end the page.
        Err(error) => Err(sentence(
            StatusCode::INTERNAL_SERVER_ERROR,
            format!("internal error: {error}"),
        )),
    }
}

/// Converts an error to an answer.
pub(super) fn failed(error: StudioError) -> Response {
    let status = match error {
        StudioError::Superseded
        | StudioError::ChangedElsewhere(_)
        | StudioError::Exists(_)
        | StudioError::OtherLimb(_)
        | StudioError::Generating(_) => StatusCode::CONFLICT,
        _ => StatusCode::UNPROCESSABLE_ENTITY,
    };
    sentence(status, ppa_core::text::error_chain(&error))
}

pub(super) fn sentence(status: StatusCode, error: String) -> Response {
    (status, Json(Sentence { error })).into_response()
}

/// Escapes all characters of JSON that a header must not contain.
fn ascii_json(json: &str) -> String {
    let mut ascii = String::new();
    for c in json.chars() {
        match c {
            ' '..='~' => ascii.push(c),
            _ => {
                for unit in c.encode_utf16(&mut [0; 2]) {
                    ascii += &format!("\\u{unit:04x}");
                }
            }
        }
    }
    ascii
}

/// Answers with a PNG file.
pub(super) fn png_file(png: Vec<u8>) -> Response {
    ([(CONTENT_TYPE, HeaderValue::from_static("image/png"))], png).into_response()
}

/// Answers with an image and its report.
pub(super) fn picture(png: Vec<u8>, report: &impl Serialize) -> Response {
    let report = ascii_json(&serde_json::to_string(report).unwrap_or_default());
    let report = HeaderValue::from_str(&report).unwrap_or(HeaderValue::from_static("{}"));
    let kind = HeaderValue::from_static("image/png");
    ([(CONTENT_TYPE, kind), (REPORT, report)], png).into_response()
}

pub(super) fn bytes(bytes: Vec<u8>) -> Response {
    let kind = HeaderValue::from_static("application/octet-stream");
    ([(CONTENT_TYPE, kind)], bytes).into_response()
}
