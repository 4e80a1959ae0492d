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

/// A region that is left open ends or begins this far from the one that is given, at least, mm.
const APART_MM: f64 = 10.0;

/// The calf region, moved so that it begins beyond a joint region that is given, and ends with the limb.
fn proximal_of(joint_ends: f64, [from, to]: [f64; 2], limb_ends: f64) -> [f64; 2] {
    let moved = (joint_ends + APART_MM - from).max(0.0);
    if moved == 0.0 {
        return [from, to];
    }
    [from + moved, (to + moved).min(limb_ends).max(from + moved)]
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
            LimbKind::Other => {
                let [low, high] = self.extent_mm;
                let at = |share: f64| low + share * (high - low);
                ([at(0.15), at(0.35)], [at(0.65), at(0.85)])
            }
        };
        // A region that is left open makes room for the one that is given.
        Ok(match (overrides.joint_region, overrides.calf_region) {
            (None, None) => (joint, calf),
            (Some(joint), Some(calf)) => (joint, calf),
            (Some(joint), None) => (joint, proximal_of(joint[1], calf, self.extent_mm[1])),
            (None, Some(calf)) => (self.distal_of(calf[0], joint), calf),
        })
    }

    /// The joint region, moved or drawn together so that it ends before a calf region that is given.
    fn distal_of(&self, calf_begins: f64, [from, to]: [f64; 2]) -> [f64; 2] {
        // Drawn together any further, both regions would lie in the joint.
        const LEAST_SCALE: f64 = 0.3;
        let scale = (calf_begins - APART_MM) / to;
        match self.kind {
            _ if to + APART_MM <= calf_begins => [from, to],
            LimbKind::LowerLeg if scale >= LEAST_SCALE => [from * scale, to * scale],
            LimbKind::LowerLeg => [from, to],
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
        let (mut sum, mut count) = (Vector3::zeros(), 0_u32);
        for slice in 0..self.sections.count() {
            let above = self.sections.level(slice) - self.level_mm;
            // A level that went through a file and back may have lost its last bit.
            let there = (from_mm - 1e-6..=to_mm + 1e-6).contains(&above);
            if !there || !self.sections.is_whole(slice) {
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
        if count == 0 {
            return Err(LandmarkError::Region {
                name,
                from_mm,
                to_mm,
                problem: match source {
                    AxisSource::Bone => "holds no bone",
                    AxisSource::Limb | AxisSource::Given => "holds no part of the limb",
                },
            });
        }
        Ok(AxisRegion {
            range_mm,
            centre_mm: (sum / f64::from(count)).into(),
        })
    }
}
