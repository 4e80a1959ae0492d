//! A skin and its walls as one body for cameras.

use nalgebra::Point3;
use ppa_depth::{Body, BodyError, MeshBody};
use ppa_mesh::{CutWalls, Mesh};

/// The skin of a limb, closed by walls where the field of view of its scan cuts it off, so that no camera looks into it.
///
/// `vertices` are those of [`CutWalls::vertices`], possibly moved; triangles come from `skin`, the skin of the scan or a body shape of it.
///
/// # Errors
/// [`BodyError`] for vertices that are not finite or too few.
pub fn closed_skin(
    vertices: &[Point3<f32>],
    skin: &Mesh,
    walls: &CutWalls,
) -> Result<Body, BodyError> {
    let body = MeshBody::new(vertices, &skin.triangles)?;
    Ok(body.with_walls(&walls.triangles)?.into())
}
