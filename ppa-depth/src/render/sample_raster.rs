//! Rasterises triangles into the samples of pixels at edges.

use nalgebra::Point2;
use rayon::prelude::*;

use crate::render::depth_buffer::DepthBuffer;
use crate::render::raster::{CHUNK, Outline, SeenMesh, centres, misses};
use crate::render::sampled::{SAMPLES, Sites};
use crate::render::single_lens::Corner;

/// Largest distance of the rays of samples from their place in the image, pixels.
const SAMPLE_SLACK_PX: f32 = 0.005;

impl SeenMesh<'_> {
    /// Offers the depth of every triangle at all samples of the sites it covers.
    ///
    /// Few pixels are sites. If all triangles of a chunk are small, one corner suffices to show that a triangle is near none.
    pub(crate) fn draw_samples(&self, sites: &Sites) {
        let is_near = |corner: &Corner| sites.is_near(&Point2::new(corner[0], corner[1]));
        let mut near = vec![false; self.corners.len()];
        near.par_chunks_mut(CHUNK)
            .zip(self.corners.par_chunks(CHUNK))
            .for_each(|(near, corners)| {
                for (near, corner) in near.iter_mut().zip(corners) {
                    *near = is_near(corner);
                }
            });
        let reach = Sites::NEAR_PX - 0.5 - SAMPLE_SLACK_PX;
        let is_small = |chunk: usize| {
            let extent = self.extents.get().map(|extents| extents[chunk]);
            extent.is_some_and(|extent| extent < reach)
        };
        let chunks = self.mesh.triangles.par_chunks(CHUNK).enumerate();
        chunks.for_each(|(chunk, triangles)| {
            let small = is_small(chunk);
            for triangle in triangles {
                if !small || near[triangle[0] as usize] {
                    self.sample_triangle(triangle, sites, &sites.buffer);
                }
            }
        });
    }

    /// Offers the depth of every wall at all samples of the sites it covers.
    pub(crate) fn draw_wall_samples(&self, sites: &Sites, buffer: &DepthBuffer) {
        let walls = self.mesh.walls.par_iter();
        walls.for_each(|wall| self.sample_triangle(wall, sites, buffer));
    }

    #[inline]
    fn sample_triangle(&self, triangle: &[u32; 3], sites: &Sites, buffer: &DepthBuffer) {
        let Outline::Within {
            corners,
            slack,
            columns,
            rows,
            across: [left, right],
            nearest,
            ..
        } = self.outline(triangle, 0.5)
        else {
            let all = sites.sites.iter().enumerate();
            let rays = all.flat_map(|(i, site)| {
                (0..SAMPLES).map(move |k| (i * SAMPLES + k, site.sample(k).1))
            });
            return self.draw_anywhere(triangle, buffer, rays);
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
                    if buffer.nearest(index) <= nearest || misses(corners, at, slack) {
                        continue;
                    }
                    let exact = exact.get_or_insert_with(|| self.exact(triangle));
                    if let Some(z_mm) = exact.depth(&ray) {
                        buffer.offer(index, z_mm as f32);
                    }
                }
            }
        }
    }
}
