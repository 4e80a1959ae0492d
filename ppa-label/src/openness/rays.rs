//! Rays through the bones of a joint.

use nalgebra::{Point3, Vector3};

use super::bones::{AnkleBones, Body};
use super::exposure::Exposure;
use super::gap_voxels::GapVoxels;
use super::gutter::Gap;

/// Pixel size in the plane through the joint, mm.
pub(super) const PIXEL_MM: f64 = 0.25;
/// Step length along rays, mm.
pub(super) const STEP_MM: f64 = 0.4;
/// Half the length of rays, to each side of the plane through the joint, mm.
const HALF_RAY_MM: f64 = 60.0;
/// Half the depth range of gaps, mm.
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

/// Midpoints of equal steps that cover an interval.
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
    /// The ray from the source through a point of the plane through the joint.
    pub fn through(exposure: &Exposure, [across, along]: [f64; 2], bones: &AnkleBones) -> Self {
        let target = exposure.joint + exposure.across * across + exposure.along * along;
        let direction = (target - exposure.source).normalize();
        Self {
            start: bones.voxel(&(target - direction * HALF_RAY_MM)),
            step: bones.voxel_vector(&(direction * STEP_MM)),
            steps: (2.0 * HALF_RAY_MM / STEP_MM) as usize,
        }
    }

    /// Midpoints of its steps, voxels.
    pub fn points(&self) -> impl Iterator<Item = Point3<f64>> {
        (0..self.steps).map(|n| self.point(n))
    }

    fn point(&self, step: usize) -> Point3<f64> {
        self.start + self.step * (step as f64 + 0.5)
    }

    /// Number of steps over which every coordinate changes by less than `voxels`.
    fn steps_within(&self, voxels: usize) -> usize {
        // The margin covers rounding.
        ((voxels as f64 - 1e-6).max(0.0) / self.step.amax()) as usize
    }

    /// Length inside the voxels of gaps that lies within 30 mm of the plane through the joint, mm.
    pub fn path_mm(&self, gaps: &GapVoxels) -> f64 {
        // Every other point is enough: gaps are long.
        const STRIDE: usize = 2;
        let skipped = ((HALF_RAY_MM - HALF_GAP_MM) / STEP_MM) as usize;
        let (mut step, mut within) = (skipped, 0_u32);
        while step < self.steps - skipped {
            step += match gaps.free_voxels(&self.point(step)) {
                None => {
                    within += 1;
                    STRIDE
                }
                Some(free) => (1 + self.steps_within(free) / STRIDE) * STRIDE,
            };
        }
        STRIDE as f64 * STEP_MM * f64::from(within)
    }

    /// Length inside bodies, mm; overlapping parts count once. Stops once the length exceeds `most_mm`.
    ///
    /// Surfaces are at level 1/2, interpolated linearly between two steps, so chords are not multiples of the step.
    pub fn chord_mm(&self, bones: &AnkleBones, bodies: &[&Body], most_mm: f64) -> f64 {
        let depth = |step: usize| {
            let point = self.point(step);
            let values = bodies.iter().map(|body| bones.at(body, &point));
            f64::from(values.fold(0.0, f32::max)) - 0.5
        };
        let (mut chord_mm, mut was_inside) = (0.0, false);
        let mut step = 0;
        while step < self.steps {
            let (inside, alike) = match self.side(step, bones, bodies) {
                Some((inside, free)) => (inside, 1 + self.steps_within(free)),
                None => (depth(step) >= 0.0, 1),
            };
            if inside != was_inside {
                let before = if step == 0 { -0.5 } else { depth(step - 1) };
                let here = depth(step);
                chord_mm += STEP_MM * (f64::max(before, here) / (before - here).abs());
            } else if inside {
                chord_mm += STEP_MM;
            }
            if chord_mm > most_mm {
                break;
            }
            was_inside = inside;
            let next = (step + alike).min(self.steps);
            if inside {
                // Added one by one to get the same rounding as single steps.
                for _ in step + 1..next {
                    chord_mm += STEP_MM;
                    if chord_mm > most_mm {
                        return chord_mm;
                    }
                }
            }
            step = next;
        }
        chord_mm
    }

    /// Whether any of its steps is inside a body.
    pub fn meets(&self, bones: &AnkleBones, body: &Body) -> bool {
        let mut step = 0;
        while step < self.steps {
            step += match self.side(step, bones, &[body]) {
                Some((true, _)) => return true,
                Some((false, free)) => 1 + self.steps_within(free),
                None if bones.at(body, &self.point(step)) >= 0.5 => return true,
                None => 1,
            };
        }
        false
    }

    /// Whether the point of a step is inside a body, and by how many voxels every coordinate may change while that remains true; `None`
    /// near a surface.
    fn side(&self, step: usize, bones: &AnkleBones, bodies: &[&Body]) -> Option<(bool, usize)> {
        let Some(cell) = bones.cell(&self.point(step)) else {
            return Some((false, 0));
        };
        let sides = bodies.iter().map(|body| body.side(cell));
        let mut all = Some((false, usize::MAX));
        for side in sides {
            all = match (side, all) {
                (Some((true, free)), _) => return Some((true, free)),
                (Some((false, free)), Some((_, least))) => Some((false, free.min(least))),
                _ => None,
            };
        }
        all
    }
}
