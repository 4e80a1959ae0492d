//! How much of each gutter a malleolus hides.

use serde::Serialize;

use super::bones::AnkleBone;
use super::exposure::Exposure;
use super::fan::MALLEOLI_MM;
use super::gutter::Gap;
use super::joint_space::JointSpace;

/// Distance between the levels at which malleolus and talus are compared, mm.
const LEVELS_MM: f64 = 2.0;

/// How much an exposure hides of the medial and the lateral gutter, below the lips of the plafond.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct HiddenGutters {
    /// Medial gutter, behind or in front of the medial malleolus.
    pub medial: Hidden,
    /// Lateral gutter, behind or in front of the lateral malleolus.
    pub lateral: Hidden,
}

/// How much an exposure hides of one gutter.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Hidden {
    /// Share of the gutter's height at which the shadows of malleolus and talus overlap, 0 to 1.
    pub share: f64,
    /// Width of that overlap, 0 where the shadows do not overlap: the median over the gutter's height, mm in the plane through the joint.
    pub median_mm: f64,
}

impl JointSpace {
    /// How much an exposure hides of the medial and the lateral gutter.
    ///
    /// The shadows of malleolus and talus are compared at levels 2 mm apart, from 7 mm below the plafond, where its lips end, down
    /// to the lowest place at which the two bones face each other.
    pub fn hidden(&self, exposure: &Exposure) -> HiddenGutters {
        HiddenGutters {
            medial: self.hidden_by(AnkleBone::Tibia, &self.medial.gaps, exposure),
            lateral: self.hidden_by(AnkleBone::Fibula, &self.lateral.gaps, exposure),
        }
    }

    fn hidden_by(&self, malleolus: AnkleBone, gaps: &[Gap], exposure: &Exposure) -> Hidden {
        let lowest = gaps.iter().map(|gap| self.height_mm(gap.foot));
        let depth = self.plafond_mm() - lowest.fold(f64::INFINITY, f64::min);
        let levels = (depth - MALLEOLI_MM).max(0.0) / LEVELS_MM;
        let overlaps = (0..=levels as i32).map(|n| {
            let fan = self.fan(exposure, -MALLEOLI_MM - LEVELS_MM * f64::from(n));
            let shadows = fan.edges(AnkleBone::Talus).zip(fan.edges(malleolus));
            let overlap = shadows.map(|(talus, other)| match malleolus {
                AnkleBone::Fibula => other[1] - talus[0],
                _ => talus[1] - other[0],
            });
            overlap.unwrap_or(0.0).max(0.0)
        });
        let mut overlaps: Vec<f64> = overlaps.collect();
        overlaps.sort_by(f64::total_cmp);
        let count = overlaps.len();
        Hidden {
            share: overlaps.iter().filter(|&&mm| mm > 0.0).count() as f64 / count as f64,
            // Not the mean: under a tilted beam a lip of the plafond can reach the highest level and lie over the whole talus.
            median_mm: 0.5 * (overlaps[(count - 1) / 2] + overlaps[count / 2]),
        }
    }
}
