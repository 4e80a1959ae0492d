//! The joint level, and the two regions whose centres give the axis.

use nalgebra::{Point3, Vector3};
use ppa_ct::Volume;

use crate::joints::{Joints, joint_notes, kind_of_limb};
use crate::knee::Knee;
use crate::knee_regions::knee_ranges;
use crate::landmark_choices::{LandmarkError, LandmarkOverrides};
use crate::landmarks::{AxisRegion, AxisSource, FoundJoint, LimbKind};
use crate::limb_sections::Sections;

const REVERSED: &str =
    "the joint lies superior to the calf, or the thigh inferior to it: proximal is inferior";

/// What region ranges are measured from.
pub(crate) struct Reference<'a> {
    pub(crate) kind: LimbKind,
    pub(crate) sections: Sections<'a>,
    /// Joint level along the scan's limb direction, mm.
    pub(crate) level_mm: f64,
    /// The knee of a limb that is posed about it.
    pub(crate) knee: Option<Knee>,
    /// Bone centres of such a limb, from proximal to distal.
    bones: Vec<Point3<f64>>,
    /// Every joint that was found.
    pub(crate) joints: Vec<FoundJoint>,
    /// Lowest and highest level with limb in it, from the joint level, mm.
    extent_mm: [f64; 2],
}

impl<'a> Reference<'a> {
    /// Finds the joint level, or takes the middle of a limb that was said to be another one.
    pub(crate) fn find(
        volume: &'a Volume,
        mask: &'a [bool],
        overrides: &LandmarkOverrides,
        notes: &mut Vec<String>,
    ) -> Result<Self, LandmarkError> {
        let joints = match overrides.limb {
            Some(LimbKind::Other) => Joints::none(),
            _ => Joints::find(volume, mask)?,
        };
        let found = joints.found();
        let kind = kind_of_limb(overrides, &found)?;
        if joints.is_reversed {
            notes.push(REVERSED.into());
        }
        let mut bones = Vec::new();
        let (shown, knee) = match kind {
            LimbKind::LowerLeg => (joints.ankle.map(|(s, ankle)| (s, ankle.level_mm)), None),
            LimbKind::Knee => {
                let knee = joints.knee.as_ref().map(|found| found.knee);
                let shown = joints.knee.map(|found| {
                    bones = found.bones;
                    let level = found.sections.direction.dot(&found.knee.centre.coords);
                    (found.sections, level)
                });
                (shown, knee)
            }
            LimbKind::Other => (None, None),
        };
        let (sections, joint_mm) = match shown {
            Some((sections, level)) => (sections, Some(level)),
            None => (Sections::along(volume, mask, &Vector3::z()), None),
        };
        let slices = sections.proximal_to_distal();
        let levels: Vec<f64> = match bones.is_empty() {
            true => slices.iter().map(|slice| sections.level(*slice)).collect(),
            false => bones
                .iter()
                .map(|bone| sections.direction.dot(&bone.coords))
                .collect(),
        };
        let (high, low) = (
            levels.first().copied().unwrap_or(0.0),
            levels.last().copied().unwrap_or(0.0),
        );
        let given = overrides.joint_centre.map(Vector3::from);
        let level_mm = match (given, joint_mm) {
            (Some(centre), _) => sections.direction.dot(&centre),
            (None, Some(level)) => level,
            (None, None) => 0.5 * (low + high),
        };
        notes.extend(joint_notes(kind, given.is_some(), &found));
        Ok(Self {
            kind,
            sections,
            level_mm,
            knee,
            bones,
            joints: found,
            extent_mm: [low - level_mm, high - level_mm],
        })
    }

    /// The joint region, the calf region and what their centres are centres of.
    pub(crate) fn regions(
        &self,
        overrides: &LandmarkOverrides,
        notes: &mut Vec<String>,
    ) -> Result<(AxisRegion, AxisRegion, AxisSource), LandmarkError> {
        let (joint, calf) = self.default_ranges(overrides, notes)?;
        let may_be_distal = self.kind == LimbKind::Knee;
        if calf[0] < joint[1] && !(may_be_distal && calf[1] <= joint[0]) {
            return Err(LandmarkError::Region {
                name: "calf region",
                from_mm: calf[0],
                to_mm: calf[1],
                problem: match may_be_distal {
                    true => "overlaps the joint region",
                    false => "does not lie proximal of the joint region",
                },
            });
        }
        let wanted = overrides.axis_source.unwrap_or(match self.kind {
            LimbKind::LowerLeg | LimbKind::Knee => AxisSource::Bone,
            LimbKind::Other => AxisSource::Limb,
        });
        let both = |source| {
            let joint = self.centre("joint region", joint, source)?;
            let calf = self.centre("calf region", calf, source)?;
            Ok((joint, calf, source))
        };
        match (both(wanted), overrides.axis_source) {
            (Err(_), None) if wanted == AxisSource::Bone => {
                notes.push("axis: no bone in the regions, centres of the limb instead".into());
                both(AxisSource::Limb)
            }
            (found, _) => found,
        }
    }

    fn default_ranges(
        &self,
        overrides: &LandmarkOverrides,
        notes: &mut Vec<String>,
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
                if scale < 1.0 && !given {
                    notes.push(format!(
                        "axis regions: drawn closer together, the scan reaches {reach:.0} mm \
                         proximal of the joint"
                    ));
                }
                (JOINT_MM.map(|d| d * scale), CALF_MM.map(|d| d * scale))
            }
            LimbKind::Knee => match (overrides.joint_region, overrides.calf_region) {
                (Some(joint), Some(calf)) => (joint, calf),
                _ => {
                    let [joint, calf] = knee_ranges(self.extent_mm)?;
                    notes.push(format!(
                        "axis: {}",
                        match (joint[1] <= 0.0, calf[1] <= 0.0) {
                            (true, true) => "along the tibia's shaft",
                            (false, false) => {
                                "along the femur's shaft, which leans from the leg's long axis by about 6 \
                                 degrees: the scan shows too little of the tibia"
                            }
                            _ => "through tibia and femur: the scan shows too little of either shaft",
                        }
                    ));
                    (joint, calf)
                }
            },
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
        // A level that went through a file and back may have lost its last bit.
        let there = |level: f64| (from_mm - 1e-6..=to_mm + 1e-6).contains(&(level - self.level_mm));
        let (mut sum, mut count) = (Vector3::zeros(), 0_u32);
        if source == AxisSource::Bone && !self.bones.is_empty() {
            let level = |bone: &Point3<f64>| self.sections.direction.dot(&bone.coords);
            for bone in self.bones.iter().filter(|bone| there(level(bone))) {
                sum += bone.coords;
                count += 1;
            }
            return region(name, range_mm, source, sum, count);
        }
        for slice in 0..self.sections.count() {
            if !there(self.sections.level(slice)) || !self.sections.is_whole(slice) {
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
        region(name, range_mm, source, sum, count)
    }
}

/// The mean of `count` centres with this sum.
fn region(
    name: &'static str,
    range_mm: [f64; 2],
    source: AxisSource,
    sum: Vector3<f64>,
    count: u32,
) -> Result<AxisRegion, LandmarkError> {
    let [from_mm, to_mm] = range_mm;
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
