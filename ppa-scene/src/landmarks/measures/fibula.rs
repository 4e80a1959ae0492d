//! Position of the thinner of two parallel bones, which distinguishes a left leg from a right one.

use nalgebra::{Point3, Vector3};
use ppa_core::Side;

use super::sections::{LimbSection, LimbSections};
use crate::landmarks::found::Landmarks;

/// The thinner bone next to the shaft of the thicker one.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Fibula {
    /// Mean direction from the thicker to the thinner bone across the axis: towards the patient's right
    /// and towards anterior, mm.
    pub from_tibia_mm: [f64; 2],
    /// Mean direction from the middle of the limb to the thicker bone, as above, mm.
    pub tibia_from_middle_mm: [f64; 2],
    /// Sine of the angle from the second of these directions to the first, seen from proximal with
    /// anterior up: negative in a right leg.
    pub sine: f64,
    /// Middle of the thinner bone, `ct` frame, mm.
    pub centre_mm: [f64; 3],
}

/// Smallest sine at which the middle of the limb does not count as collinear with both bones.
const LEAST_SINE: f64 = 0.2;

/// Areas of fibula and tibia are in this ratio; those of a forearm's bones are alike.
const AREA_RATIO: std::ops::Range<f64> = 0.05..0.7;

/// Their middles are this far apart, mm; those of a forearm's bones are nearer.
const APART_MM: std::ops::Range<f64> = 20.0..60.0;

/// A pair of bones is seen in at least this share of the shaft's sections, and in five.
const LEAST_SHARE: f64 = 0.6;

struct Pair {
    from_tibia: Vector3<f64>,
    tibia_from_middle: Vector3<f64>,
    fibula: Point3<f64>,
}

impl Fibula {
    /// The side of a leg with such bones; `None` if the middle of the limb is collinear with both.
    ///
    /// The tibia lies in front of the middle of the leg, under the skin, and the fibula lateral of
    /// it: the turn from one direction to the other gives the side however the leg is rotated.
    pub fn side(&self) -> Option<Side> {
        (self.sine.abs() >= LEAST_SINE).then_some(match self.sine < 0.0 {
            true => Side::Right,
            false => Side::Left,
        })
    }

    /// `None` unless most sections through the shaft show two bones like tibia and fibula.
    pub(super) fn of(sections: &LimbSections, landmarks: &Landmarks) -> Option<Self> {
        const FEWEST: usize = 5;
        let shaft = sections.through_shaft();
        let turn = landmarks.patient_from_ct().isometry().rotation;
        let pair = |section: &&LimbSection| {
            let [tibia, fibula, ..] = section.bones[..] else {
                return None;
            };
            let from_tibia = turn * (fibula.centre - tibia.centre);
            let is_leg = AREA_RATIO.contains(&(fibula.area_mm2 / tibia.area_mm2))
                && APART_MM.contains(&from_tibia.xy().norm());
            is_leg.then(|| Pair {
                from_tibia,
                tibia_from_middle: turn * (tibia.centre - section.centre),
                fibula: fibula.centre,
            })
        };
        let pairs: Vec<Pair> = shaft.iter().filter_map(pair).collect();
        let seen = pairs.len() as f64;
        if pairs.len() < FEWEST || seen < LEAST_SHARE * shaft.len() as f64 {
            return None;
        }
        let mean =
            |pick: fn(&Pair) -> Vector3<f64>| pairs.iter().map(pick).sum::<Vector3<f64>>() / seen;
        let from_tibia = mean(|pair| pair.from_tibia);
        let off = mean(|pair| pair.tibia_from_middle);
        let turned = off.x * from_tibia.y - off.y * from_tibia.x;
        let sine = turned / (off.xy().norm() * from_tibia.xy().norm());
        Some(Self {
            from_tibia_mm: [from_tibia.x, from_tibia.y],
            tibia_from_middle_mm: [off.x, off.y],
            sine: if sine.is_finite() { sine } else { 0.0 },
            centre_mm: mean(|pair| pair.fibula.coords).into(),
        })
    }
}
