//! Triangles into the distorted image.
//!
//! The corners are projected through the lens in single precision, which tells the few pixels that a triangle may cover; at
//! each the exact ray of the pixel is tested in double precision. So distortion is exact, and edges are those of the triangle
//! although they bow in the image.

use std::ops::Range;

use nalgebra::{Isometry3, Matrix3, Point3, Vector2, Vector3};
use rayon::prelude::*;

use crate::camera::Camera;
use crate::depth_buffer::DepthBuffer;
use crate::mesh_body::MeshBody;
use crate::optics::Optics;
use crate::sampled::{SAMPLES, Sites};
use crate::single_lens::{Corner, SingleLens};
use crate::triangle::Triangle;

/// Relative error of a projection in single precision, some 20 roundings.
const ROUNDING: f32 = 1e-5;
/// Triangles or corners that a thread takes at a time.
const CHUNK: usize = 1 << 14;

/// How far the rays of samples may lie beside their place in the image, pixels.
const SAMPLE_SLACK_PX: f32 = 0.005;

/// Where in the image a triangle may be.
enum Outline {
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
        /// No part of it is nearer than this, mm.
        nearest: f32,
    },
}

/// A mesh as the camera sees it.
pub(crate) struct SeenMesh<'a> {
    camera: &'a Camera,
    optics: &'a Optics,
    mesh: &'a MeshBody,
    rotation: Matrix3<f64>,
    translation: Vector3<f64>,
    corners: Vec<Corner>,
    /// By which single precision may misplace a corner in space.
    rounding_mm: f32,
    /// By which it may misplace a corner in the image, on top of that.
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
        let (turn, shift) = (rotation.cast::<f32>(), translation.cast::<f32>());
        let mut corners = vec![[0.0; 3]; mesh.vertices.len()];
        corners
            .par_chunks_mut(CHUNK)
            .zip(mesh.vertices.par_chunks(CHUNK))
            .for_each(|(corners, vertices)| {
                for (corner, vertex) in corners.iter_mut().zip(vertices) {
                    *corner = lens.corner(turn * vertex.coords + shift);
                }
            });
        Self {
            camera,
            optics,
            mesh,
            rotation,
            translation,
            corners,
            rounding_mm: ROUNDING / 10.0 * (mesh.reach_mm + shift.amax()),
            rounding_px: ROUNDING * largest_pixel(camera, optics),
        }
    }

    /// Offers the depth of every triangle at the centre of every pixel it covers.
    pub(crate) fn draw(&self, buffer: &DepthBuffer) {
        self.mesh.triangles.par_chunks(CHUNK).for_each(|triangles| {
            for triangle in triangles {
                self.draw_triangle(triangle, buffer);
            }
        });
    }

    /// Offers the depth of every triangle at all samples of the sites it covers.
    pub(crate) fn draw_samples(&self, sites: &Sites) {
        self.mesh.triangles.par_chunks(CHUNK).for_each(|triangles| {
            for triangle in triangles {
                self.sample_triangle(triangle, sites);
            }
        });
    }

    /// The part of the image that a triangle may cover, each pixel widened by `reach` on all sides.
    #[inline(always)] // a call per triangle would take as long as the work
    fn outline(&self, triangle: &[u32; 3], reach: f32) -> Outline {
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
            nearest: low[2] * (1.0 - ROUNDING) - self.rounding_mm,
        }
    }

    #[inline]
    fn draw_triangle(&self, triangle: &[u32; 3], buffer: &DepthBuffer) {
        let Outline::Within {
            corners,
            slack,
            columns,
            rows,
            nearest,
            ..
        } = self.outline(triangle, 0.0)
        else {
            let rays = self.optics.rays.iter().enumerate();
            return self.draw_anywhere(
                triangle,
                buffer,
                rays.filter_map(|(i, ray)| Some((i, (*ray)?))),
            );
        };
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
    }

    #[inline]
    fn sample_triangle(&self, triangle: &[u32; 3], sites: &Sites) {
        let Outline::Within {
            corners,
            slack,
            columns,
            rows,
            across: [left, right],
            nearest,
        } = self.outline(triangle, 0.5)
        else {
            let all = sites.sites.iter().enumerate();
            let rays = all.flat_map(|(i, site)| {
                (0..SAMPLES).map(move |k| (i * SAMPLES + k, site.sample(k).1))
            });
            return self.draw_anywhere(triangle, &sites.buffer, rays);
        };
        // The rays of samples follow the lens to first order only.
        let slack = slack + SAMPLE_SLACK_PX;
        let mut exact = None;
        for row in rows {
            for column in columns.clone() {
                let site = sites.of_pixel[(row * self.camera.width() + column) as usize];
                let Some(seen) = sites.sites.get(site as usize) else {
                    continue;
                };
                // Sample k lies in the k-th of equal columns of the pixel.
                let place = |u: f32| (u - column as f32 + 0.5) * SAMPLES as f32 - 0.5;
                let covered = centres(place(left - slack), place(right + slack), SAMPLES as u32);
                for k in covered.map(|k| k as usize) {
                    let index = site as usize * SAMPLES + k;
                    let ([du, dv], ray) = seen.sample(k);
                    let at = [column as f32 + du as f32, row as f32 + dv as f32];
                    if sites.buffer.nearest(index) <= nearest || misses(corners, at, slack) {
                        continue;
                    }
                    let exact = exact.get_or_insert_with(|| self.exact(triangle));
                    if let Some(z_mm) = exact.depth(&ray) {
                        sites.buffer.offer(index, z_mm as f32);
                    }
                }
            }
        }
    }

    /// A triangle that cannot be projected as a whole, because it is large and reaches behind the camera or far outside.
    fn draw_anywhere(
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

    fn exact(&self, triangle: &[u32; 3]) -> Triangle {
        Triangle::new(triangle.map(|corner| self.in_camera(corner)))
    }

    fn in_camera(&self, corner: u32) -> Point3<f64> {
        let vertex = self.mesh.vertices[corner as usize].coords.cast::<f64>();
        Point3::from(self.rotation * vertex + self.translation)
    }
}

/// Largest number that makes up a place in the image: its size, or the principal point of a part of a larger image.
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
fn centres(low: f32, high: f32, count: u32) -> Range<u32> {
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
fn misses([a, b, c]: [Corner; 3], at: [f32; 2], slack: f32) -> bool {
    // Twice the area that the point spans with each edge, and the length of the edge (as a sum, which is no shorter).
    let span = |p: Corner, q: Corner| {
        let (du, dv) = (q[0] - p[0], q[1] - p[1]);
        let area = du * (at[1] - p[1]) - dv * (at[0] - p[0]);
        (area, slack * (du.abs() + dv.abs() + slack))
    };
    let [e, f, g] = [span(a, b), span(b, c), span(c, a)];
    (e.0 < -e.1 || f.0 < -f.1 || g.0 < -g.1) && (e.0 > e.1 || f.0 > f.1 || g.0 > g.1)
}
