//! A collision site: position, direction and weight; docs/physics.md, "Fast engine", first collisions.

use nalgebra::{Point3, Vector3};

/// A photon about to scatter: a collision site.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Site {
    pub position: Point3<f32>,
    pub direction: Vector3<f32>,
    /// Statistical weight relative to the other sites.
    pub weight: f32,
    /// Ratio of the attenuation coefficient of the outgoing photon to that at the typical energy.
    pub attenuation_ratio: f32,
    pub material: u8,
}
