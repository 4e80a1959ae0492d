//! Images with samples inside the pixels at edges, where a pixel sees two surfaces at once.

use nalgebra::{Matrix2, Point2, Point3, Vector2};

use crate::camera::projection::Camera;
use crate::image::{DepthError, DepthImage};
use crate::render::body::PlacedBody;
use crate::render::depth_buffer::DepthBuffer;
use crate::render::ideal::{SeenBody, draw};
use crate::render::walls::{WallDepth, WalledImage, is_first, seen_before};

/// Samples per pixel at an edge.
pub(crate) const SAMPLES: usize = 8;

/// Offsets of the samples from the pixel's centre, in pixels: one in each of eight columns and rows.
const OFFSETS: [[f64; 2]; SAMPLES] = {
    let rows = [3.0, 6.0, 1.0, 4.0, 7.0, 0.0, 5.0, 2.0];
    let mut offsets = [[0.0; 2]; SAMPLES];
    let mut i = 0;
    while i < SAMPLES {
        offsets[i] = [(i as f64 + 0.5) / 8.0 - 0.5, (rows[i] + 0.5) / 8.0 - 0.5];
        i += 1;
    }
    offsets
};

/// Neighbouring depths further apart than this, mm, may have an edge between them: such pixels are sampled.
pub(crate) const EDGE_MM: f32 = 8.0;

/// The static scene: rendered once per camera, then merged with what moves in front of it.
#[derive(Debug, Clone)]
pub struct Backdrop {
    /// Depth at the centres of the pixels.
    pub image: DepthImage,
    /// Depths inside each pixel, 0 for nothing.
    samples: Vec<[f32; SAMPLES]>,
}

/// A depth image and, at its edges, depths inside the pixels.
#[derive(Debug, Clone)]
pub struct SampledImage {
    /// Depth at the centres of the pixels.
    pub image: DepthImage,
    /// Pixels at edges in rising order, and the depths inside them, 0 for nothing.
    pub(crate) edges: Vec<(u32, [f32; SAMPLES])>,
    /// Pixels (row-major index, rising) at whose centre a wall is the nearest surface.
    pub wall_pixels: Vec<u32>,
}

/// A pixel that is sampled.
pub(crate) struct Site {
    pub pixel: u32,
    ray: Vector2<f64>,
    ray_from_pixel: Matrix2<f64>,
}

impl Site {
    fn new(camera: &Camera, pixel: u32) -> Option<Self> {
        let ray = camera.rays()[pixel as usize]?;
        let at = Point3::new(ray.x, ray.y, 1.0);
        let (_, slope) = camera.project_with_jacobian(&at)?;
        let ray_from_pixel = slope.try_inverse()?;
        Some(Self {
            pixel,
            ray,
            ray_from_pixel,
        })
    }

    /// Offset of a sample from the pixel's centre, and its ray; within a pixel the lens is linear to 1e-3 pixels.
    #[inline]
    pub(crate) fn sample(&self, index: usize) -> ([f64; 2], Vector2<f64>) {
        let offset = OFFSETS[index];
        (
            offset,
            self.ray + self.ray_from_pixel * Vector2::from(offset),
        )
    }
}

/// The sampled pixels, and the depths seen there.
pub(crate) struct Sites {
    pub sites: Vec<Site>,
    /// Site of each pixel, `u32::MAX` for none.
    pub of_pixel: Vec<u32>,
    /// Whether a site is at most a column and a row away.
    near: Vec<bool>,
    width: u32,
    pub buffer: DepthBuffer,
}

impl Sites {
    fn new(camera: &Camera, pixels: impl Iterator<Item = u32>) -> Self {
        let sites: Vec<Site> = pixels
            .filter_map(|pixel| Site::new(camera, pixel))
            .collect();
        let mut of_pixel = vec![u32::MAX; camera.rays().len()];
        for (index, site) in sites.iter().enumerate() {
            of_pixel[site.pixel as usize] = index as u32;
        }
        let buffer = DepthBuffer::empty(sites.len() * SAMPLES);
        let (width, height) = (camera.width() as usize, camera.height() as usize);
        let mut near = vec![false; of_pixel.len()];
        for site in &sites {
            let (column, row) = (site.pixel as usize % width, site.pixel as usize / width);
            let columns = column.saturating_sub(1)..(column + 2).min(width);
            for row in row.saturating_sub(1)..(row + 2).min(height) {
                near[row * width..][columns.clone()].fill(true);
            }
        }
        Self {
            sites,
            of_pixel,
            near,
            width: camera.width(),
            buffer,
        }
    }

    /// Points this close to the centre of a site along both axes are near it, pixels.
    pub(crate) const NEAR_PX: f32 = 1.5;

    /// Whether a place in the image, or the nearest place on its border for one outside, is near a site.
    #[inline]
    pub(crate) fn is_near(&self, at: &Point2<f32>) -> bool {
        // Conversion maps negative values to 0.
        let column = ((at.x + 0.5) as u32).min(self.width - 1) as usize;
        let last = self.near.len() - self.width as usize;
        let row = ((at.y + 0.5) as usize).saturating_mul(self.width as usize);
        self.near[row.min(last) + column]
    }

    fn draw(&self, bodies: &[SeenBody]) {
        for body in bodies {
            match body {
                SeenBody::Mesh(mesh) => mesh.draw_samples(self),
                SeenBody::Surfels(surfels) => {
                    let rays: Vec<_> = self
                        .sites
                        .iter()
                        .flat_map(|site| (0..SAMPLES).map(|k| Some(site.sample(k).1)))
                        .collect();
                    surfels.cast(&rays, &self.buffer);
                }
            }
        }
    }

    /// Depths of the walls at all samples, a row per site; `None` if there are no walls.
    fn draw_walls(&self, bodies: &[SeenBody]) -> Option<Vec<f32>> {
        if !bodies.iter().any(SeenBody::has_walls) {
            return None;
        }
        let buffer = DepthBuffer::empty(self.sites.len() * SAMPLES);
        for body in bodies {
            if let SeenBody::Mesh(mesh) = body {
                mesh.draw_wall_samples(self, &buffer);
            }
        }
        Some(buffer.into_depths())
    }

    /// Pixels and the depths inside them.
    fn into_depths(self) -> impl Iterator<Item = (u32, [f32; SAMPLES])> {
        let depths = self.buffer.into_depths();
        let at = move |(index, site): (usize, Site)| {
            let start = index * SAMPLES;
            (site.pixel, std::array::from_fn(|k| depths[start + k]))
        };
        self.sites.into_iter().enumerate().map(at)
    }
}

impl Backdrop {
    /// Renders the static scene. This is slow: every pixel is sampled.
    pub fn new(camera: &Camera, bodies: &[PlacedBody]) -> Self {
        let pixels = camera.rays().len();
        let sites = Sites::new(camera, 0..pixels as u32);
        let bodies = SeenBody::all(camera, bodies);
        sites.draw(&bodies);
        let walls = sites.draw_walls(&bodies);
        let mut samples = vec![[0.0; SAMPLES]; pixels];
        for (site, (pixel, depths)) in sites.into_depths().enumerate() {
            let walls = row_of(walls.as_ref(), site);
            samples[pixel as usize] = std::array::from_fn(|k| nearer(depths[k], walls[k]));
        }
        Self {
            image: draw(camera, &bodies),
            samples,
        }
    }

    /// The bodies in front of the backdrop, with samples inside the pixels at edges; walls are surfaces like any other.
    ///
    /// # Errors
    /// [`DepthError::SizeMismatch`] if the backdrop is another camera's, [`DepthError::NothingVisible`] or [`DepthError::Hidden`] if
    /// no pixel sees the bodies.
    pub fn before(
        &self,
        camera: &Camera,
        bodies: &[PlacedBody],
    ) -> Result<SampledImage, DepthError> {
        self.before_with_walls(camera, bodies, WallDepth::Flat)
    }

    /// The same as [`before`](Self::before), where `walls` sets how the bodies' walls are treated. If they are invalid, a pixel has no
    /// depth if its centre or, at an edge, any of its samples sees a wall; walls send no light to other pixels either.
    ///
    /// # Errors
    /// The same as [`before`](Self::before).
    pub fn before_with_walls(
        &self,
        camera: &Camera,
        bodies: &[PlacedBody],
        walls: WallDepth,
    ) -> Result<SampledImage, DepthError> {
        let bodies = SeenBody::all(camera, bodies);
        let WalledImage {
            mut image,
            wall_pixels,
        } = seen_before(camera, &bodies, &self.image, walls)?;
        let sites = Sites::new(camera, edges(&image).into_iter());
        sites.draw(&bodies);
        let of_walls = sites.draw_walls(&bodies);
        let mut at_edges = Vec::with_capacity(sites.sites.len());
        for (site, (pixel, depths)) in sites.into_depths().enumerate() {
            let behind = &self.samples[pixel as usize];
            let samples: [f32; SAMPLES] = std::array::from_fn(|k| nearer(depths[k], behind[k]));
            let walled = row_of(of_walls.as_ref(), site);
            let sees_wall = (0..SAMPLES).any(|k| is_first(walled[k], samples[k]));
            if walls == WallDepth::Invalid
                && (sees_wall || wall_pixels.binary_search(&pixel).is_ok())
            {
                image.z_mm[pixel as usize] = 0.0;
                continue;
            }
            at_edges.push((
                pixel,
                std::array::from_fn(|k| nearer(samples[k], walled[k])),
            ));
        }
        Ok(SampledImage {
            image,
            edges: at_edges,
            wall_pixels,
        })
    }
}

/// Depths of the walls at the samples of a site.
fn row_of(walls: Option<&Vec<f32>>, site: usize) -> [f32; SAMPLES] {
    walls.map_or([0.0; SAMPLES], |walls| {
        std::array::from_fn(|k| walls[site * SAMPLES + k])
    })
}

fn nearer(a: f32, b: f32) -> f32 {
    match (a > 0.0, b > 0.0) {
        (true, true) => a.min(b),
        (true, false) => a,
        _ => b,
    }
}

/// Pixels whose right or lower neighbour is much nearer or further, and those neighbours, in rising order.
fn edges(image: &DepthImage) -> Vec<u32> {
    let (width, z_mm) = (image.width as usize, &image.z_mm);
    let mut at_edge = vec![false; z_mm.len()];
    let apart = |a: f32, b: f32| (a > 0.0) != (b > 0.0) || (a - b).abs() > EDGE_MM;
    for pixel in 0..z_mm.len() {
        let right = (pixel % width + 1 < width).then_some(pixel + 1);
        let below = (pixel + width < z_mm.len()).then_some(pixel + width);
        for neighbour in [right, below].into_iter().flatten() {
            if apart(z_mm[pixel], z_mm[neighbour]) {
                (at_edge[pixel], at_edge[neighbour]) = (true, true);
            }
        }
    }
    let pixels = at_edge.iter().enumerate();
    pixels
        .filter(|(_, at)| **at)
        .map(|(i, _)| i as u32)
        .collect()
}
