//! Overlaps and clear spaces of the ankle as measured on radiographs; mm in the plane through the joint.

use serde::Serialize;

use super::bones::AnkleBone;
use super::exposure::Exposure;
use super::fan::MALLEOLI_MM;
use super::gutter::Gap;
use super::joint_space::JointSpace;

/// Measures of an ankle in a radiograph, mm, free of magnification; `None` if not visible.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Overlaps {
    /// Tibiofibular overlap 1 cm above the plafond: from the lateral edge of the tibia's anterior tubercle to the medial edge of
    /// the fibula; below 0 where they are apart.
    pub tibiofibular_overlap_mm: Option<f64>,
    /// Tibiofibular clear space 1 cm above the plafond: from the medial edge of the fibula to the floor of the incisura.
    pub tibiofibular_clear_space_mm: Option<f64>,
    /// Width of the medial gutter where the beam runs along it.
    pub medial_clear_space_mm: Option<f64>,
    /// Width of the superior gutter where the beam runs along it.
    pub superior_clear_space_mm: Option<f64>,
    /// How far the medial malleolus covers the talus 7 mm below the plafond; below 0 where they are apart.
    pub medial_malleolus_overlap_mm: Option<f64>,
    /// The same for the lateral malleolus.
    pub lateral_malleolus_overlap_mm: Option<f64>,
    /// Height of the highest point of the trochlea's medial half above that of its lateral half, along the columns.
    pub talar_crest_offset_mm: f64,
}

/// Height above the plafond, mm (Harper & Keller, Foot Ankle 1989).
const LEVEL_MM: f64 = 10.0;
/// Sine of the largest angle at which the beam counts as along a gap, 6 degrees.
const ALONG: f64 = 0.1;

impl JointSpace {
    /// Overlaps and clear spaces in an exposure.
    pub fn overlaps(&self, exposure: &Exposure) -> Overlaps {
        let medial_sign = self.medial_sign(exposure);
        let (syndesmosis, malleoli) = (
            self.fan(exposure, LEVEL_MM),
            self.fan(exposure, -MALLEOLI_MM),
        );
        let fibula = syndesmosis.edges(AnkleBone::Fibula);
        let tibia = syndesmosis.edges(AnkleBone::Tibia);
        let incisura = syndesmosis.notch(AnkleBone::Tibia);
        let [medial, lateral, talus] = [AnkleBone::Tibia, AnkleBone::Fibula, AnkleBone::Talus]
            .map(|bone| malleoli.edges(bone));
        Overlaps {
            tibiofibular_overlap_mm: fibula.zip(tibia).map(|(f, t)| f[1] - t[0]),
            tibiofibular_clear_space_mm: fibula.zip(incisura).map(|(f, floor)| floor - f[1]),
            medial_clear_space_mm: seen_width_mm(&self.medial.gaps, exposure),
            superior_clear_space_mm: seen_width_mm(&self.superior.gaps, exposure),
            medial_malleolus_overlap_mm: talus.zip(medial).map(|(t, m)| t[1] - m[0]),
            lateral_malleolus_overlap_mm: talus.zip(lateral).map(|(t, l)| l[1] - t[0]),
            talar_crest_offset_mm: self.crest_offset_mm(exposure, medial_sign),
        }
    }

    fn crest_offset_mm(&self, exposure: &Exposure, medial_sign: f64) -> f64 {
        let up = exposure.along.dot(&self.limb.axis).signum();
        let feet = self.superior.gaps.iter();
        let mut seen: Vec<[f64; 2]> = feet
            .map(|gap| exposure.projected(&gap.foot))
            .map(|[across, along]| [medial_sign * across, up * along])
            .collect();
        seen.sort_by(|a, b| a[0].total_cmp(&b[0]));
        let highest = |half: &[[f64; 2]]| {
            let heights = half.iter().map(|[_, height]| *height);
            heights.fold(f64::NEG_INFINITY, f64::max)
        };
        let (lateral, medial) = seen.split_at(seen.len() / 2);
        match lateral {
            [] => 0.0,
            _ => highest(medial) - highest(lateral),
        }
    }
}

/// Mean projected width of the gaps along which the beam runs.
fn seen_width_mm(gaps: &[Gap], exposure: &Exposure) -> Option<f64> {
    let widths: Vec<f64> = gaps
        .iter()
        .filter(|gap| exposure.ray_to(&gap.foot).dot(&gap.across).abs() < ALONG)
        .map(|gap| {
            let [a, b] = [gap.foot, gap.end()].map(|p| exposure.projected(&p));
            (b[0] - a[0]).hypot(b[1] - a[1])
        })
        .collect();
    (!widths.is_empty()).then(|| widths.iter().sum::<f64>() / widths.len() as f64)
}
