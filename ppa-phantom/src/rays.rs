//! Intersections of a straight ray with a limb: reference values for depth images and radiographs.

use nalgebra::{Point3, Unit, Vector3};

use super::limb::Limb;
use super::tissue::Tissue;

/// A section of a ray inside one tissue; distances from the ray's origin, mm.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Chord {
    /// Tissue of the section.
    pub tissue: Tissue,
    /// Distance at which the ray enters.
    pub from_mm: f64,
    /// Distance at which it leaves.
    pub to_mm: f64,
}

impl Chord {
    /// Length inside the tissue.
    pub fn length_mm(&self) -> f64 {
        self.to_mm - self.from_mm
    }
}

/// Where a ray crosses the skin.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SkinHit {
    /// Distance from the ray's origin, mm.
    pub distance_mm: f64,
    /// Point on the skin, `ct`.
    pub point: Point3<f64>,
    /// Unit normal of the skin, outwards.
    pub normal: Unit<Vector3<f64>>,
}

/// Accuracy of crossings, mm.
const TOLERANCE_MM: f64 = 1e-7;
/// Shortest step: a thinner section of tissue may be missed.
const LEAST_STEP_MM: f64 = 0.02;
/// Longest step inside bone, where marrow begins without a surface.
const STEP_IN_BONE_MM: f64 = 1.0;
/// Safety factor: distances are estimates.
const CAUTION: f64 = 1.5;

impl Limb {
    /// The tissues along a ray up to `reach_mm`, in order, without the air outside the limb.
    ///
    /// Ends are exact to 1e-7 mm; a section shorter than 0.02 mm may be missed. The table is not part of the limb.
    pub fn chords(
        &self,
        origin: &Point3<f64>,
        direction: &Unit<Vector3<f64>>,
        reach_mm: f64,
    ) -> Vec<Chord> {
        let (start, along) = self.ray_in_limb(origin, direction);
        let at = |t: f64| start + along * t;
        let mut chords = Vec::new();
        let mut push = |tissue, from_mm, to_mm| {
            if tissue != Tissue::Air && from_mm < to_mm {
                chords.push(Chord {
                    tissue,
                    from_mm,
                    to_mm,
                });
            }
        };
        let (mut t, mut entered) = (0.0, 0.0);
        let mut tissue = self.tissue_in_limb(&start);
        while t < reach_mm {
            let step = (self.clearance(&at(t)) / CAUTION).max(LEAST_STEP_MM);
            let next = (t + step).min(reach_mm);
            if self.tissue_in_limb(&at(next)) == tissue {
                t = next;
                continue;
            }
            let leaves = bisect(t, next, |t| self.tissue_in_limb(&at(t)) == tissue);
            push(tissue, entered, leaves);
            // A third tissue may come before `next`: continue just behind the surface.
            (t, entered) = (leaves, leaves);
            tissue = self.tissue_in_limb(&at(leaves));
        }
        push(tissue, entered, reach_mm);
        chords
    }

    /// Returns where a ray first crosses the skin, exact to 1e-7 mm: where it enters the limb or, from an origin inside, where
    /// it leaves it. `None` if it does neither within `reach_mm`.
    ///
    /// A section shorter than 0.02 mm inside or outside the limb may be missed.
    pub fn skin_hit(
        &self,
        origin: &Point3<f64>,
        direction: &Unit<Vector3<f64>>,
        reach_mm: f64,
    ) -> Option<SkinHit> {
        let (start, along) = self.ray_in_limb(origin, direction);
        let distance = |t: f64| self.envelope.skin_distance(&(start + along * t));
        let begins_inside = distance(0.0) < 0.0;
        let mut t = 0.0;
        while t < reach_mm {
            let next = t + (distance(t).abs() / CAUTION).max(LEAST_STEP_MM);
            if (distance(next) < 0.0) != begins_inside {
                let distance_mm = bisect(t, next, |t| (distance(t) < 0.0) == begins_inside);
                let point = origin + direction.scale(distance_mm);
                return (distance_mm <= reach_mm).then(|| SkinHit {
                    distance_mm,
                    point,
                    normal: self.skin_normal(&point),
                });
            }
            t = next;
        }
        None
    }

    fn ray_in_limb(
        &self,
        origin: &Point3<f64>,
        direction: &Unit<Vector3<f64>>,
    ) -> (Point3<f64>, Vector3<f64>) {
        let along = self.direction_on_right(direction.into_inner());
        let along = self.ct_from_limb.inverse_transform_vector(&along);
        (self.limb_point(origin), along)
    }

    /// Approximate distance from a point of the limb frame to the nearest place where the tissue may change.
    fn clearance(&self, p: &Point3<f64>) -> f64 {
        let envelope = &self.envelope;
        let skin = envelope.skin_distance(p);
        if skin > 0.0 {
            return skin;
        }
        let tendon = envelope.tendon_distance(p);
        let mut clearance = [
            skin,
            skin + envelope.skin_mm(),
            skin + envelope.cover_mm(p),
            envelope.deep_fat_distance(p).max(-tendon),
            tendon,
        ]
        .map(f64::abs)
        .into_iter()
        .fold(f64::INFINITY, f64::min);
        if let Some(plate) = &self.plate {
            clearance = clearance.min(plate.distance(p).abs());
        }
        for bone in 0..self.skeleton.bones().len() {
            let far = self.skeleton.box_distance(bone, p);
            if far > clearance {
                continue;
            }
            let distance = self.skeleton.distance(bone, p);
            clearance = clearance.min(distance.abs().max(far));
            if distance < 0.0 {
                let skeleton = &self.skeleton;
                let cortex_mm = skeleton.cortex_mm(bone, p, distance, STEP_IN_BONE_MM);
                clearance = clearance
                    .min((distance + cortex_mm).abs())
                    .min(STEP_IN_BONE_MM);
            }
        }
        clearance
    }
}

/// Finds the end of the section from `low` on which `holds`, just past it; it does not hold at `high`.
fn bisect(mut low: f64, mut high: f64, holds: impl Fn(f64) -> bool) -> f64 {
    while high - low > TOLERANCE_MM {
        let middle = 0.5 * (low + high);
        if holds(middle) {
            low = middle;
        } else {
            high = middle;
        }
    }
    high
}
