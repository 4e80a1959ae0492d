//! Rays through the bones of a joint.

use nalgebra::{Point3, Vector3};

use super::bones::AnkleBones;
use super::exposure::Exposure;
use super::gutter::Gap;

/// Pixels in the plane through the joint, mm.
pub(super) const PIXEL_MM: f64 = 0.25;
/// Steps along rays, mm.
const STEP_MM: f64 = 0.4;
/// Half the length of rays around the joint, mm.
const HALF_RAY_MM: f64 = 60.0;
/// Half the depth within which gaps lie, mm.
const HALF_GAP_MM: f64 = 30.0;

/// A rectangle of the plane through the joint: first and last along rows and columns, mm from the joint.
#[derive(Debug, Clone, Copy)]
pub(super) struct Window {
    pub across_mm: [f64; 2],
    pub along_mm: [f64; 2],
}

impl Window {
    /// The rectangle in which an exposure shows all of `gaps`.
    pub fn around(gaps: &[Gap], exposure: &Exposure) -> Self {
        let unbounded = [f64::INFINITY, f64::NEG_INFINITY];
        let mut window = Self {
            across_mm: unbounded,
            along_mm: unbounded,
        };
        let widen = |[low, high]: &mut [f64; 2], value: f64| {
            *low = low.min(value);
            *high = high.max(value);
        };
        for gap in gaps {
            for end in [gap.foot, gap.end()] {
                let [across, along] = exposure.projected(&end);
                widen(&mut window.across_mm, across);
                widen(&mut window.along_mm, along);
            }
        }
        window
    }
}

/// Middles of equal steps that cover a stretch.
pub(super) fn middles([low, high]: [f64; 2], step: f64) -> impl Iterator<Item = f64> + Clone {
    let count = ((high - low) / step).ceil().max(1.0) as usize;
    let step = (high - low) / count as f64;
    (0..count).map(move |n| low + (n as f64 + 0.5) * step)
}

/// A ray near the joint, in voxels, cut into equal steps.
#[derive(Debug, Clone, Copy)]
pub(super) struct Ray {
    start: Point3<f64>,
    step: Vector3<f64>,
    steps: usize,
}

impl Ray {
    /// From the source through a point of the plane through the joint.
    pub fn through(exposure: &Exposure, [across, along]: [f64; 2], bones: &AnkleBones) -> Self {
        let target = exposure.joint + exposure.across * across + exposure.along * along;
        let direction = (target - exposure.source).normalize();
        Self {
            start: bones.voxel(&(target - direction * HALF_RAY_MM)),
            step: bones.voxel_vector(&(direction * STEP_MM)),
            steps: (2.0 * HALF_RAY_MM / STEP_MM) as usize,
        }
    }

    /// Middles of its steps, voxels.
    pub fn points(&self) -> impl Iterator<Item = Point3<f64>> {
        (0..self.steps).map(|n| self.start + self.step * (n as f64 + 0.5))
    }

    /// Length inside the voxels of a mask that lies within 30 mm of the plane through the joint, mm.
    pub fn path_mm(&self, mask: &[bool], size: [usize; 3]) -> f64 {
        let [nx, ny, nz] = size;
        let within = |p: &Point3<f64>| {
            let v = p.map(|c| c.round());
            let inside = v.iter().all(|&c| c >= 0.0)
                && v.x < nx as f64
                && v.y < ny as f64
                && v.z < nz as f64;
            inside && mask[(v.z as usize * ny + v.y as usize) * nx + v.x as usize]
        };
        let skipped = ((HALF_RAY_MM - HALF_GAP_MM) / STEP_MM) as usize;
        let near = self.points().skip(skipped).take(self.steps - 2 * skipped);
        // Every other point does: gaps are long.
        2.0 * STEP_MM * near.step_by(2).filter(within).count() as f64
    }

    /// Length inside bodies, mm; a stretch in two of them counts once. A chord longer than `most_mm` is not followed on.
    ///
    /// Surfaces are taken where the line between two steps passes level 1/2, so that chords do not come in whole steps.
    pub fn chord_mm(&self, bones: &AnkleBones, bodies: &[&[f32]], most_mm: f64) -> f64 {
        let depth = |p: Point3<f64>| {
            let values = bodies.iter().map(|body| bones.at(body, &p));
            f64::from(values.fold(0.0, f32::max)) - 0.5
        };
        let (mut chord_mm, mut before) = (0.0, -0.5);
        for here in self.points().map(depth) {
            let inside = match (before >= 0.0, here >= 0.0) {
                (true, true) => 1.0,
                (false, false) => 0.0,
                _ => f64::max(before, here) / (before - here).abs(),
            };
            chord_mm += STEP_MM * inside;
            if chord_mm > most_mm {
                break;
            }
            before = here;
        }
        chord_mm
    }
}
