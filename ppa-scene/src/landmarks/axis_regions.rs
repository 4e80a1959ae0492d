//! The joint level, and the two regions whose centres give the axis.

use nalgebra::{Point3, Vector3};
use ppa_ct::Volume;

use crate::landmarks::choices::{LandmarkError, LandmarkOverrides};
use crate::landmarks::found::{AxisRegion, AxisSource, FoundJoint};
use crate::landmarks::joints::{Joints, joint_notes, kind_of_limb};
use crate::landmarks::knee::Knee;
use crate::landmarks::knee_regions::knee_ranges;
use crate::landmarks::limb_kind::LimbKind;
use crate::landmarks::limb_sections::Sections;
use crate::landmarks::notes::LandmarkNote;

/// Smallest distance of an automatic region from a given one, mm.
const APART_MM: f64 = 10.0;

/// The calf region, moved so that it begins beyond a given joint region, and ends with the limb.
fn proximal_of(joint_ends: f64, [from, to]: [f64; 2], limb_ends: f64) -> [f64; 2] {
    let moved = (joint_ends + APART_MM - from).max(0.0);
    if moved == 0.0 {
        return [from, to];
    }
    [from + moved, (to + moved).min(limb_ends).max(from + moved)]
}

/// Reference from which region ranges are measured.
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
    /// Finds the joint level, or takes the middle of a limb given as another kind.
    pub(crate) fn find(
        volume: &'a Volume,
        mask: &'a [bool],
        overrides: &LandmarkOverrides,
        notes: &mut Vec<LandmarkNote>,
    ) -> Result<Self, LandmarkError> {
        let joints = match overrides.limb {
            Some(LimbKind::Other) => Joints::none(),
            _ => Joints::find(volume, mask)?,
        };
        let found = joints.found();
        let kind = kind_of_limb(overrides, &found)?;
        let ankle = joints.ankle.as_ref().map(|(_, ankle)| *ankle);
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
        notes.extend(joint_notes(kind, &found));
        if kind == LimbKind::LowerLeg {
            notes.extend(ankle.map(|ankle| ankle.note(level_mm)));
        }
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

    /// The joint region, the calf region and the source of their centres.
    pub(crate) fn regions(
        &self,
        overrides: &LandmarkOverrides,
    ) -> Result<(AxisRegion, AxisRegion, AxisSource), LandmarkError> {
        let (joint, calf) = self.default_ranges(overrides)?;
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
            (Err(_), None) if wanted == AxisSource::Bone => both(AxisSource::Limb),
            (found, _) => found,
        }
    }

    /// Two points of a given axis as regions of no length, the distal one first.
    pub(crate) fn given_axis(
        &self,
        points: [[f64; 3]; 2],
    ) -> Result<(AxisRegion, AxisRegion), LandmarkError> {
        const LEAST_APART_MM: f64 = 10.0;
        let refused = |expected| LandmarkError::Axis {
            from: points[0],
            to: points[1],
            expected,
        };
        let [from, to] = points.map(Vector3::from);
        let length = (to - from).norm();
        if length < LEAST_APART_MM {
            return Err(refused("two points at least 10 mm apart"));
        }
        let rise = self.sections.direction.dot(&(to - from));
        if rise.abs() < length * std::f64::consts::FRAC_1_SQRT_2 {
            return Err(refused(
                "a line within 45 degrees of the scan's limb direction",
            ));
        }
        let region = |point: Vector3<f64>| AxisRegion {
            range_mm: [self.sections.direction.dot(&point) - self.level_mm; 2],
            centre_mm: point.into(),
        };
        let (low, high) = if rise > 0.0 { (from, to) } else { (to, from) };
        Ok((region(low), region(high)))
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
            LimbKind::Knee => match (overrides.joint_region, overrides.calf_region) {
                (Some(joint), Some(calf)) => (joint, calf),
                (joint, calf) => {
                    let [near, far] = knee_ranges(self.extent_mm)?;
                    return Ok((joint.unwrap_or(near), calf.unwrap_or(far)));
                }
            },
            LimbKind::Other => {
                let [low, high] = self.extent_mm;
                let at = |share: f64| low + share * (high - low);
                ([at(0.15), at(0.35)], [at(0.65), at(0.85)])
            }
        };
        // An automatic region makes room for a given one.
        Ok(match (overrides.joint_region, overrides.calf_region) {
            (None, None) => (joint, calf),
            (Some(joint), Some(calf)) => (joint, calf),
            (Some(joint), None) => (joint, proximal_of(joint[1], calf, self.extent_mm[1])),
            (None, Some(calf)) => (self.distal_of(calf[0], joint), calf),
        })
    }

    /// The joint region, moved or shortened so that it ends before a given calf region.
    fn distal_of(&self, calf_begins: f64, [from, to]: [f64; 2]) -> [f64; 2] {
        // Shortened any further, both regions would be in the joint.
        const LEAST_SCALE: f64 = 0.3;
        let scale = (calf_begins - APART_MM) / to;
        match self.kind {
            _ if to + APART_MM <= calf_begins => [from, to],
            LimbKind::LowerLeg if scale >= LEAST_SCALE => [from * scale, to * scale],
            LimbKind::LowerLeg | LimbKind::Knee => [from, to],
            LimbKind::Other => {
                let end = calf_begins - APART_MM;
                [(end - (to - from)).max(self.extent_mm[0]), end]
            }
        }
    }

    fn centre(
        &self,
        name: &'static str,
        range_mm: [f64; 2],
        source: AxisSource,
    ) -> Result<AxisRegion, LandmarkError> {
        let [from_mm, to_mm] = range_mm;
        // A level read back from a file may have lost its last bit.
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
                AxisSource::Bone => self.sections.bones(slice).first().map(|b| b.centre),
                AxisSource::Limb | AxisSource::Given => self.sections.limb_centre(slice),
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
                AxisSource::Limb | AxisSource::Given => "holds no part of the limb",
                AxisSource::Bone => "holds no bone",
            },
        });
    }
    Ok(AxisRegion {
        range_mm,
        centre_mm: (sum / f64::from(count)).into(),
    })
}
