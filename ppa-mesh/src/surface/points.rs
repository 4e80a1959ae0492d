//! Vertices of a part of the surface, computed many at a time.

use nalgebra::{Point3, Vector3};

use super::world::World;

/// Crossings that are computed together: few enough to stay in the first-level cache.
const LANES: usize = 64;

/// Places and normals in the world.
#[derive(Default)]
pub struct Points {
    pub vertices: Vec<Point3<f32>>,
    /// Unit vectors, or zero where the gradient vanishes.
    pub normals: Vec<Vector3<f32>>,
}

impl Points {
    pub fn with_capacity(count: usize) -> Self {
        Self {
            vertices: Vec::with_capacity(count),
            normals: Vec::with_capacity(count),
        }
    }

    /// Stores a place in voxel indices of the field, with its gradient in HU per voxel step.
    pub fn push(&mut self, world: &World, place: Vector3<f64>, gradient: Vector3<f32>) {
        self.vertices.push(world.point(place));
        self.normals.push(world.normal(gradient));
    }

    pub fn extend_from(&mut self, other: &Self) {
        self.vertices.extend_from_slice(&other.vertices);
        self.normals.extend_from_slice(&other.normals);
    }
}

/// One end of a crossed edge.
#[derive(Clone, Copy)]
pub struct End {
    pub hu: f32,
    /// HU per voxel step.
    pub gradient: [f32; 3],
}

/// Pending crossed edges along one axis, stored by component so that the compiler computes several at
/// once.
pub struct Batch {
    waiting: usize,
    voxel: [[u32; LANES]; 3],
    hu: [[f32; LANES]; 2],
    gradient: [[[f32; LANES]; 3]; 2],
}

impl Batch {
    pub fn new() -> Self {
        Self {
            waiting: 0,
            voxel: [[0; LANES]; 3],
            hu: [[0.0; LANES]; 2],
            gradient: [[[0.0; LANES]; 3]; 2],
        }
    }

    /// Adds the edge from a voxel; true when the batch is full and has to be stored.
    pub fn add(&mut self, voxel: [usize; 3], ends: [End; 2]) -> bool {
        let lane = self.waiting % LANES;
        for (lanes, index) in self.voxel.iter_mut().zip(voxel) {
            lanes[lane] = index as u32;
        }
        for (end, values) in ends.iter().enumerate() {
            self.hu[end][lane] = values.hu;
            for axis in 0..3 {
                self.gradient[end][axis][lane] = values.gradient[axis];
            }
        }
        self.waiting += 1;
        self.waiting == LANES
    }

    /// Stores where the edges along `axis` cross `iso`, linearly interpolated, with the gradient there.
    pub fn store(&mut self, axis: usize, iso: f32, world: &World, points: &mut Points) {
        let iso = f64::from(iso);
        let mut t = [0.0; LANES];
        for (lane, t) in t.iter_mut().enumerate() {
            let a = f64::from(self.hu[0][lane]) - iso;
            let b = f64::from(self.hu[1][lane]) - iso;
            *t = f64::max(a / (a - b), world.nearest).min(1.0 - world.nearest);
        }
        let mut place = [[0.0; LANES]; 3];
        for (place, voxel) in place.iter_mut().zip(&self.voxel) {
            for (place, &voxel) in place.iter_mut().zip(voxel) {
                *place = f64::from(voxel as i32);
            }
        }
        for (place, t) in place[axis].iter_mut().zip(&t) {
            *place += t;
        }
        let mut gradient = [[0.0; LANES]; 3];
        for (axis, gradient) in gradient.iter_mut().enumerate() {
            let [near, far] = [0, 1].map(|end: usize| &self.gradient[end][axis]);
            for (lane, gradient) in gradient.iter_mut().enumerate() {
                *gradient = near[lane] + (far[lane] - near[lane]) * t[lane] as f32;
            }
        }
        let [x, y, z] = world.points(&place);
        let lanes = x.iter().zip(&y).zip(&z).take(self.waiting);
        (points.vertices).extend(lanes.map(|((&x, &y), &z)| Point3::new(x, y, z)));
        let [x, y, z] = world.normals(&gradient);
        let lanes = x.iter().zip(&y).zip(&z).take(self.waiting);
        (points.normals).extend(lanes.map(|((&x, &y), &z)| Vector3::new(x, y, z)));
        self.waiting = 0;
    }
}
