//! Joints that a limb shows: ankle, knee, or both.

use nalgebra::Vector3;
use ppa_ct::Volume;

use crate::landmarks::ankle::{Ankle, find_ankle, shaft_direction};
use crate::landmarks::bone_spans::{Lengthwise, broad_zones, spans};
use crate::landmarks::choices::{LandmarkError, LandmarkOverrides};
use crate::landmarks::found::{FoundJoint, KneeLines};
use crate::landmarks::knee::{FoundKnee, Knee, find_knee};
use crate::landmarks::limb_kind::{Joint, LimbKind};
use crate::landmarks::limb_sections::Sections;
use crate::landmarks::notes::LandmarkNote;

/// Joints found, each with slices across its shaft.
pub(crate) struct Joints<'a> {
    pub(crate) ankle: Option<(Sections<'a>, Ankle)>,
    pub(crate) knee: Option<FoundKnee<'a>>,
}

impl<'a> Joints<'a> {
    /// Looks for both joints, first with proximal superior, then the other way round if neither is found.
    ///
    /// Upside down, a knee looks like an ankle to the search along the tibia, so anything found at the gap of a knee
    /// is not an ankle.
    pub(crate) fn find(volume: &'a Volume, mask: &'a [bool]) -> Result<Self, LandmarkError> {
        let up = Vector3::z();
        for (towards_proximal, is_reversed) in [(up, false), (-up, true)] {
            let knee = find_knee(volume, mask, &towards_proximal)?;
            let sections = across_the_shaft(volume, mask, &towards_proximal)?;
            let is_knee =
                |ankle: &Ankle| knee.as_ref().is_some_and(|found| is_at(ankle, &found.knee));
            let is_upside_down_knee =
                |ankle: &Ankle| is_reversed && is_amid_broad_bone(volume, &sections, ankle);
            let ankle = find_ankle(&sections)
                .filter(|ankle| is_leg(&sections, ankle) && !is_knee(ankle))
                .filter(|ankle| !is_upside_down_knee(ankle));
            if ankle.is_some() || knee.is_some() {
                return Ok(Self {
                    ankle: ankle.map(|ankle| (sections, ankle)),
                    knee,
                });
            }
        }
        Ok(Self::none())
    }

    /// No joints, for a limb in which none is searched for.
    pub(crate) fn none() -> Self {
        Self {
            ankle: None,
            knee: None,
        }
    }

    /// The joints found, from distal to proximal.
    pub(crate) fn found(&self) -> Vec<FoundJoint> {
        let ankle = self.ankle.iter().map(|(_, ankle)| FoundJoint {
            joint: Joint::Ankle,
            centre_mm: ankle.centre.into(),
            gap_depth_hu: ankle.depth_hu,
            lines: None,
        });
        let knee = self.knee.iter().map(|FoundKnee { knee, .. }| FoundJoint {
            joint: Joint::Knee,
            centre_mm: knee.centre.into(),
            gap_depth_hu: knee.depth_hu,
            lines: Some(KneeLines {
                joint_line: knee.joint_line.into(),
                anterior: knee.by_condyles.then(|| knee.anterior.into()),
                plateau_is_cut: knee.is_cut,
            }),
        });
        ankle.chain(knee).collect()
    }
}

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

/// Whether the limb above an ankle is no thicker than a lower leg: in a trunk, spine and pelvis may narrow and widen as
/// a tibia does.
fn is_leg(sections: &Sections, ankle: &Ankle) -> bool {
    const ABOVE_MM: std::ops::Range<f64> = 5.0..60.0;
    /// A girth of 60 cm.
    const MOST_MM2: f64 = 28_600.0;
    let above = |slice: &usize| ABOVE_MM.contains(&(sections.level(*slice) - ankle.level_mm));
    let slices = sections.proximal_to_distal().into_iter().filter(above);
    let mut areas: Vec<f64> = slices.map(|slice| sections.limb_mm2(slice)).collect();
    areas.sort_unstable_by(f64::total_cmp);
    areas
        .get(areas.len() / 2)
        .is_none_or(|median| *median <= MOST_MM2)
}

/// Whether bone on both sides of an ankle is as broad as a knee.
fn is_amid_broad_bone(volume: &Volume, sections: &Sections, ankle: &Ankle) -> bool {
    const LEAST_MM: f64 = 12.0;
    let spans = spans(volume, sections, &Lengthwise::along(&sections.direction));
    broad_zones(&spans).iter().any(|zone| {
        let [low, high] = zone.range_mm;
        (low + LEAST_MM..high - LEAST_MM).contains(&ankle.level_mm)
    })
}

/// Whether an ankle was found where a knee is.
fn is_at(ankle: &Ankle, knee: &Knee) -> bool {
    /// Much less than the length of a tibia.
    const NEAR_MM: f64 = 60.0;
    (ankle.centre - knee.centre).norm() < NEAR_MM
}

/// Kind of limb: the requested one, otherwise that of the joint found, an ankle before a knee.
pub(crate) fn kind_of_limb(
    overrides: &LandmarkOverrides,
    found: &[FoundJoint],
) -> Result<LimbKind, LandmarkError> {
    let shows = |joint: Joint| found.iter().find(|other| other.joint == joint);
    let (asked, other, none) = match overrides.limb {
        Some(LimbKind::Other) => return Ok(LimbKind::Other),
        Some(LimbKind::LowerLeg) => (Joint::Ankle, Joint::Knee, LandmarkError::NoAnkle),
        Some(LimbKind::Knee) => (Joint::Knee, Joint::Ankle, LandmarkError::NoKnee),
        None => {
            let given = overrides.joint_centre.is_some();
            return match (shows(Joint::Ankle), shows(Joint::Knee)) {
                (Some(_), _) => Ok(LimbKind::LowerLeg),
                (None, Some(_)) => Ok(LimbKind::Knee),
                (None, None) if given => Ok(LimbKind::Other),
                (None, None) => Err(LandmarkError::NoJoint),
            };
        }
    };
    let kind = match asked {
        Joint::Ankle => LimbKind::LowerLeg,
        Joint::Knee => LimbKind::Knee,
    };
    if shows(asked).is_some() || overrides.joint_centre.is_some() {
        return Ok(kind);
    }
    Err(
        shows(other).map_or(none, |joint| LandmarkError::OtherJoint {
            asked,
            found: other,
            at_mm: joint.centre_mm,
        }),
    )
}

/// Notes on other joints in the scan, and on how well it shows the joint the limb is posed about.
pub(crate) fn joint_notes(kind: LimbKind, found: &[FoundJoint]) -> Vec<LandmarkNote> {
    let posed = match kind {
        LimbKind::LowerLeg => Some(Joint::Ankle),
        LimbKind::Knee => Some(Joint::Knee),
        LimbKind::Other => None,
    };
    let mut notes = Vec::new();
    for joint in found {
        if posed != Some(joint.joint) {
            notes.push(LandmarkNote::OtherJoint {
                joint: joint.joint,
                at_mm: joint.centre_mm,
            });
        } else if (joint.lines.as_ref()).is_some_and(|lines| lines.plateau_is_cut) {
            notes.push(LandmarkNote::PlateauCut);
        }
    }
    notes
}
