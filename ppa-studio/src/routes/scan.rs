//! Slices of the scan, and the skin.

use std::sync::Arc;

use axum::Json;
use axum::extract::{Path, State as Extracted};
use axum::response::Response;
use ppa_dataset::BodyShape;
use ppa_dataset::layout::LimbId;
use ppa_generate::{PoseError, PreparedLimb};
use serde::Deserialize;

use super::answer::{bytes, work};
use crate::display_mesh::{self, display_mesh};
use crate::error::StudioError;
use crate::state::State;

/// Answers with a slice across a voxel axis: HU as little-endian i16, then one byte per voxel, 1 inside the limb. The row
/// number increases along the later axis.
pub(super) async fn slice(
    Extracted(state): Extracted<Arc<State>>,
    Path((axis, index)): Path<(usize, usize)>,
) -> Result<Response, Response> {
    work(state, move |state| {
        let shown = state.limb()?.shown();
        plane(shown.prepared(), axis, index)
    })
    .await
    .map(bytes)
}

fn plane(limb: &PreparedLimb, axis: usize, index: usize) -> Result<Vec<u8>, StudioError> {
    let grid = limb.volume.grid();
    let size = grid.size();
    if axis > 2 || index >= size[axis] {
        let [i, j, k] = size;
        return Err(StudioError::Invalid(format!(
            "slice {index} across axis {axis} is outside the scan of {i} x {j} x {k} voxels"
        )));
    }
    let (column, row) = match axis {
        0 => (1, 2),
        1 => (0, 2),
        _ => (0, 1),
    };
    let pixels = (0..size[row]).flat_map(|r| (0..size[column]).map(move |c| (r, c)));
    let voxels = pixels.map(|(r, c)| {
        let mut voxel = [index; 3];
        (voxel[column], voxel[row]) = (c, r);
        voxel
    });
    let voxels: Vec<[usize; 3]> = voxels.collect();
    // Saturates at 16 bits, which is enough for display.
    let hu = voxels
        .iter()
        .map(|&voxel| limb.volume.at(voxel).round() as i16);
    let mut plane: Vec<u8> = hu.flat_map(i16::to_le_bytes).collect();
    let inside = voxels
        .iter()
        .map(|&voxel| limb.limb.mask[grid.index(voxel)]);
    plane.extend(inside.map(u8::from));
    Ok(plane)
}

/// Answers with the skin, simplified for display.
pub(super) async fn skin(Extracted(state): Extracted<Arc<State>>) -> Result<Response, Response> {
    work(state, |state| {
        let shown = state.limb()?.shown();
        let (skin, _) = display_mesh(&shown.prepared().limb.mesh, &[]);
        Ok(display_mesh::bytes(&skin, &[]))
    })
    .await
    .map(bytes)
}

/// Answers with the coarse surface of the parts removed outside and inside the limb, shown with the skin.
pub(super) async fn removed(Extracted(state): Extracted<Arc<State>>) -> Result<Response, Response> {
    work(state, |state| {
        let limb = state.limb()?;
        let shown = limb.shown();
        let iso_hu = shown.case.surface.iso_hu as f32;
        let surface = limb.coarse.removed(shown.prepared(), iso_hu)?;
        Ok(display_mesh::bytes(&surface, &[]))
    })
    .await
    .map(bytes)
}

/// A body shape.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct ShapeOf {
    shape: BodyShape,
}

/// Answers with the skin in a body shape of the plan's dataset, for display, and the outward displacement of each vertex, mm.
pub(super) async fn body_shape(
    Extracted(state): Extracted<Arc<State>>,
    Json(ShapeOf { shape }): Json<ShapeOf>,
) -> Result<Response, Response> {
    work(state, move |state| {
        let (plan, shown) = (state.plan(), state.limb()?.shown());
        let limb = shown.prepared();
        let (skin, landmarks, side) = (&limb.limb.mesh, &limb.landmarks, shown.case.side);
        let patient = state.patient()?;
        let id = LimbId { patient, side };
        let shaped = ppa_generate::body_shape(skin, landmarks, shape, &plan.shapes, id, plan.seed)
            .map_err(PoseError::from)?;
        let before = skin.vertices.iter().zip(&skin.normals);
        let moved = before.zip(&shaped.vertices);
        let outwards: Vec<f32> = moved
            .map(|((before, normal), after)| (after - before).dot(normal))
            .collect();
        let (shaped, outwards) = display_mesh(&shaped, &outwards);
        Ok(display_mesh::bytes(&shaped, &outwards))
    })
    .await
    .map(bytes)
}

/// HU of a surface.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct SurfaceAt {
    iso_hu: f32,
}

/// Answers with the coarse surface of everything in the scan at a HU, shown while a slider moves.
pub(super) async fn surface_at(
    Extracted(state): Extracted<Arc<State>>,
    Json(SurfaceAt { iso_hu }): Json<SurfaceAt>,
) -> Result<Response, Response> {
    let ticket = state.surface.enter();
    work(state, move |state| {
        let _turn = state.surface.turn(&ticket)?;
        let limb = state.limb()?;
        let surface = limb.coarse.surface(iso_hu)?;
        Ok(display_mesh::bytes(&surface, &[]))
    })
    .await
    .map(bytes)
}
