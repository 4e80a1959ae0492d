//! Depth images and radiographs of a pose.

use std::sync::Arc;

use axum::Json;
use axum::extract::{Path, State as Extracted};
use axum::http::StatusCode;
use axum::response::Response;

use super::answer::{picture, sentence, work};
use crate::commands::{ImageCommands, of_images};
use crate::dose::{DoseReport, absorbed_dose};
use crate::newest::CancelOnDrop;
use crate::scene::Pass;
use crate::state::State;
use crate::what_if::WhatIf;

/// Renders both depth images; of several requests, only the newest is answered.
pub(super) async fn depth(
    Extracted(state): Extracted<Arc<State>>,
    Json(what_if): Json<WhatIf>,
) -> Result<Response, Response> {
    let ticket = state.depth.enter();
    let made = work(state, move |state| {
        let _turn = state.depth.turn(&ticket)?;
        let limb = state.limb()?;
        let network = state.network.as_ref();
        // Bumps differ between patients.
        let patient = match what_if.shape {
            Some(_) => state.patient()?,
            None => 0,
        };
        (limb.scenes).depth(&limb.shown(), &state.plan(), &what_if, patient, network)
    })
    .await?;
    Ok(picture(made.png, &made.report))
}

/// Computes a radiograph, `first` with larger pixels or `final`, until a newer request arrives or nobody waits any more.
pub(super) async fn radiograph(
    Extracted(state): Extracted<Arc<State>>,
    Path(pass): Path<String>,
    Json(what_if): Json<WhatIf>,
) -> Result<Response, Response> {
    let pass = match &*pass {
        "first" => Pass::First,
        "final" => Pass::Final,
        _ => {
            let error = "expected first or final".to_owned();
            return Err(sentence(StatusCode::NOT_FOUND, error));
        }
    };
    let ticket = state.radiograph.enter();
    let _cancel = CancelOnDrop(ticket.clone());
    let made = work(state, move |state| {
        let _turn = state.radiograph.turn(&ticket)?;
        let limb = state.limb()?;
        let scenes = &limb.scenes;
        scenes.radiograph(&limb.shown(), &state.plan(), &what_if, pass, &ticket)
    })
    .await?;
    Ok(picture(made.png, &made.report))
}

/// Computes the absorbed dose, until a newer request for a dose or a radiograph arrives or nobody waits any more.
pub(super) async fn dose(
    Extracted(state): Extracted<Arc<State>>,
    Json(what_if): Json<WhatIf>,
) -> Result<Json<DoseReport>, Response> {
    let ticket = state.radiograph.enter();
    let _cancel = CancelOnDrop(ticket.clone());
    work(state, move |state| {
        let _turn = state.radiograph.turn(&ticket)?;
        let limb = state.limb()?;
        let plan = what_if.plan(&state.plan())?;
        let exposable = limb.scenes.exposable(&limb.shown(), &plan)?;
        absorbed_dose(&exposable, what_if.angle_deg, plan.seed, &ticket).map(Json)
    })
    .await
}

/// Answers with the commands that make these images.
pub(super) async fn commands(
    Extracted(state): Extracted<Arc<State>>,
    Json(what_if): Json<WhatIf>,
) -> Result<Json<ImageCommands>, Response> {
    work(state, move |state| {
        let limb = state.limb()?;
        let (case, saved) = (limb.case_on_disk(), limb.saved_plan());
        let plan = state.opened_plan();
        let seed = state.plan().seed;
        Ok(Json(of_images(
            &case,
            plan.as_deref(),
            &saved,
            seed,
            &what_if,
        )))
    })
    .await
}
