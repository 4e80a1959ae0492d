//! Overlaps and clear spaces of the ankle, as they are measured on radiographs; mm in the plane through the joint.

use nalgebra::Point3;
use serde::Serialize;

use super::bones::AnkleBone;
use super::exposure::Exposure;
use super::gutter::Gap;
use super::joint_space::JointSpace;
use super::rays::Ray;

/// What a radiograph shows of an ankle, mm, free of magnification; `None` where it is not to be seen.
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
    /// The same of the lateral malleolus.
    pub lateral_malleolus_overlap_mm: Option<f64>,
    /// How far the highest place of the trochlea's medial half lies above that of its lateral half, along the columns.
    pub talar_crest_offset_mm: f64,
}

/// Height above the plafond, mm (Harper & Keller, Foot Ankle 1989).
const LEVEL_MM: f64 = 10.0;
/// Depth below the plafond at which malleoli and talus are compared, mm: below the lips of the plafond, above the tips.
const MALLEOLI_MM: f64 = 7.0;
/// How far beside the joint bones are looked for, and in which steps, mm.
const REACH_MM: f64 = 50.0;
const STEP_MM: f64 = 0.2;
/// The incisura is at least so deep between its tubercles, mm.
const LEAST_DEPTH_MM: f64 = 0.3;
/// The beam runs along a gap within this sine, 6 degrees.
const ALONG: f64 = 0.1;

impl JointSpace {
    /// Overlaps and clear spaces in an exposure.
    pub fn overlaps(&self, exposure: &Exposure) -> Overlaps {
        let medial_sign = self.medial_sign(exposure);
        let ends = self.superior.gaps.iter().map(Gap::end);
        let height = |p: Point3<f64>| (p - self.limb.joint).dot(&self.limb.axis);
        let plafond = ends.map(height).sum::<f64>() / self.superior.gaps.len() as f64;
        let fan = |above_mm: f64| {
            let level = self.limb.joint + self.limb.axis.scale(plafond + above_mm);
            let [_, along] = exposure.projected(&level);
            Fan {
                columns: (0..=(2.0 * REACH_MM / STEP_MM) as i32)
                    .map(|n| medial_sign * (f64::from(n) * STEP_MM - REACH_MM))
                    .map(|across| Ray::through(exposure, [across, along], &self.bones))
                    .collect(),
            }
        };
        let (syndesmosis, malleoli) = (fan(LEVEL_MM), fan(-MALLEOLI_MM));
        let inside = |bone: AnkleBone| {
            let body = self.bones.body(bone);
            move |p: &Point3<f64>| self.bones.at(body, p) >= 0.5
        };
        let fibula = syndesmosis.edges(inside(AnkleBone::Fibula));
        let tibia = syndesmosis.edges(inside(AnkleBone::Tibia));
        let incisura = syndesmosis.notch(inside(AnkleBone::Tibia));
        let [medial, lateral, talus] = [AnkleBone::Tibia, AnkleBone::Fibula, AnkleBone::Talus]
            .map(|bone| malleoli.edges(inside(bone)));
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

    /// 1 where `across` points from the fibula to the medial malleolus, else −1.
    fn medial_sign(&self, exposure: &Exposure) -> f64 {
        let mean = |gaps: &[Gap]| {
            let across = gaps.iter().map(|gap| exposure.projected(&gap.foot)[0]);
            across.sum::<f64>() / gaps.len() as f64
        };
        (mean(&self.medial.gaps) - mean(&self.lateral.gaps)).signum()
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

/// The rays of one row of the detector, from lateral to medial.
struct Fan {
    columns: Vec<Ray>,
}

impl Fan {
    /// First and last place of a body's shadow, mm from lateral.
    fn edges(&self, inside: impl Fn(&Point3<f64>) -> bool) -> Option<[f64; 2]> {
        let hit = |ray: &Ray| ray.points().any(|p| inside(&p));
        let first = self.columns.iter().position(hit)?;
        let last = self.columns.iter().rposition(hit)?;
        Some([first, last].map(|n| n as f64 * STEP_MM))
    }

    /// The most medial place of a body's lateral outline between two tubercles, mm from lateral: the line that the floor of
    /// the incisura throws.
    fn notch(&self, inside: impl Fn(&Point3<f64>) -> bool) -> Option<f64> {
        let depths = self.columns.first()?.points().count();
        let mut outline = vec![f64::INFINITY; depths];
        for (n, ray) in self.columns.iter().enumerate() {
            for (edge, p) in outline.iter_mut().zip(ray.points()) {
                if edge.is_infinite() && inside(&p) {
                    *edge = n as f64 * STEP_MM;
                }
            }
        }
        let first = outline.iter().position(|edge| edge.is_finite())?;
        let last = outline.iter().rposition(|edge| edge.is_finite())?;
        let outline = &outline[first..=last];
        // How far the outline falls short of the farther out of what stands in front of and behind it.
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
