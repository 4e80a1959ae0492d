//! The shadows of bones along one row of the detector.

use nalgebra::Point3;

use super::bones::{AnkleBone, AnkleBones};
use super::exposure::Exposure;
use super::gutter::Gap;
use super::joint_space::JointSpace;
use super::rays::Ray;

/// Depth below the plafond at which malleoli and talus are compared, mm: below the lips of the plafond, above the tips of the malleoli.
pub(super) const MALLEOLI_MM: f64 = 7.0;
/// Search range for bones to each side of the joint, and its step, mm.
const REACH_MM: f64 = 50.0;
const STEP_MM: f64 = 0.2;
/// Smallest depth of the incisura between its tubercles, mm.
const LEAST_DEPTH_MM: f64 = 0.3;

/// The rays of one row of the detector, from lateral to medial.
pub(super) struct Fan<'a> {
    bones: &'a AnkleBones,
    columns: Vec<Ray>,
}

impl JointSpace {
    /// The rays that meet the limb's axis at the given height above the mean height of the plafond.
    pub(super) fn fan(&self, exposure: &Exposure, above_plafond_mm: f64) -> Fan<'_> {
        let height = self.plafond_mm() + above_plafond_mm;
        let level = self.limb.joint + self.limb.axis.scale(height);
        let [_, along] = exposure.projected(&level);
        let medial_sign = self.medial_sign(exposure);
        let columns = (0..=(2.0 * REACH_MM / STEP_MM) as i32)
            .map(|n| medial_sign * (f64::from(n) * STEP_MM - REACH_MM))
            .map(|across| Ray::through(exposure, [across, along], &self.bones));
        Fan {
            bones: &self.bones,
            columns: columns.collect(),
        }
    }

    /// Mean height of the plafond above the joint, along the limb's axis.
    pub(super) fn plafond_mm(&self) -> f64 {
        let ends = self.superior.gaps.iter().map(Gap::end);
        let heights = ends.map(|end| self.height_mm(end));
        heights.sum::<f64>() / self.superior.gaps.len() as f64
    }

    /// Height of a point above the joint along the limb's axis.
    pub(super) fn height_mm(&self, point: Point3<f64>) -> f64 {
        (point - self.limb.joint).dot(&self.limb.axis)
    }

    /// 1 if `across` points from the fibula to the medial malleolus, otherwise −1.
    pub(super) fn medial_sign(&self, exposure: &Exposure) -> f64 {
        let mean = |gaps: &[Gap]| {
            let across = gaps.iter().map(|gap| exposure.projected(&gap.foot)[0]);
            across.sum::<f64>() / gaps.len() as f64
        };
        (mean(&self.medial.gaps) - mean(&self.lateral.gaps)).signum()
    }
}

impl Fan<'_> {
    /// First and last position of a bone's shadow, mm from lateral.
    pub fn edges(&self, bone: AnkleBone) -> Option<[f64; 2]> {
        let body = self.bones.body(bone);
        let hit = |ray: &Ray| ray.meets(self.bones, body);
        let first = self.columns.iter().position(hit)?;
        let last = self.columns.iter().rposition(hit)?;
        Some([first, last].map(|n| n as f64 * STEP_MM))
    }

    /// The most medial position of a bone's lateral outline between two tubercles, mm from lateral: the projection of the floor of the
    /// incisura.
    pub fn notch(&self, bone: AnkleBone) -> Option<f64> {
        let body = self.bones.body(bone);
        let depths = self.columns.first()?.points().count();
        let mut outline = vec![f64::INFINITY; depths];
        for (n, ray) in self.columns.iter().enumerate() {
            for (edge, p) in outline.iter_mut().zip(ray.points()) {
                if edge.is_infinite() && self.bones.at(body, &p) >= 0.5 {
                    *edge = n as f64 * STEP_MM;
                }
            }
        }
        let first = outline.iter().position(|edge| edge.is_finite())?;
        let last = outline.iter().rposition(|edge| edge.is_finite())?;
        let outline = &outline[first..=last];
        // Depth relative to the more medial of the two tubercles, the most lateral points in front and behind.
        let foremost = |edges: &[f64]| edges.iter().copied().fold(f64::INFINITY, f64::min);
        (0..outline.len())
            .map(|n| {
                let tubercles = foremost(&outline[..=n]).max(foremost(&outline[n..]));
                (outline[n] - tubercles, outline[n])
            })
            .filter(|(depth, edge)| *depth >= LEAST_DEPTH_MM && edge.is_finite())
            .reduce(|a, b| if b.0 > a.0 { b } else { a })
            .map(|(_, edge)| edge)
    }
}
