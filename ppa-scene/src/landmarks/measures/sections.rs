//! The cross-sections of a limb, measured once and used by all measures.

use nalgebra::{Point3, Vector3};
use ppa_ct::Volume;

use crate::landmarks::choices::LandmarkError;
use crate::landmarks::found::Landmarks;
use crate::landmarks::limb_sections::{BoneSection, Sections};

/// Outline of the thinnest adult tibia, roughly; those of adults measure 300 to 500 mm².
pub(super) const MIN_TIBIA_MM2: f64 = 220.0;

/// A bone is no longer shaft where its outline is this much larger than at its thinnest.
const FLARE: f64 = 1.5;

/// One cross-section of a limb.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct LimbSection {
    /// Distance proximal of the joint along the scan's limb direction, mm.
    pub above_mm: f64,
    pub area_mm2: f64,
    pub centre: Point3<f64>,
    /// Bones, largest first; empty outside the regions, and where they were not searched for.
    pub bones: Vec<BoneSection>,
}

/// Cross-sections from distal to proximal.
pub(super) struct LimbSections(pub Vec<LimbSection>);

impl LimbSections {
    pub fn of(
        volume: &Volume,
        mask: &[bool],
        landmarks: &Landmarks,
    ) -> Result<Self, LandmarkError> {
        /// More sections add nothing about a shaft.
        const MOST_WITH_BONES: usize = 100;
        let direction = Vector3::from(landmarks.scan_direction);
        let mut sections = Sections::along(volume, mask, &direction);
        if sections.direction.dot(&direction) < 1.0 - 1e-9 {
            sections = Sections::across(volume, mask, &direction)?;
        }
        let joint_mm = direction.dot(&Vector3::from(landmarks.joint_centre));
        // The calf is proximal of an ankle and distal of a knee.
        let [joint, calf] = [&landmarks.joint_region, &landmarks.calf_region];
        let from_mm = joint.range_mm[0].min(calf.range_mm[0]);
        let to_mm = joint.range_mm[1].max(calf.range_mm[1]);
        let mut slices = sections.proximal_to_distal();
        slices.reverse();
        let above = |slice: usize| sections.level(slice) - joint_mm;
        let within = |slice: usize| (from_mm..=to_mm).contains(&above(slice));
        let with_bones = slices.iter().filter(|slice| within(**slice)).count();
        let stride = with_bones.div_ceil(MOST_WITH_BONES).max(1);
        let measured = slices.iter().enumerate().filter_map(|(i, &slice)| {
            let (area_mm2, centre) = sections.limb_section(slice)?;
            let bones = match within(slice) && i % stride == 0 {
                true => sections.bones(slice),
                false => Vec::new(),
            };
            Some(LimbSection {
                above_mm: above(slice),
                area_mm2,
                centre,
                bones,
            })
        });
        Ok(Self(measured.collect()))
    }

    /// Sections through the shaft of the largest bone: the longest stretch over which its outline stays
    /// below 1.5 times its smallest; none for fewer than 5 sections, or 30 mm of them.
    pub fn through_shaft(&self) -> Vec<&LimbSection> {
        const FEWEST: usize = 5;
        const SHORTEST_MM: f64 = 30.0;
        let with_bones: Vec<(&LimbSection, f64)> = self
            .0
            .iter()
            .filter_map(|section| {
                let largest = section.bones.first()?;
                (largest.area_mm2 >= MIN_TIBIA_MM2).then_some((section, largest.area_mm2))
            })
            .collect();
        let mut longest = 0..0;
        let mut longest_mm = 0.0;
        for first in 0..with_bones.len() {
            let (mut low, mut high) = (f64::INFINITY, 0.0_f64);
            for last in first..with_bones.len() {
                low = low.min(with_bones[last].1);
                high = high.max(with_bones[last].1);
                if high >= FLARE * low {
                    break;
                }
                let length_mm = with_bones[last].0.above_mm - with_bones[first].0.above_mm;
                if length_mm > longest_mm {
                    (longest, longest_mm) = (first..last + 1, length_mm);
                }
            }
        }
        if longest.len() < FEWEST || longest_mm < SHORTEST_MM {
            return Vec::new();
        }
        with_bones[longest]
            .iter()
            .map(|(section, _)| *section)
            .collect()
    }
}
