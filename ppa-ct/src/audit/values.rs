//! Checks that the values are Hounsfield units, unclipped, and those of a limb.

use ppa_core::text::{count, number};

use super::Measures;
use super::findings::{Finding, FindingCode, Severity};
use super::histogram::Histogram;
use crate::acquisition::Acquisition;

/// Lower limit of bone.
pub(super) const BONE_HU: f32 = 300.0;
/// Lower limit of metal: cortical bone stays below 2200 HU; enamel, about 3000 HU, does not occur in limbs.
pub(super) const METAL_HU: f32 = 2500.0;
/// Smallest volume reported as metal rather than noise, cm³.
const LEAST_METAL_CM3: f64 = 0.05;
/// Largest distance of the air peak from −1000 HU in a calibrated scanner.
const AIR_SLACK_HU: f64 = 60.0;
/// Smallest share of the voxels that counts as a peak.
const LEAST_SHARE: f64 = 0.005;

/// Peaks of air and soft tissue.
pub(super) struct Peaks {
    pub air_hu: Option<f64>,
    pub tissue_hu: Option<f64>,
    /// Peaks of air and tissue in a histogram that looks like one in HU, but is shifted.
    shifted: Option<[f64; 2]>,
}

pub(super) fn peaks(histogram: &Histogram) -> Peaks {
    let air = histogram.peak(-1150.0, -850.0, LEAST_SHARE);
    let tissue = histogram.peak(-300.0, 400.0, LEAST_SHARE);
    Peaks {
        air_hu: air,
        tissue_hu: tissue,
        shifted: if air.is_some() {
            None
        } else {
            shifted(histogram)
        },
    }
}

/// Finds two peaks as far apart as air and tissue, the lower one at the bottom of the range.
fn shifted(histogram: &Histogram) -> Option<[f64; 2]> {
    let lowest = histogram.quantile(0.02) as f32;
    let air = histogram.peak(lowest - 50.0, lowest + 150.0, 0.05)?;
    let expected = air as f32 + 1000.0;
    let tissue = histogram.peak(expected - 160.0, expected + 150.0, 0.02)?;
    Some([air, tissue])
}

/// Checks the values for bone, clipping, padding and metal.
pub(super) fn check(
    histogram: &Histogram,
    peaks: &Peaks,
    measures: &Measures,
    acquisition: &Acquisition,
) -> Vec<Finding> {
    let mut found = Vec::new();
    let tissue = histogram.above(-200.0);
    if peaks.tissue_hu.is_some() && (histogram.above(BONE_HU) as f64) < 0.002 * tissue as f64 {
        found.push(Finding::new(
            FindingCode::NoBone,
            Severity::Caution,
            format!(
                "only {:.1} cm³ above {BONE_HU} HU: hardly any bone",
                measures.bone_cm3
            ),
        ));
    }
    found.extend(clipping(histogram, acquisition));
    let below = histogram.between(f32::MIN, -1200.0) as f64 / histogram.total as f64;
    if below > 0.01 {
        found.push(Finding::new(
            FindingCode::BelowAir,
            Severity::Note,
            format!(
                "{:.0} % of the voxels lie below -1200 HU, down to {}: padding around the field of view",
                100.0 * below,
                histogram.min
            ),
        ));
    }
    if measures.metal_cm3 > LEAST_METAL_CM3 {
        found.push(Finding::new(
            FindingCode::Metal,
            Severity::Caution,
            format!("{:.2} cm³ above {METAL_HU} HU: metal", measures.metal_cm3),
        ));
    }
    found
}

/// Checks whether air and tissue have their expected values.
pub(super) fn scale(peaks: &Peaks) -> Vec<Finding> {
    use FindingCode::{AirOffScale, NoAir, NoTissue, ShiftedValues, TissueOffScale};
    if let Some([air, tissue]) = peaks.shifted {
        let text = format!(
            "air seems to lie at {:.0} and tissue at {:.0}: all values are about {:.0} too high",
            number(air),
            number(tissue),
            number(air + 1000.0)
        );
        return vec![Finding::new(ShiftedValues, Severity::Severe, text)];
    }
    let mut found = Vec::new();
    match peaks.air_hu {
        None => found.push(Finding::new(
            NoAir,
            Severity::Severe,
            "no air near -1000 HU".to_owned(),
        )),
        Some(air) if (air + 1000.0).abs() > AIR_SLACK_HU => found.push(Finding::new(
            AirOffScale,
            Severity::Caution,
            format!("air lies at {air:.0} HU, expected -1000"),
        )),
        Some(_) => {}
    }
    match peaks.tissue_hu {
        None => found.push(Finding::new(
            NoTissue,
            Severity::Severe,
            "no soft tissue from -300 to 400 HU".to_owned(),
        )),
        // Fat, then water to muscle with contrast agent.
        Some(hu) if !((-140.0..=-40.0).contains(&hu) || (-20.0..=120.0).contains(&hu)) => found
            .push(Finding::new(
                TissueOffScale,
                Severity::Caution,
                format!("soft tissue lies at {hu:.0} HU, expected fat near -100 or muscle near 50"),
            )),
        Some(_) => {}
    }
    found
}

/// Finds more voxels at the ends of the range than expected by chance.
fn clipping(histogram: &Histogram, acquisition: &Acquisition) -> Vec<Finding> {
    let mut found = Vec::new();
    let (min, max) = (histogram.min, histogram.max);
    let at_limit = acquisition
        .representable_hu
        .is_some_and(|[_, high]| f64::from(max) > high - 0.5);
    let tail = histogram.near_max as f64 / 10.0;
    let piled_up = histogram.at_max >= 20 && histogram.at_max as f64 > 5.0 * tail;
    // Clipping below bone loses nothing that a radiograph would show.
    if max > BONE_HU && (at_limit || piled_up) {
        found.push(Finding::new(
            FindingCode::ClippedAbove,
            Severity::Caution,
            format!(
                "exactly the highest value, {max} HU, in {}: clipped",
                count(histogram.at_max, "voxel")
            ),
        ));
    }
    let share = histogram.at_min as f64 / histogram.total as f64;
    if (-940.0..-200.0).contains(&min) && share > 0.01 {
        found.push(Finding::new(
            FindingCode::ClippedBelow,
            Severity::Caution,
            format!(
                "{:.0} % of the voxels have exactly the lowest value, {min} HU: clipped",
                100.0 * share
            ),
        ));
    }
    found
}
