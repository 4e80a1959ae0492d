//! A plane with a front side.

use nalgebra::{Isometry3, Point3, Unit, Vector3};
use serde::{Deserialize, Serialize};

/// The points p with `normal · p = offset_mm`; the normal points to the side of the objects.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Plane {
    /// Unit normal.
    pub normal: Unit<Vector3<f64>>,
    /// Signed distance of the plane from the origin along the normal, mm.
    pub offset_mm: f64,
}

impl Plane {
    /// The plane through a point.
    pub fn through(point: &Point3<f64>, normal: Unit<Vector3<f64>>) -> Self {
        Self {
            normal,
            offset_mm: normal.dot(&point.coords),
        }
    }

    /// Distance of a point above (+) or below (−) the plane, mm.
    pub fn signed_distance(&self, point: &Point3<f64>) -> f64 {
        self.normal.dot(&point.coords) - self.offset_mm
    }

    /// The foot of the perpendicular from a point.
    pub fn project(&self, point: &Point3<f64>) -> Point3<f64> {
        point - self.normal.into_inner() * self.signed_distance(point)
    }

    /// The plane in the target frame of `target_from_source`.
    pub fn transformed(&self, target_from_source: &Isometry3<f64>) -> Self {
        let point = Point3::from(self.normal.into_inner() * self.offset_mm);
        Self::through(
            &(target_from_source * point),
            target_from_source * self.normal,
        )
    }

    /// Where the ray `origin + s · direction`, s ≥ 0, meets the plane; `None` if it never does.
    pub fn hit(&self, origin: &Point3<f64>, direction: &Vector3<f64>) -> Option<Point3<f64>> {
        let approach = self.normal.dot(direction);
        let s = -self.signed_distance(origin) / approach;
        (s.is_finite() && s >= 0.0).then(|| origin + direction * s)
    }
}

/// Two unit vectors that make a right-handed triad with `axis`.
pub(crate) fn across(axis: &Vector3<f64>) -> (Vector3<f64>, Vector3<f64>) {
    let axis = axis.normalize();
    let helper = if axis.x.abs() < 0.9 {
        Vector3::x()
    } else {
        Vector3::y()
    };
    let e1 = axis.cross(&helper).normalize();
    (e1, axis.cross(&e1))
}

/// Index of the first point with a coordinate that is NaN or infinite.
pub(crate) fn first_not_finite(points: &[Point3<f32>]) -> Option<usize> {
    points.iter().position(|p| !p.iter().all(|c| c.is_finite()))
}

/// Whether all points lie on one line, within a hundred thousandth of their extent: f32 keeps
/// seven digits.
pub(crate) fn on_one_line(mut points: impl Iterator<Item = Point3<f64>> + Clone) -> bool {
    let Some(first) = points.next() else {
        return true;
    };
    let offsets = || points.clone().map(|p| p - first);
    let longest = offsets().fold(Vector3::zeros(), |longest: Vector3<f64>, v| {
        if v.norm_squared() > longest.norm_squared() {
            v
        } else {
            longest
        }
    });
    let length_sq = longest.norm_squared();
    offsets().all(|v| v.cross(&longest).norm() <= 1e-5 * length_sq)
}
