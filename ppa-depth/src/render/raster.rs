//! Rasterises triangles into the distorted image.
//!
//! Rendering a changed mesh of 1.4 million triangles takes a fifteenth of the processor time of Embree, which has to rebuild its tree (bench `depth`,
//! docs/performance.md).
//!
//! The corners are projected through the lens in single precision, which finds the few pixels that a triangle may cover; at
//! each the exact ray of the pixel is tested in double precision. Distortion is therefore exact, and so are edges, although they are curved in the
//! image.

use std::ops::Range;
use std::sync::OnceLock;

use nalgebra::{Isometry3, Matrix3, Point3, Vector2, Vector3};
use rayon::prelude::*;

use crate::camera::optics::Optics;
use crate::camera::projection::Camera;
use crate::render::depth_buffer::DepthBuffer;
use crate::render::mesh_body::MeshBody;
use crate::render::single_lens::{Corner, LANES, Motion, SingleLens};
use crate::render::triangle::Triangle;

/// Relative error of a projection in single precision, some 20 roundings.
const ROUNDING: f32 = 1e-5;
/// Number of triangles or corners per task.
pub(crate) const CHUNK: usize = 1 << 14;

/// Part of the image that a triangle may cover.
pub(crate) enum Outline {
    /// Anywhere: it reaches behind the camera or far outside the image.
    Unknown,
    /// Within some columns and rows, and `slack` pixels around its straight edges.
    Within {
        corners: [Corner; 3],
        slack: f32,
        columns: Range<u32>,
        rows: Range<u32>,
        /// Smallest and largest column of its corners.
        across: [f32; 2],
        /// Upper bound of the distance of any part from a corner along either axis, pixels.
        extent: f32,
        /// Lower bound of its depth, mm.
        nearest: f32,
    },
}

/// A mesh as the camera sees it.
pub(crate) struct SeenMesh<'a> {
    pub(crate) camera: &'a Camera,
    optics: &'a Optics,
    pub(crate) mesh: &'a MeshBody,
    rotation: Matrix3<f64>,
    translation: Vector3<f64>,
    pub(crate) corners: Vec<Corner>,
    /// Largest extent of the triangles of each chunk in the image, known after drawing.
    pub(crate) extents: OnceLock<Vec<f32>>,
    /// Bound of the error of a corner in space from single precision.
    rounding_mm: f32,
    /// Bound of the additional error of a corner in the image.
    rounding_px: f32,
}

impl<'a> SeenMesh<'a> {
    pub(crate) fn new(
        camera: &'a Camera,
        mesh: &'a MeshBody,
        camera_from_body: &Isometry3<f64>,
    ) -> Self {
        let optics = camera.optics();
        let rotation = camera_from_body.rotation.to_rotation_matrix().into_inner();
        let translation = camera_from_body.translation.vector;
        let lens = SingleLens::new(camera.spec(), optics.radius);
        let shift = translation.cast::<f32>();
        let motion = Motion {
            rotation: rotation.cast(),
            translation: shift,
        };
        let mut corners = vec![[0.0; 3]; mesh.vertices.len()];
        corners
            .par_chunks_mut(CHUNK)
            .zip(mesh.vertices.par_chunks(CHUNK))
            .for_each(|(corners, vertices)| {
                let blocks = corners.chunks_mut(LANES).zip(vertices.chunks(LANES));
                for (corners, vertices) in blocks {
                    lens.corners(&motion, vertices, corners);
                }
            });
        Self {
            camera,
            optics,
            mesh,
            rotation,
            translation,
            corners,
            extents: OnceLock::new(),
            rounding_mm: ROUNDING / 10.0 * (mesh.reach_mm + shift.amax()),
            rounding_px: ROUNDING * largest_pixel(camera, optics),
        }
    }

    /// Offers the depth of every triangle at the centre of every pixel it covers.
    pub(crate) fn draw(&self, buffer: &DepthBuffer) {
        let chunks = self.mesh.triangles.par_chunks(CHUNK);
        let extents = chunks.map(|triangles| {
            let mut largest = 0.0;
            for triangle in triangles {
                let extent = self.draw_triangle(triangle, buffer);
                if extent > largest {
                    largest = extent;
                }
            }
            largest
        });
        let extents = extents.collect();
        self.extents.get_or_init(|| extents);
    }

    /// Offers the depth of every wall, as [`draw`](Self::draw) does that of the other triangles.
    pub(crate) fn draw_walls(&self, buffer: &DepthBuffer) {
        self.mesh.walls.par_iter().for_each(|wall| {
            self.draw_triangle(wall, buffer);
        });
    }

    /// The part of the image that a triangle may cover, each pixel widened by `reach` on all sides.
    #[inline(always)] // a call per triangle would take as long as the work
    pub(crate) fn outline(&self, triangle: &[u32; 3], reach: f32) -> Outline {
        let corners @ [a, b, c] = triangle.map(|corner| self.corners[corner as usize]);
        if (a[2] + b[2] + c[2]).is_nan() {
            return Outline::Unknown;
        }
        let low = [0, 1, 2].map(|i| least(least(a[i], b[i]), c[i]));
        let high = [0, 1].map(|i| -least(least(-a[i], -b[i]), -c[i]));
        let (du, dv) = (high[0] - low[0], high[1] - low[1]);
        let slack = self.rounding_px
            + self.optics.stretch as f32 * self.rounding_mm / low[2]
            + self.optics.bow as f32 * (du * du + dv * dv);
        let wide = slack + reach;
        Outline::Within {
            corners,
            slack,
            columns: centres(low[0] - wide, high[0] + wide, self.camera.width()),
            rows: centres(low[1] - wide, high[1] + wide, self.camera.height()),
            across: [low[0], high[0]],
            extent: if du < dv { dv } else { du } + slack,
            nearest: low[2] * (1.0 - ROUNDING) - self.rounding_mm,
        }
    }

    /// Returns how far in the image a part of the triangle may be from a corner, pixels; ∞ if unknown.
    #[inline]
    fn draw_triangle(&self, triangle: &[u32; 3], buffer: &DepthBuffer) -> f32 {
        let Outline::Within {
            corners,
            slack,
            columns,
            rows,
            extent,
            nearest,
            ..
        } = self.outline(triangle, 0.0)
        else {
            let rays = self.optics.rays.iter().enumerate();
            let rays = rays.filter_map(|(i, ray)| Some((i, (*ray)?)));
            self.draw_anywhere(triangle, buffer, rays);
            return f32::INFINITY;
        };
        // One branch, since most triangles contain no centre, but many a column or a row of centres.
        if columns.is_empty() | rows.is_empty() {
            return extent;
        }
        let mut exact = None;
        for row in rows {
            for column in columns.clone() {
                let pixel = (row * self.camera.width() + column) as usize;
                let centre = [column as f32, row as f32];
                if buffer.nearest(pixel) <= nearest || misses(corners, centre, slack) {
                    continue;
                }
                let exact = exact.get_or_insert_with(|| self.exact(triangle));
                if let Some(ray) = &self.optics.rays[pixel]
                    && let Some(z_mm) = exact.depth(ray)
                {
                    buffer.offer(pixel, z_mm as f32);
                }
            }
        }
        extent
    }

    /// Draws a triangle that cannot be projected as a whole, because it is large and reaches behind the camera or far outside.
    pub(crate) fn draw_anywhere(
        &self,
        triangle: &[u32; 3],
        buffer: &DepthBuffer,
        rays: impl Iterator<Item = (usize, Vector2<f64>)>,
    ) {
        let corners = triangle.map(|corner| self.in_camera(corner));
        let [low, high] = self.optics.bounds;
        // How far a corner is beyond each side of the field of view, and behind the camera.
        let beyond = corners.map(|p| {
            [
                -p.z,
                low.x * p.z - p.x,
                p.x - high.x * p.z,
                low.y * p.z - p.y,
                p.y - high.y * p.z,
            ]
            .map(|distance| distance > 1e-9 * p.coords.amax())
        });
        if (0..5).any(|side| beyond.iter().all(|corner| corner[side])) {
            return;
        }
        let exact = Triangle::new(corners);
        for (index, ray) in rays {
            if let Some(z_mm) = exact.depth(&ray) {
                buffer.offer(index, z_mm as f32);
            }
        }
    }

    pub(crate) fn exact(&self, triangle: &[u32; 3]) -> Triangle {
        Triangle::new(triangle.map(|corner| self.in_camera(corner)))
    }

    fn in_camera(&self, corner: u32) -> Point3<f64> {
        let vertex = self.mesh.vertices[corner as usize].coords.cast::<f64>();
        Point3::from(self.rotation * vertex + self.translation)
    }
}

/// Largest number in the computation of a place in the image: its size, or the principal point of a part of a larger image.
fn largest_pixel(camera: &Camera, optics: &Optics) -> f32 {
    let (spec, size) = (camera.spec(), camera.width().max(camera.height()));
    let centre = spec.cx.abs().max(spec.cy.abs());
    let ray = optics.bounds[0].amax().max(optics.bounds[1].amax());
    let reach = if ray.is_finite() {
        spec.fx.max(spec.fy) * ray
    } else {
        0.0
    };
    f64::from(size).max(centre).max(reach) as f32
}

/// The smaller of two numbers that are not NaN: one instruction, unlike `f32::min`.
#[inline(always)]
fn least(a: f32, b: f32) -> f32 {
    if a < b { a } else { b }
}

/// Whole numbers in [low, high] that are columns or rows of the image.
#[inline]
pub(crate) fn centres(low: f32, high: f32, count: u32) -> Range<u32> {
    // Truncation is a single instruction where ceil and floor are calls.
    let low = low.max(0.0);
    let first = low as u32;
    let first = first.saturating_add(u32::from((first as f32) < low));
    let last = if high < 0.0 {
        0
    } else {
        (high as u32).saturating_add(1)
    };
    first..last.min(count)
}

/// Whether a point in the image is outside the triangle by more than the slack.
#[inline]
pub(crate) fn misses([a, b, c]: [Corner; 3], at: [f32; 2], slack: f32) -> bool {
    // Twice the area that the point spans with each edge, and the length of the edge (as a sum, which is no shorter).
    let span = |p: Corner, q: Corner| {
        let (du, dv) = (q[0] - p[0], q[1] - p[1]);
        let area = du * (at[1] - p[1]) - dv * (at[0] - p[0]);
        (area, slack * (du.abs() + dv.abs() + slack))
    };
    let [e, f, g] = [span(a, b), span(b, c), span(c, a)];
    (e.0 < -e.1 || f.0 < -f.1 || g.0 < -g.1) && (e.0 > e.1 || f.0 > f.1 || g.0 > g.1)
}
