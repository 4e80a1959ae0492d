//! Nearest primitive along a ray, through parry's bounding volume hierarchy. The only module that uses glam.
//!
//! parry works in f32. Its boxes are only used to skip what a ray cannot meet, and are widened so that rounding never
//! skips a primitive that is met; the primitives themselves are tested in f64 by the bodies.

use nalgebra::{Point3, Vector3};
use parry3d::bounding_volume::Aabb;
use parry3d::glamx::Vec3;
use parry3d::partitioning::{Bvh, BvhBuildStrategy, BvhNode};

/// A ray origin + t·direction in the frame of a body. With a direction whose camera z is 1, t is the z-depth.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Ray {
    pub origin: Point3<f64>,
    pub direction: Vector3<f64>,
}

/// Fixed widening of every box, mm: more than f32 rounding of a ray that starts within 20 m.
const WIDEN_MM: f32 = 0.05;
/// Further widening by the size of the coordinates: a few units in the last place.
const WIDEN_REL: f32 = 1e-6;

/// Boxes of primitives numbered from 0.
#[derive(Clone)]
pub(crate) struct Index {
    bvh: Bvh,
}

impl Index {
    /// `bounds`: lower and upper corner of each primitive; at least one.
    pub(crate) fn new(bounds: impl Iterator<Item = [Point3<f32>; 2]>) -> Self {
        let boxes: Vec<Aabb> = bounds
            .map(|[low, high]| {
                let widen = |corner: Point3<f32>| WIDEN_MM + WIDEN_REL * corner.coords.amax();
                let (low_mm, high_mm) = (
                    low.coords.add_scalar(-widen(low)),
                    high.coords.add_scalar(widen(high)),
                );
                Aabb::new(low_mm.into(), high_mm.into())
            })
            .collect();
        Self {
            bvh: Bvh::from_leaves(BvhBuildStrategy::Binned, &boxes),
        }
    }

    /// Smallest t below `limit` that `hit` reports for a primitive along the ray.
    pub(crate) fn nearest(
        &self,
        ray: &Ray,
        limit: f64,
        hit: impl Fn(u32) -> Option<f64>,
    ) -> Option<f64> {
        let origin: Vec3 = ray.origin.coords.cast::<f32>().into();
        // A vanishing component would make 0/0 of an origin inside the slab's boundary plane.
        let inverse: Vec3 = ray
            .direction
            .map(|component| {
                let component = component as f32;
                1.0 / if component.abs() < 1e-30 {
                    1e-30
                } else {
                    component
                }
            })
            .into();
        let entry = |node: &BvhNode, _: f32| {
            let (low, high) = (
                (node.mins() - origin) * inverse,
                (node.maxs() - origin) * inverse,
            );
            let (enter, leave) = (low.min(high).max_element(), low.max(high).min_element());
            if enter <= leave && leave >= 0.0 {
                enter
            } else {
                f32::MAX
            }
        };
        let cost =
            |primitive: u32, _: f32| hit(primitive).filter(|t| *t < limit).map(|t| (t as f32, t));
        let limit_f32 = if limit.is_finite() {
            limit as f32
        } else {
            f32::MAX
        };
        self.bvh
            .find_best(limit_f32, entry, cost)
            .map(|(_, (_, t))| t)
    }
}

impl std::fmt::Debug for Index {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Index")
            .field("leaves", &self.bvh.leaf_count())
            .finish()
    }
}
