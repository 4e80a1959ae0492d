//! The joint level, and the two regions whose centres give the axis.

use nalgebra::Vector3;
use ppa_ct::Volume;

use crate::ankle::{find_ankle, shaft_direction};
use crate::landmark_choices::{LandmarkError, LandmarkOverrides};
use crate::landmark_notes::LandmarkNote;
use crate::landmarks::{AxisRegion, AxisSource, LimbKind};
use crate::limb_sections::Sections;

/// Slices across the tibia: the scan's own, or interpolated ones if it leans by more than 3 degrees.
fn across_the_shaft<'a>(
    volume: &'a Volume,
    mask: &'a [bool],
    towards_proximal: &Vector3<f64>,
) -> Result<Sections<'a>, LandmarkError> {
    const LEAN: f64 = 0.9986; // cos 3°
    const STEEPEST: f64 = 0.82; // cos 35°
    let mut sections = Sections::along(volume, mask, towards_proximal);
    for _ in 0..2 {
        let aslant = shaft_direction(&sections)
            .filter(|shaft| (STEEPEST..LEAN).contains(&shaft.dot(&sections.direction)));
        let Some(shaft) = aslant else { break };
        sections = Sections::across(volume, mask, &shaft)?;
    }
    Ok(sections)
}

/// What region ranges are measured from.
pub(crate) struct Reference<'a> {
    pub(crate) kind: LimbKind,
    pub(crate) sections: Sections<'a>,
    /// Joint level along the scan's limb direction, mm.
    pub(crate) level_mm: f64,
    /// Lowest and highest level with limb in it, from the joint level, mm.
    extent_mm: [f64; 2],
}

impl<'a> Reference<'a> {
    /// Finds the joint level, or takes the middle of the limb.
    pub(crate) fn find(
        volume: &'a Volume,
        mask: &'a [bool],
        overrides: &LandmarkOverrides,
        notes: &mut Vec<LandmarkNote>,
    ) -> Result<Self, LandmarkError> {
        let mut sections = Sections::along(volume, mask, &Vector3::z());
        let mut ankle = None;
        if overrides.limb != Some(LimbKind::Other) {
            for towards_proximal in [Vector3::z(), -Vector3::z()] {
                let tried = across_the_shaft(volume, mask, &towards_proximal)?;
                ankle = find_ankle(&tried);
                if ankle.is_some() {
                    sections = tried;
                    break;
                }
            }
        }
        let slices = sections.proximal_to_distal();
        let level = |slice: Option<&usize>| slice.map_or(0.0, |s| sections.level(*s));
        let (high, low) = (level(slices.first()), level(slices.last()));
        let (kind, level_mm) = match (overrides.joint_centre, ankle, overrides.limb) {
            (Some(centre), ankle, limb) => {
                let guess = ankle.map_or(LimbKind::Other, |_| LimbKind::LowerLeg);
                let level = sections.direction.dot(&Vector3::from(centre));
                notes.extend(ankle.map(|ankle| ankle.note(level)));
                (limb.unwrap_or(guess), level)
            }
            (None, Some(ankle), _) => {
                notes.push(ankle.note(ankle.level_mm));
                (LimbKind::LowerLeg, ankle.level_mm)
            }
            (None, None, Some(LimbKind::LowerLeg)) => return Err(LandmarkError::NoAnkle),
            (None, None, _) => (LimbKind::Other, 0.5 * (low + high)),
        };
        Ok(Self {
            kind,
            sections,
            level_mm,
            extent_mm: [low - level_mm, high - level_mm],
        })
    }

    /// The joint region, the calf region and what their centres are centres of.
    pub(crate) fn regions(
        &self,
        overrides: &LandmarkOverrides,
    ) -> Result<(AxisRegion, AxisRegion, AxisSource), LandmarkError> {
        let (joint, calf) = self.default_ranges(overrides)?;
        if calf[0] < joint[1] {
            return Err(LandmarkError::Region {
                name: "calf region",
                from_mm: calf[0],
                to_mm: calf[1],
                problem: "does not lie proximal of the joint region",
            });
        }
        let wanted = overrides.axis_source.unwrap_or(match self.kind {
            LimbKind::LowerLeg => AxisSource::Bone,
            LimbKind::Other => AxisSource::Limb,
        });
        let both = |source| {
            let joint = self.centre("joint region", joint, source)?;
            let calf = self.centre("calf region", calf, source)?;
            Ok((joint, calf, source))
        };
        match (both(wanted), overrides.axis_source) {
            (Err(_), None) if wanted == AxisSource::Bone => both(AxisSource::Limb),
            (found, _) => found,
        }
    }

    fn default_ranges(
        &self,
        overrides: &LandmarkOverrides,
    ) -> Result<([f64; 2], [f64; 2]), LandmarkError> {
        // Below 50 mm tibia and fibula can touch: the syndesmosis is thinner than two voxels.
        const JOINT_MM: [f64; 2] = [50.0, 90.0];
        const CALF_MM: [f64; 2] = [130.0, 200.0];
        const SHORTEST_MM: f64 = 60.0;
        let (joint, calf) = match self.kind {
            LimbKind::LowerLeg => {
                let reach = self.extent_mm[1];
                let given = overrides.joint_region.is_some() && overrides.calf_region.is_some();
                if reach < SHORTEST_MM && !given {
                    return Err(LandmarkError::TooShort {
                        found_mm: reach,
                        expected_mm: SHORTEST_MM,
                    });
                }
                let scale = (reach / CALF_MM[1]).min(1.0);
                (JOINT_MM.map(|d| d * scale), CALF_MM.map(|d| d * scale))
            }
            LimbKind::Other => {
                let [low, high] = self.extent_mm;
                let at = |share: f64| low + share * (high - low);
                ([at(0.15), at(0.35)], [at(0.65), at(0.85)])
            }
        };
        Ok((
            overrides.joint_region.unwrap_or(joint),
            overrides.calf_region.unwrap_or(calf),
        ))
    }

    fn centre(
        &self,
        name: &'static str,
        range_mm: [f64; 2],
        source: AxisSource,
    ) -> Result<AxisRegion, LandmarkError> {
        let [from_mm, to_mm] = range_mm;
        let (mut sum, mut count) = (Vector3::zeros(), 0_u32);
        for slice in 0..self.sections.count() {
            let above = self.sections.level(slice) - self.level_mm;
            // A level that went through a file and back may have lost its last bit.
            let there = (from_mm - 1e-6..=to_mm + 1e-6).contains(&above);
            if !there || !self.sections.is_whole(slice) {
                continue;
            }
            let centre = match source {
                AxisSource::Limb => self.sections.limb_centre(slice),
                AxisSource::Bone => self.sections.bones(slice).first().map(|b| b.centre),
            };
            if let Some(centre) = centre {
                sum += centre.coords;
                count += 1;
            }
        }
        if count == 0 {
            return Err(LandmarkError::Region {
                name,
                from_mm,
                to_mm,
                problem: match source {
                    AxisSource::Limb => "holds no part of the limb",
                    AxisSource::Bone => "holds no bone",
                },
            });
        }
        Ok(AxisRegion {
            range_mm,
            centre_mm: (sum / f64::from(count)).into(),
        })
    }
}
