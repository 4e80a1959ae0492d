//! Volumes from formulas, and the location of the reference numbers.

use std::path::PathBuf;

use nalgebra::{Matrix3, Point3, Rotation3, Unit, Vector3};
use ppa_ct::{Grid, Volume};
use serde_json::Value;

/// The folder of reference data next to the repository.
pub fn shared() -> PathBuf {
    let beside = || PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("../../shared");
    std::env::var_os("PPA_SHARED").map_or_else(beside, PathBuf::from)
}

pub fn reference(name: &str) -> Value {
    let path = shared().join("reference/geometry").join(name);
    let text = std::fs::read_to_string(&path).expect("reference file");
    serde_json::from_str(&text).expect("JSON")
}

pub fn numbers<const N: usize>(value: &Value) -> [f64; N] {
    std::array::from_fn(|at| value[at].as_f64().expect("number"))
}

/// The first `count` values of a seed.
pub fn hash_noise(count: usize, seed: u64) -> Vec<f64> {
    (0..count as u64)
        .map(|index| ppa_tests::hash_noise(index, seed))
        .collect()
}

/// HU of `values(world point)` on an axis-aligned grid from the origin.
pub fn volume(
    size: [usize; 3],
    spacing_mm: [f64; 3],
    value: impl Fn(&Point3<f64>) -> f32,
) -> Volume {
    let grid = Grid::axis_aligned(size, Vector3::from(spacing_mm), Point3::origin()).expect("grid");
    on_grid(grid, value)
}

pub fn on_grid(grid: Grid, value: impl Fn(&Point3<f64>) -> f32) -> Volume {
    let hu = (0..grid.len())
        .map(|at| value(&grid.centre(grid.voxel(at).map(|v| v as f64))))
        .collect();
    Volume::new(grid, hu).expect("finite values")
}

/// An analytic solid of the reference files.
pub struct Solid {
    kind: String,
    centre: Point3<f64>,
    local_from_world: Matrix3<f64>,
    sizes: [f64; 2],
}

impl Solid {
    pub fn parse(shape: &Value) -> Self {
        let get = |key: &str| shape[key].as_f64().unwrap_or(0.0);
        let kind = shape["kind"].as_str().expect("kind").to_owned();
        let rotation = match &shape["rotate"] {
            Value::Null => Matrix3::identity(),
            turn => Rotation3::from_axis_angle(
                &Unit::new_normalize(Vector3::from(numbers::<3>(&turn[0]))),
                turn[1].as_f64().expect("degrees").to_radians(),
            )
            .into_inner(),
        };
        let sizes = match kind.as_str() {
            "torus" => [get("R"), get("r")],
            _ => [get("r"), 0.5 * get("h")],
        };
        Self {
            kind,
            centre: numbers::<3>(&shape["centre"]).into(),
            local_from_world: rotation.transpose(),
            sizes,
        }
    }

    /// Signed distance, mm, negative inside.
    pub fn distance(&self, p: &Point3<f64>) -> f64 {
        let q = self.local_from_world * (p - self.centre);
        let [a, b] = self.sizes;
        let across = q.x.hypot(q.y);
        match self.kind.as_str() {
            "sphere" => q.norm() - a,
            "torus" => (across - a).hypot(q.z) - b,
            "capsule" => (q - Vector3::z() * q.z.clamp(-b, b)).norm() - a,
            "cylinder" => {
                let (r, z) = (across - a, q.z.abs() - b);
                r.max(z).min(0.0) + r.max(0.0).hypot(z.max(0.0))
            }
            other => panic!("unknown solid {other}"),
        }
    }

    pub fn outward(&self, p: &Point3<f64>) -> Vector3<f64> {
        let h = 1e-4;
        Vector3::from_fn(|axis, _| {
            let mut step = Vector3::zeros();
            step[axis] = h;
            self.distance(&(p + step)) - self.distance(&(p - step))
        })
        .normalize()
    }
}
