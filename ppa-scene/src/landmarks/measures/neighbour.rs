//! Traces that a part of another limb leaves in the cross-sections of a limb.

use super::sections::{LimbSection, LimbSections, MIN_TIBIA_MM2};

/// Possible traces of another limb attached to this one, along the shaft of its largest bone.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Neighbour {
    /// Largest change of the cross-section from one place to another 3 mm along the limb, percent per mm.
    pub jump_percent_per_mm: f64,
    /// Middle of the cross-section where that begins, `ct` frame, mm.
    pub jump_centre_mm: [f64; 3],
    /// A bone like a tibia far from the largest bone, `ct` frame, mm.
    pub far_bone_mm: Option<[f64; 3]>,
}

/// Cross-sections are compared over this length, mm: noise of a single thin slice is not a jump.
const OVER_MM: f64 = 3.0;

/// The tibiae of two legs are at least this far apart, mm; the condyles of one femur are about 50.
const FAR_MM: f64 = 70.0;

impl Neighbour {
    /// `None` where no shaft is seen.
    pub(super) fn of(sections: &LimbSections) -> Option<Self> {
        // A foot or a hand changes its cross-section as fast as a sliver does.
        let shaft = sections.through_shaft();
        let (first, last) = (shaft.first()?.above_mm, shaft.last()?.above_mm);
        let sections: Vec<&LimbSection> = sections
            .0
            .iter()
            .filter(|section| (first..=last).contains(&section.above_mm))
            .collect();
        let mut jump: Option<(f64, &LimbSection)> = None;
        for (i, from) in sections.iter().enumerate() {
            let to = sections[i..]
                .iter()
                .find(|to| to.above_mm - from.above_mm >= OVER_MM);
            let Some(to) = to else { break };
            let change = (to.area_mm2 - from.area_mm2).abs() / from.area_mm2.min(to.area_mm2);
            let percent_per_mm = 100.0 * change / (to.above_mm - from.above_mm);
            if jump.is_none_or(|(most, _)| percent_per_mm > most) {
                jump = Some((percent_per_mm, from));
            }
        }
        let (jump_percent_per_mm, section) = jump?;
        Some(Self {
            jump_percent_per_mm,
            jump_centre_mm: section.centre.coords.into(),
            far_bone_mm: far_bone(&sections),
        })
    }
}

/// A thick bone far from the thickest one that at least three cross-sections show.
fn far_bone(sections: &[&LimbSection]) -> Option<[f64; 3]> {
    const FEWEST: usize = 3;
    let far: Vec<_> = sections
        .iter()
        .filter_map(|section| {
            let (largest, others) = section.bones.split_first()?;
            others.iter().find(|bone| {
                bone.area_mm2 >= MIN_TIBIA_MM2 && (bone.centre - largest.centre).norm() > FAR_MM
            })
        })
        .collect();
    (far.len() >= FEWEST).then(|| far[far.len() / 2].centre.coords.into())
}

#[cfg(test)]
mod tests {
    use nalgebra::Point3;

    use super::*;
    use crate::landmarks::limb_sections::BoneSection;

    fn bone(x: f64, area_mm2: f64) -> BoneSection {
        BoneSection {
            area_mm2,
            centre: Point3::new(x, 0.0, 0.0),
        }
    }

    /// Sections 1 mm apart with a tibia and, from 40 mm on, what the leg gains there.
    fn neighbour(gained_mm2: f64, bones: &[BoneSection]) -> Neighbour {
        let section = |mm: u32| {
            let grown = if mm < 40 { 0.0 } else { gained_mm2 };
            LimbSection {
                above_mm: f64::from(mm),
                area_mm2: 7000.0 + 20.0 * f64::from(mm) + grown,
                centre: Point3::new(0.0, 0.0, f64::from(mm)),
                bones: bones.to_vec(),
            }
        };
        Neighbour::of(&LimbSections((0..80).map(section).collect())).unwrap()
    }

    #[test]
    fn a_sliver_makes_the_section_jump() {
        let tibia = [bone(0.0, 400.0), bone(30.0, 120.0)];
        let plain = neighbour(0.0, &tibia);
        assert!((plain.jump_percent_per_mm - 100.0 * 60.0 / 7000.0 / 3.0).abs() < 1e-9);
        let sliver = neighbour(900.0, &tibia);
        assert!(sliver.jump_percent_per_mm > 3.0, "{sliver:?}");
        assert!(
            (36.0..=40.0).contains(&sliver.jump_centre_mm[2]),
            "{sliver:?}"
        );
        assert_eq!(sliver.far_bone_mm, None);
    }

    #[test]
    fn a_second_tibia_is_another_leg() {
        let two = neighbour(
            0.0,
            &[bone(0.0, 400.0), bone(110.0, 390.0), bone(30.0, 120.0)],
        );
        assert_eq!(two.far_bone_mm, Some([110.0, 0.0, 0.0]));
        let condyles = neighbour(0.0, &[bone(0.0, 900.0), bone(52.0, 850.0)]);
        assert_eq!(condyles.far_bone_mm, None);
    }
}
