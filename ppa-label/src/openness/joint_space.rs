//! The gutters of an ankle, and their openness to the beam.

use std::fmt;

use nalgebra::Isometry3;
use rayon::prelude::*;
use serde::Serialize;

use super::bones::{AnkleBone, AnkleBones};
use super::exposure::{Exposure, LimbAxes};
use super::gap_voxels::GapVoxels;
use super::gutter::{Gap, gaps, is_superior};

/// One of the three parts of the ankle's joint space.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Gutter {
    /// Between talus and medial malleolus.
    Medial,
    /// Between trochlea and plafond.
    Superior,
    /// Between talus and lateral malleolus.
    Lateral,
}

impl Gutter {
    /// All three.
    pub const ALL: [Self; 3] = [Self::Medial, Self::Superior, Self::Lateral];
}

impl fmt::Display for Gutter {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Medial => "medial",
            Self::Superior => "superior",
            Self::Lateral => "lateral",
        })
    }
}

/// Why bones have no usable joint space.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum JointSpaceError {
    /// A gutter was not found.
    #[error(
        "no {0} gutter: talus and {opposite} do not face each other within 6 mm anywhere",
        opposite = if *.0 == Gutter::Lateral { "fibula" } else { "tibia" }
    )]
    NoGutter(Gutter),
    /// A gutter is not open from any direction of the beam.
    #[error(
        "the {0} gutter is not open from any direction around the limb: the bones may not be separated"
    )]
    NeverOpen(Gutter),
    /// No direction of the beam opens all gutters.
    #[error(
        "the three gutters are not open at once from any direction around the limb: the worst one never shows more than \
         {0:.2} of what it could, expected at least {LEAST_ATTAINABLE}"
    )]
    NeverTogether(f64),
}

/// Length of bone on a ray that still counts as free, mm: three tolerances, the middle one for the label, the others for its
/// uncertainty.
pub const FREE_CHORDS_MM: [f64; 3] = [0.5, 1.0, 2.0];

/// Openness of each gutter to one exposure, from 0 (closed) to 1 (the most open from any direction around the limb).
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Openness {
    /// Medial gutter, for each of [`FREE_CHORDS_MM`].
    pub medial: [f64; 3],
    /// Superior gutter.
    pub superior: f64,
    /// Lateral gutter, for each of [`FREE_CHORDS_MM`].
    pub lateral: [f64; 3],
    /// [`worst`](Self::worst) from the direction around the limb that opens all three gutters best: below 1, since the facets are
    /// not parallel.
    pub attainable: [f64; 3],
}

impl Openness {
    /// Openness of the worst gutter, for each of [`FREE_CHORDS_MM`].
    pub fn worst(&self) -> [f64; 3] {
        std::array::from_fn(|n| self.medial[n].min(self.superior).min(self.lateral[n]))
    }
}

/// Search for the most open rotation about the limb's axis, degrees: coarse steps over the full range, then fine steps around the best.
const FARTHEST_DEG: f64 = 48.0;
const COARSE_DEG: f64 = 4.0;
const FINE_DEG: f64 = 0.5;
/// Below this, the shapes are hardly those of an ankle. P09, whose facets diverge most among the phantoms, reaches 0.29.
const LEAST_ATTAINABLE: f64 = 0.1;

/// The gutters of an ankle, which can be viewed from any direction.
#[derive(Debug, Clone)]
pub struct JointSpace {
    pub(super) bones: AnkleBones,
    pub(super) limb: LimbAxes,
    pub(super) medial: SeenGap,
    pub(super) superior: SeenGap,
    pub(super) lateral: SeenGap,
}

#[derive(Debug, Clone)]
pub(super) struct SeenGap {
    /// The bone opposite the talus.
    pub opposite: AnkleBone,
    pub gaps: Vec<Gap>,
    pub voxels: GapVoxels,
}

/// Visible parts of the gutters: areas in mm² for each of [`FREE_CHORDS_MM`], and contrast.
#[derive(Debug, Clone, Copy)]
struct Visible {
    medial: [f64; 3],
    superior: [f64; 1],
    lateral: [f64; 3],
}

impl JointSpace {
    /// Finds the gutters between the bones; `ct_from_patient` has the joint at its origin, z towards proximal and
    /// y anterior.
    ///
    /// # Errors
    /// [`JointSpaceError::NoGutter`] when talus and tibia or fibula do not face each other anywhere across at most 6 mm.
    pub fn new(
        bones: AnkleBones,
        ct_from_patient: &Isometry3<f64>,
    ) -> Result<Self, JointSpaceError> {
        let limb = LimbAxes::of_patient(ct_from_patient);
        let to_tibia = gaps(&bones, AnkleBone::Tibia);
        let (superior, medial) = to_tibia
            .into_iter()
            .partition(|gap| is_superior(gap, &limb.axis));
        let lateral = gaps(&bones, AnkleBone::Fibula);
        let seen = |gutter, opposite, gaps: Vec<Gap>| match gaps.is_empty() {
            true => Err(JointSpaceError::NoGutter(gutter)),
            false => Ok(SeenGap {
                opposite,
                voxels: GapVoxels::of(&gaps, &bones),
                gaps,
            }),
        };
        Ok(Self {
            medial: seen(Gutter::Medial, AnkleBone::Tibia, medial)?,
            superior: seen(Gutter::Superior, AnkleBone::Tibia, superior)?,
            lateral: seen(Gutter::Lateral, AnkleBone::Fibula, lateral)?,
            bones,
            limb,
        })
    }

    /// Openness of the gutters to each exposure.
    ///
    /// Medial and lateral gutter, whose faces are nearly plane: the area of the rays that run along the gap and meet at most a tolerated
    /// length ([`FREE_CHORDS_MM`]) of the two adjacent bones, relative to the largest such area from any direction around the limb.
    /// For a slab of width w and depth L this is 1 − L tan φ / w at an angle φ off its plane.
    ///
    /// Superior gutter: the plafond's edges extend below the dome, so no ray is free of bone. Its openness is the contrast
    /// 1 − (least bone in the gap) / (most bone next to it), with all bones together, averaged over the columns of the
    /// image, relative to the highest contrast from any direction around the limb.
    ///
    /// # Errors
    /// [`JointSpaceError::NeverOpen`] if a gutter is not open from any direction, [`JointSpaceError::NeverTogether`] if no
    /// direction opens all of them.
    pub fn openness(&self, exposures: &[Exposure]) -> Result<Vec<Openness>, JointSpaceError> {
        let Some(first) = exposures.first() else {
            return Ok(Vec::new());
        };
        let distance_mm = first.distance_mm();
        let around = |middle: f64, reach: f64, step: f64| -> Vec<(f64, Exposure)> {
            let half = (reach / step) as i32;
            let degrees = (-half..=half).map(|n| middle + step * f64::from(n));
            degrees
                .map(|d| (d, Exposure::around(&self.limb, d.to_radians(), distance_mm)))
                .collect()
        };
        let coarse = self.visible(&around(0.0, FARTHEST_DEG, COARSE_DEG));
        let fine = |degrees: f64| around(degrees, COARSE_DEG, FINE_DEG);
        let most = Visible {
            medial: most_of(
                &coarse,
                |v| v.medial,
                fine,
                |e| self.open_areas_mm2(&self.medial, e),
            ),
            superior: most_of(&coarse, |v| v.superior, fine, |e| [self.contrast(e)]),
            lateral: most_of(
                &coarse,
                |v| v.lateral,
                fine,
                |e| self.open_areas_mm2(&self.lateral, e),
            ),
        };
        for (gutter, most) in [
            (Gutter::Medial, &most.medial[..]),
            (Gutter::Superior, &most.superior[..]),
            (Gutter::Lateral, &most.lateral[..]),
        ] {
            if most.iter().any(|&most| most <= 0.0) {
                return Err(JointSpaceError::NeverOpen(gutter));
            }
        }
        let relative = |visible: &Visible| Openness {
            medial: std::array::from_fn(|n| (visible.medial[n] / most.medial[n]).min(1.0)),
            superior: (visible.superior[0] / most.superior[0]).min(1.0),
            lateral: std::array::from_fn(|n| (visible.lateral[n] / most.lateral[n]).min(1.0)),
            attainable: [1.0; 3],
        };
        let worst = |visible: &Visible| relative(visible).worst();
        let (_, best_deg) = best_of(coarse.iter().map(|(d, v)| (worst(v), *d)));
        let near = self.visible(&fine(best_deg));
        let (attainable, _) = best_of(near.iter().map(|(d, v)| (worst(v), *d)));
        if attainable[1] < LEAST_ATTAINABLE {
            return Err(JointSpaceError::NeverTogether(attainable[1]));
        }
        let exposures: Vec<_> = exposures.iter().map(|&e| (0.0, e)).collect();
        let seen = self.visible(&exposures);
        Ok(seen
            .iter()
            .map(|(_, visible)| Openness {
                attainable,
                ..relative(visible)
            })
            .collect())
    }

    /// What exposures show, each with the number passed with it.
    fn visible(&self, exposures: &[(f64, Exposure)]) -> Vec<(f64, Visible)> {
        let seen = |(degrees, exposure): &(f64, Exposure)| {
            let visible = Visible {
                medial: self.open_areas_mm2(&self.medial, exposure),
                superior: [self.contrast(exposure)],
                lateral: self.open_areas_mm2(&self.lateral, exposure),
            };
            (*degrees, visible)
        };
        exposures.par_iter().map(seen).collect()
    }
}

/// The largest value from any direction: the best coarse one is refined by the fine ones around it.
fn most_of<const N: usize>(
    coarse: &[(f64, Visible)],
    of: impl Fn(&Visible) -> [f64; N],
    fine: impl Fn(f64) -> Vec<(f64, Exposure)>,
    see: impl Fn(&Exposure) -> [f64; N] + Sync,
) -> [f64; N] {
    let (_, degrees) = best_of(coarse.iter().map(|(d, visible)| (of(visible), *d)));
    let near: Vec<([f64; N], f64)> = fine(degrees)
        .par_iter()
        .map(|(d, exposure)| (see(exposure), *d))
        .collect();
    best_of(near.into_iter()).0
}

/// The best by the middle one of three tolerances, or by the only value; the first of equal ones.
fn best_of<const N: usize>(all: impl Iterator<Item = ([f64; N], f64)>) -> ([f64; N], f64) {
    let better = |a: ([f64; N], f64), b: ([f64; N], f64)| {
        if b.0[N / 2] > a.0[N / 2] { b } else { a }
    };
    all.reduce(better).expect("there are directions")
}
