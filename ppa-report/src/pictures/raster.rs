//! Rasteriser of triangles and points: the nearest surface per sample, its normal and its owner.

use nalgebra::{Point3, Vector3};
use ppa_mesh::{Mesh, PointCloud};

use super::canvas::{Canvas, Colour, Rect, mixed};
use super::view::View;

/// Samples along each side of a pixel.
const SAMPLES: u32 = 2;

/// The surface seen by a sample.
#[derive(Debug, Clone, Copy)]
pub(super) struct Seen {
    /// Which surface it is.
    pub(super) layer: u8,
    /// The point seen, mm.
    pub(super) point: Point3<f64>,
    /// Normal of the surface, of unit length and towards the viewer.
    pub(super) normal: Vector3<f64>,
    /// Whether the surface is seen from behind.
    pub(super) from_behind: bool,
}

#[derive(Debug, Clone, Copy)]
struct Sample {
    nearness: f32,
    layer: u8,
    normal: Vector3<f32>,
}

/// Surfaces seen in a panel.
pub(super) struct Raster {
    view: View,
    rect: Rect,
    samples: Vec<Option<Sample>>,
    /// Only points in this box are shown: low and high corner, mm.
    within: Option<[Point3<f64>; 2]>,
}

impl Raster {
    pub(super) fn new(rect: Rect, view: View) -> Self {
        let count = rect.width * SAMPLES * rect.height * SAMPLES;
        Self {
            view,
            rect,
            samples: vec![None; count as usize],
            within: None,
        }
    }

    /// Leaves out everything outside a box in the frame of the surfaces.
    pub(super) fn within(self, low: Point3<f64>, high: Point3<f64>) -> Self {
        Self {
            within: Some([low, high]),
            ..self
        }
    }

    /// Position of a point among the samples, and its nearness.
    fn place(&self, point: &Point3<f64>) -> [f64; 3] {
        let [x, y] = self.view.pixel(point);
        let scale = f64::from(SAMPLES);
        [
            (x - f64::from(self.rect.x)) * scale,
            (y - f64::from(self.rect.y)) * scale,
            self.view.nearness(point),
        ]
    }

    fn size(&self) -> [u32; 2] {
        [self.rect.width * SAMPLES, self.rect.height * SAMPLES]
    }

    fn offer(&mut self, column: u32, row: u32, sample: Sample) {
        if let Some([low, high]) = self.within {
            let point = self.point_of(column, row, sample.nearness);
            if (0..3).any(|axis| !(low[axis]..=high[axis]).contains(&point[axis])) {
                return;
            }
        }
        let index = (row * self.size()[0] + column) as usize;
        let nearer = self.samples[index].is_none_or(|there| sample.nearness > there.nearness);
        if nearer {
            self.samples[index] = Some(sample);
        }
    }

    fn point_of(&self, column: u32, row: u32, nearness: f32) -> Point3<f64> {
        let at = |sample: u32, first: u32| {
            f64::from(first) + (f64::from(sample) + 0.5) / f64::from(SAMPLES)
        };
        let pixel = [at(column, self.rect.x), at(row, self.rect.y)];
        self.view.point(pixel, nearness.into())
    }

    /// Adds a mesh; triangles with a corner that is not finite are left out.
    pub(super) fn mesh(&mut self, mesh: &Mesh, layer: u8) {
        let places: Vec<_> = mesh
            .vertices
            .iter()
            .map(|v| self.place(&v.cast()))
            .collect();
        let [width, height] = self.size();
        for triangle in &mesh.triangles {
            let corners = triangle.map(|corner| places[corner as usize]);
            let [a, b, c] = corners;
            let area = (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0]);
            if !area.is_finite() || area == 0.0 {
                continue;
            }
            let normals = triangle.map(|corner| mesh.normals[corner as usize]);
            let range = |axis: usize, count: u32| {
                let low = a[axis].min(b[axis]).min(c[axis]) - 0.5;
                let high = a[axis].max(b[axis]).max(c[axis]) - 0.5;
                let first = low.ceil().max(0.0) as u32;
                let end = (high.floor() + 1.0).clamp(0.0, f64::from(count)) as u32;
                first..end
            };
            for row in range(1, height) {
                for column in range(0, width) {
                    let at = [f64::from(column) + 0.5, f64::from(row) + 0.5];
                    // Twice the area between an edge and the sample, relative to that of the triangle.
                    let share = |p: [f64; 3], q: [f64; 3]| {
                        ((q[0] - p[0]) * (at[1] - p[1]) - (q[1] - p[1]) * (at[0] - p[0])) / area
                    };
                    let weights = [share(b, c), share(c, a), share(a, b)];
                    if weights.iter().any(|weight| *weight < 0.0) {
                        continue;
                    }
                    let nearness = (0..3).map(|i| weights[i] * corners[i][2]).sum::<f64>();
                    let normal = (0..3)
                        .map(|i| normals[i] * weights[i] as f32)
                        .sum::<Vector3<f32>>();
                    let sample = Sample {
                        nearness: nearness as f32,
                        layer,
                        normal,
                    };
                    self.offer(column, row, sample);
                }
            }
        }
    }

    /// Adds points as squares of `side_mm`.
    pub(super) fn cloud(&mut self, cloud: &PointCloud, side_mm: f64, layer: u8) {
        let half = 0.5 * side_mm * self.view.pixels_per_mm * f64::from(SAMPLES);
        let half = half.max(0.5);
        let [width, height] = self.size();
        let viewer = self.view.towards_viewer().cast::<f32>();
        for (index, point) in cloud.points.iter().enumerate() {
            let [x, y, nearness] = self.place(&point.cast());
            if !(x.is_finite() && y.is_finite()) {
                continue;
            }
            let normal = cloud.normals.get(index).copied().unwrap_or(viewer);
            let range = |at: f64, count: u32| {
                let end = (at + half).ceil().clamp(0.0, f64::from(count)) as u32;
                (at - half).floor().max(0.0) as u32..end
            };
            for row in range(y, height) {
                for column in range(x, width) {
                    let sample = Sample {
                        nearness: nearness as f32,
                        layer,
                        normal,
                    };
                    self.offer(column, row, sample);
                }
            }
        }
    }

    /// Nearness of the nearest surface at a pixel; `None` outside the panel or if there is no surface.
    pub(super) fn nearness(&self, [x, y]: [f64; 2]) -> Option<f64> {
        let scale = f64::from(SAMPLES);
        let at = |pixel: f64, first: u32| ((pixel - f64::from(first)) * scale).floor();
        let (column, row) = (at(x, self.rect.x), at(y, self.rect.y));
        let [width, height] = self.size();
        let inside =
            (0.0..f64::from(width)).contains(&column) && (0.0..f64::from(height)).contains(&row);
        if !inside {
            return None;
        }
        let sample = self.samples[(row as u32 * width + column as u32) as usize]?;
        Some(sample.nearness.into())
    }

    /// Paints each sample in the colour that `colour` returns for it.
    pub(super) fn paint(&self, canvas: &mut Canvas, colour: impl Fn(&Seen) -> Colour) {
        let viewer = self.view.towards_viewer();
        let width = self.size()[0];
        let [[left, right], [top, bottom]] = self.rect.ends();
        for (x, y) in (top..bottom).flat_map(|y| (left..right).map(move |x| (x, y))) {
            let (mut sum, mut count) = ([0.0; 3], 0.0);
            for sub in 0..SAMPLES * SAMPLES {
                let column = (x - left) * SAMPLES + sub % SAMPLES;
                let row = (y - top) * SAMPLES + sub / SAMPLES;
                let Some(sample) = self.samples[(row * width + column) as usize] else {
                    continue;
                };
                let normal = sample.normal.cast::<f64>();
                let normal = normal.try_normalize(1e-6).unwrap_or(viewer);
                let from_behind = normal.dot(&viewer) < 0.0;
                let seen = Seen {
                    layer: sample.layer,
                    point: self.point_of(column, row, sample.nearness),
                    normal: if from_behind { -normal } else { normal },
                    from_behind,
                };
                let colour = colour(&seen).map(f64::from);
                (0..3).for_each(|i| sum[i] += colour[i]);
                count += 1.0;
            }
            if count > 0.0 {
                let mean = sum.map(|channel| (channel / count) as u8);
                canvas.blend(x, y, mean, count / f64::from(SAMPLES * SAMPLES));
            }
        }
    }

    /// Colour of a surface lit from above left behind the viewer.
    pub(super) fn lit(&self, colour: Colour, normal: &Vector3<f64>) -> Colour {
        let View { right, up, .. } = self.view;
        let light = (self.view.towards_viewer() + up * 0.6 - right * 0.5).normalize();
        let brightness = 0.3 + 0.7 * normal.dot(&light).max(0.0);
        mixed([0; 3], colour, brightness)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn square(z: f32, half: f32) -> Mesh {
        Mesh {
            vertices: [[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]]
                .map(|[x, y]: [f32; 2]| Point3::new(x * half, y * half, z))
                .to_vec(),
            normals: vec![Vector3::z(); 4],
            triangles: vec![[0, 1, 2], [0, 2, 3]],
        }
    }

    #[test]
    fn the_nearer_of_two_squares_hides_the_other() {
        let rect = Rect {
            x: 5,
            y: 5,
            width: 100,
            height: 100,
        };
        let corners = [[-50.0, -50.0, 0.0], [50.0, 50.0, 0.0]].map(Point3::from);
        let view = View::fitting(rect, [Vector3::x(), Vector3::y()], corners);
        let mut raster = Raster::new(rect, view);
        raster.mesh(&square(10.0, 20.0), 1);
        raster.mesh(&square(0.0, 40.0), 0);
        let mut canvas = Canvas::new(110, 110, [9; 3]);
        raster.paint(&mut canvas, |seen| {
            [[0, 255, 0], [255, 0, 0]][usize::from(seen.layer)]
        });
        assert!((raster.nearness(view.pixel(&Point3::origin())).unwrap() - 10.0).abs() < 1e-5);
        let image = canvas.into_image();
        let count = |colour| image.pixels().filter(|p| p.0 == colour).count() as f64;
        let area = |half: f64| (2.0 * half * view.pixels_per_mm).powi(2);
        let edge = 4.0 * 80.0 * view.pixels_per_mm;
        assert!((count([255, 0, 0]) - area(20.0)).abs() < edge);
        assert!((count([0, 255, 0]) - area(40.0) + area(20.0)).abs() < edge);
    }
}
