//! Skin surface and the soft tissues below it.

use nalgebra::Point3;

use super::bounds::Bounds;
use super::sdf::{Plane, Shape};
use super::smooth::{smooth_max, smooth_min, smooth_step};

/// A shape with its bounding box, by which it is skipped where it is far away.
#[derive(Debug, Clone)]
pub(super) struct Bounded {
    shape: Shape,
    bounds: Bounds,
}

impl Bounded {
    pub(super) fn new(shape: Shape) -> Self {
        Self {
            bounds: shape.bounds(),
            shape,
        }
    }
}

/// Thickness of the fat below the skin.
#[derive(Debug, Clone)]
pub(super) struct Cover {
    pub even_mm: f64,
    /// Thick over the calf, thin at ankle and shin; the size of the leg relative to P01.
    pub calf: Option<f64>,
    /// Thick within 3 cm of the standing plane, whose normal points down.
    pub sole: Option<Plane>,
}

/// The soft tissues.
#[derive(Debug, Clone)]
pub(super) struct Envelope {
    /// The shape into which the parts are blended.
    pub first: Shape,
    /// Parts and the widths of their blends, mm.
    pub parts: Vec<(Bounded, f64)>,
    /// Shapes that press the skin flat, such as a table, and the widths of their edges, mm.
    pub cuts: Vec<(Shape, f64)>,
    pub skin_mm: f64,
    pub cover: Cover,
    pub tendon: Option<Shape>,
    /// Fat bodies away from the skin.
    pub fat: Vec<Shape>,
}

impl Envelope {
    /// Signed distance to the skin, mm.
    pub(super) fn skin_distance(&self, p: &Point3<f64>) -> f64 {
        let mut body = self.first.distance(p);
        for (part, blend) in &self.parts {
            if part.bounds.distance(p) < body + blend {
                body = smooth_min(body, part.shape.distance(p), *blend);
            }
        }
        for (cut, blend) in &self.cuts {
            body = smooth_max(body, cut.distance(p), *blend);
        }
        body
    }

    pub(super) fn skin_mm(&self) -> f64 {
        self.skin_mm
    }

    /// Thickness of skin and fat together at a point.
    pub(super) fn cover_mm(&self, p: &Point3<f64>) -> f64 {
        let Cover {
            even_mm,
            calf,
            sole,
        } = &self.cover;
        let calf_mm = calf.map_or(0.0, |size| {
            let behind = smooth_step(-25.0 * size, 25.0 * size, p.y);
            size * smooth_step(20.0 * size, 160.0 * size, p.z) * (1.0 + 4.0 * behind)
        });
        let sole_mm = sole.as_ref().map_or(0.0, |sole| {
            3.5 * even_mm * smooth_step(30.0 * even_mm, 10.0 * even_mm, -sole.distance(p))
        });
        self.skin_mm + even_mm + calf_mm + sole_mm
    }

    /// Signed distance to the fat bodies away from the skin. The tendon, which may run through them, is not subtracted.
    pub(super) fn deep_fat_distance(&self, p: &Point3<f64>) -> f64 {
        let fat = self.fat.iter().map(|fat| fat.distance(p));
        let fat = fat.reduce(|a, b| smooth_min(a, b, 1.0));
        fat.unwrap_or(f64::INFINITY)
    }

    /// Signed distance to the tendon.
    pub(super) fn tendon_distance(&self, p: &Point3<f64>) -> f64 {
        let distance = self.tendon.as_ref().map(|tendon| tendon.distance(p));
        distance.unwrap_or(f64::INFINITY)
    }
}
