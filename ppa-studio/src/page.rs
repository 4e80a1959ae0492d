//! The files of the page, compiled into the program.

use axum::extract::Path;
use axum::http::StatusCode;
use axum::http::header::{CONTENT_TYPE, HeaderValue};
use axum::response::{IntoResponse, Response};

const INDEX: &str = include_str!("page/index.html");

const FILES: &[(&str, &str)] = &[
    ("style.css", include_str!("page/style.css")),
    ("main.js", include_str!("page/main.js")),
    ("server.js", include_str!("page/server.js")),
    ("geometry.js", include_str!("page/geometry.js")),
    ("slices.js", include_str!("page/slices.js")),
    ("surface.js", include_str!("page/surface.js")),
    ("shape.js", include_str!("page/shape.js")),
    ("view3d.js", include_str!("page/view3d.js")),
    ("software.js", include_str!("page/software.js")),
    ("landmarks.js", include_str!("page/landmarks.js")),
    ("whatif.js", include_str!("page/whatif.js")),
    ("scan.js", include_str!("page/scan.js")),
    ("crop.js", include_str!("page/crop.js")),
    ("cuts.js", include_str!("page/cuts.js")),
    ("bodies.js", include_str!("page/bodies.js")),
    ("cameras.js", include_str!("page/cameras.js")),
    ("room.js", include_str!("page/room.js")),
    ("elements.js", include_str!("page/elements.js")),
    ("plan.js", include_str!("page/plan.js")),
    ("generation.js", include_str!("page/generation.js")),
    ("dataset.js", include_str!("page/dataset.js")),
    ("dose.js", include_str!("page/dose.js")),
    ("grading.js", include_str!("page/grading.js")),
    ("training.js", include_str!("page/training.js")),
    ("live.js", include_str!("page/live.js")),
    ("charts.js", include_str!("page/charts.js")),
];

pub(crate) async fn index() -> Response {
    typed("text/html; charset=utf-8", INDEX)
}

pub(crate) async fn file(Path(name): Path<String>) -> Response {
    match FILES.iter().find(|(known, _)| *known == name) {
        Some((name, text)) if name.ends_with(".css") => typed("text/css; charset=utf-8", text),
        Some((_, text)) => typed("text/javascript; charset=utf-8", text),
        None => StatusCode::NOT_FOUND.into_response(),
    }
}

fn typed(kind: &'static str, text: &'static str) -> Response {
    ([(CONTENT_TYPE, HeaderValue::from_static(kind))], text).into_response()
}
