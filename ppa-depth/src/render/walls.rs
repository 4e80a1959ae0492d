//! Walls: triangles that close a mesh where its source was cut off.

use serde::{Deserialize, Serialize};

use crate::camera::projection::Camera;
use crate::image::{DepthError, DepthImage};
use crate::render::body::PlacedBody;
use crate::render::ideal::{SeenBody, draw_open, draw_walls};

/// Depth where a wall is the nearest surface. What was there before the cut is unknown.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum WallDepth {
    /// 0: no depth, and no light for a sensor.
    #[default]
    Invalid,
    /// The depth of the wall, like that of any surface.
    Flat,
}

/// A depth image, and where it sees walls.
#[derive(Debug, Clone, PartialEq)]
pub struct WalledImage {
    /// Depth at the centres of the pixels.
    pub image: DepthImage,
    /// Pixels (row-major index, rising) at whose centre a wall is the nearest surface.
    pub wall_pixels: Vec<u32>,
}

/// Renders bodies in front of a background of the same camera, which was rendered once; `walls` sets how their walls are
/// treated. Walls hide what is behind them, background included, in either case.
///
/// # Errors
/// The same as [`DepthImage::before`]; walls count as part of the bodies.
pub fn render_before(
    camera: &Camera,
    bodies: &[PlacedBody],
    background: &DepthImage,
    walls: WallDepth,
) -> Result<WalledImage, DepthError> {
    seen_before(camera, &SeenBody::all(camera, bodies), background, walls)
}

pub(crate) fn seen_before(
    camera: &Camera,
    bodies: &[SeenBody],
    background: &DepthImage,
    walls: WallDepth,
) -> Result<WalledImage, DepthError> {
    let open = draw_open(camera, bodies);
    let Some(only_walls) = draw_walls(camera, bodies) else {
        let image = open.before(background)?;
        return Ok(WalledImage {
            image,
            wall_pixels: Vec::new(),
        });
    };
    let closed = DepthImage::nearer_of(&open, &only_walls)?;
    let mut image = closed.before(background)?;
    let depths = only_walls.z_mm.iter().zip(&open.z_mm).zip(&image.z_mm);
    let wall_pixels: Vec<u32> = depths
        .zip(0..)
        .filter(|(((wall, open), seen), _)| is_first(**wall, **open) && wall == seen)
        .map(|(_, pixel)| pixel)
        .collect();
    if walls == WallDepth::Invalid {
        for &pixel in &wall_pixels {
            image.z_mm[pixel as usize] = 0.0;
        }
    }
    Ok(WalledImage { image, wall_pixels })
}

/// Whether a wall is seen and is nearer than any other surface; 0 is nothing.
pub(crate) fn is_first(wall: f32, other: f32) -> bool {
    wall > 0.0 && (other == 0.0 || wall < other)
}
