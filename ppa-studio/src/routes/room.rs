//! Poses of all objects in the room.

use std::sync::Arc;

use axum::Json;
use axum::extract::State as Extracted;
use axum::response::Response;
use nalgebra::{Point2, Point3};
use ppa_core::TransformRows;
use ppa_dataset::layout::View;
use ppa_depth::{CoverageSettings, rows_from_isometry};
use ppa_generate::{CoverageStudy, JointInRoom, Plan, SceneSetup};
use ppa_label::PoseLabel;
use ppa_scene::{Contact, Placement, ct_from_device};
use serde::Serialize;

use super::answer::work;
use crate::desk::Shown;
use crate::error::StudioError;
use crate::state::State;
use crate::what_if::WhatIf;

/// Limb, device, detector and cameras in the room frame, mm.
#[derive(Serialize)]
pub(super) struct Room {
    room_from_ct: TransformRows,
    room_from_device: TransformRows,
    contact: Contact,
    /// The focal spot.
    source: Point3<f64>,
    /// Corners of the detector, in circular order.
    detector: [Point3<f64>; 4],
    /// Point where the central beam meets the table.
    table_centre: Point3<f64>,
    table_size_mm: [f64; 2],
    cameras: Vec<CameraState>,
}

#[derive(Serialize)]
struct CameraState {
    view: View,
    room_from_camera: TransformRows,
    centre: Point3<f64>,
    /// Points seen by the corners of the image at a depth of 1 m, in circular order.
    corners: Vec<Point3<f64>>,
}

/// Answers with the computed label of the pose; `null` if the case names no bones.
pub(super) async fn label(
    Extracted(state): Extracted<Arc<State>>,
    Json(what_if): Json<WhatIf>,
) -> Result<Json<Option<PoseLabel>>, Response> {
    let ticket = state.label.enter();
    work(state, move |state| {
        let _turn = state.label.turn(&ticket)?;
        let plan = what_if.plan(&state.plan())?;
        let limb = state.limb()?;
        let setup = limb.scenes.setup(&plan)?;
        let shown = limb.shown();
        let (placement, landmarks) = (
            place(&setup, &shown, &plan, &what_if)?,
            &shown.prepared().landmarks,
        );
        let device = &setup.table.room.device;
        let ct_from_device = ct_from_device(&placement, landmarks, device);
        let label = limb.labels.of(&shown, ct_from_device.isometry())?;
        Ok(Json(label))
    })
    .await
}

/// Answers with both cameras' coverage of the skin near the joint; of several requests, only the newest is answered.
pub(super) async fn coverage(
    Extracted(state): Extracted<Arc<State>>,
    Json(what_if): Json<WhatIf>,
) -> Result<Json<CoverageStudy>, Response> {
    let ticket = state.coverage.enter();
    work(state, move |state| {
        let _turn = state.coverage.turn(&ticket)?;
        let plan = what_if.plan(&state.plan())?;
        let limb = state.limb()?;
        let setup = limb.scenes.setup(&plan)?;
        let shown = limb.shown();
        let angle_rad = what_if.angle_deg.to_radians();
        let joint = JointInRoom::new(&setup, shown.prepared(), angle_rad, plan.positioning)?;
        Ok(Json(
            joint.rank(&joint.rig(), &CoverageSettings::default())?,
        ))
    })
    .await
}

/// Places the limb on the table.
fn place(
    setup: &SceneSetup,
    shown: &Shown,
    plan: &Plan,
    what_if: &WhatIf,
) -> Result<Placement, StudioError> {
    let prepared = shown.prepared();
    let (skin, landmarks) = (&prepared.limb.mesh, &prepared.landmarks);
    let angle_rad = what_if.angle_deg.to_radians();
    Ok((setup.table).place(skin, landmarks, angle_rad, &plan.place_settings())?)
}

pub(super) async fn room(
    Extracted(state): Extracted<Arc<State>>,
    Json(what_if): Json<WhatIf>,
) -> Result<Json<Room>, Response> {
    work(state, move |state| {
        let plan = what_if.plan(&state.plan())?;
        let limb = state.limb()?;
        let setup = limb.scenes.setup(&plan)?;
        let shown = limb.shown();
        let landmarks = &shown.prepared().landmarks;
        let placement = place(&setup, &shown, &plan, &what_if)?;
        let table = &setup.table;
        let room_from_ct = placement.room_from_patient * landmarks.patient_from_ct();
        let device = &table.room.device;
        let detector = &plan.xray.detector;
        let [x, y] = detector.centre_mm;
        let [width, height] =
            [detector.columns, detector.rows].map(|count| f64::from(count) * detector.pixel_mm);
        let (low, high) = (
            [x - 0.5 * width, y - 0.5 * height],
            [x + 0.5 * width, y + 0.5 * height],
        );
        let z = device.source_detector_mm;
        let corners = [
            [low[0], low[1]],
            [high[0], low[1]],
            [high[0], high[1]],
            [low[0], high[1]],
        ];
        let room_from_device = device.room_from_device.isometry();
        let spec = &plan.room.parametric;
        let cameras = setup.cameras.iter().map(|placed| {
            let room_from_camera = placed.camera_from_room.inverse();
            let camera = &placed.camera;
            let [w, h] = [camera.width(), camera.height()].map(|n| f64::from(n) - 0.5);
            let corners = [[-0.5, -0.5], [w, -0.5], [w, h], [-0.5, h]];
            let ray = |[u, v]: [f64; 2]| camera.unproject(&Point2::new(u, v));
            CameraState {
                view: placed.view,
                room_from_camera: rows_from_isometry(&room_from_camera),
                centre: room_from_camera * Point3::origin(),
                corners: corners
                    .into_iter()
                    .filter_map(ray)
                    .map(|at| room_from_camera * Point3::new(1e3 * at.x, 1e3 * at.y, 1e3))
                    .collect(),
            }
        });
        Ok(Json(Room {
            room_from_ct: rows_from_isometry(room_from_ct.isometry()),
            room_from_device: rows_from_isometry(room_from_device),
            contact: placement.contact,
            source: device.source(),
            detector: corners.map(|[x, y]| room_from_device * Point3::new(x, y, z)),
            table_centre: table.plane.plane.project(&Point3::origin()),
            table_size_mm: [spec.table_width_mm, spec.table_length_mm],
            cameras: cameras.collect(),
        }))
    })
    .await
}
