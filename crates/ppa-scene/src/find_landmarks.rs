//! Finding the landmarks of a limb in its scan.

use nalgebra::{Point3, Vector3};
use ppa_ct::Volume;
use ppa_mesh::Mesh;
use serde::{Deserialize, Serialize};

use crate::ankle::find_ankle;
use crate::contact::{Profile, split_level};
use crate::landmarks::{AxisRegion, AxisSource, Landmarks, LimbKind, Side};
use crate::limb_sections::Sections;

/// Choices of a person that replace the automatic ones; what is `None` stays automatic.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct LandmarkOverrides {
    /// What the scan shows; by default a lower leg if an ankle is found.
    pub limb: Option<LimbKind>,
    /// The joint centre, `ct` frame, mm; the axis is moved parallel to itself to pass through it.
    pub joint_centre: Option<[f64; 3]>,
    /// Distances proximal of the joint level where the joint region begins and ends, mm.
    pub joint_region: Option<[f64; 2]>,
    /// The same for the calf region.
    pub calf_region: Option<[f64; 2]>,
    /// What the region centres are centres of.
    pub axis_source: Option<AxisSource>,
    /// The direction that faces up at angle 0, `ct` frame.
    pub anterior: Option<[f64; 3]>,
    /// One distal and two proximal points of Π_P, `ct` frame, mm.
    pub plane_points: Option<[[f64; 3]; 3]>,
}

impl Landmarks {
    /// These landmarks as choices, so that a person finds every decision in one place and edits
    /// it: found again with the result, the patient frame is the same.
    ///
    /// The plane points stay open unless `given` has them, as they follow from axis and front.
    pub fn as_choices(&self, given: &LandmarkOverrides) -> LandmarkOverrides {
        LandmarkOverrides {
            limb: Some(self.limb),
            joint_centre: Some(self.joint_centre),
            joint_region: Some(self.joint_region.range_mm),
            calf_region: Some(self.calf_region.range_mm),
            axis_source: Some(self.axis_source),
            anterior: Some(self.anterior),
            plane_points: given.plane_points,
        }
    }
}

/// Why the landmarks of a limb cannot be told.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum LandmarkError {
    /// The mask is not one value per voxel.
    #[error("the limb mask has {found} values, expected {expected}, one per voxel")]
    MaskLength {
        /// Values given.
        found: usize,
        /// Voxels of the volume.
        expected: usize,
    },
    /// There is no limb.
    #[error("the limb has {voxels} voxels and {vertices} surface points, expected both above 0")]
    Empty {
        /// Voxels in the mask.
        voxels: usize,
        /// Vertices of the mesh.
        vertices: usize,
    },
    /// A lower leg was asked for but shows no ankle.
    #[error(
        "no ankle found: no tibia and fibula that widen to a joint gap; give the joint centre, \
         or the limb kind \"other\""
    )]
    NoAnkle,
    /// The scan ends too close to the joint.
    #[error(
        "the limb reaches {found_mm:.0} mm proximal of the joint, expected at least {expected_mm:.0} mm"
    )]
    TooShort {
        /// Length above the joint level.
        found_mm: f64,
        /// Length needed for two separate regions.
        expected_mm: f64,
    },
    /// A region has no limb in it, or the two are in the wrong order.
    #[error("the {name} from {from_mm:.1} to {to_mm:.1} mm proximal of the joint {problem}")]
    Region {
        /// "joint region" or "calf region".
        name: &'static str,
        /// Its beginning.
        from_mm: f64,
        /// Its end.
        to_mm: f64,
        /// What is wrong with it.
        problem: &'static str,
    },
    /// A direction or point given by a person cannot be used.
    #[error("{name} is {found:?}, expected {expected}")]
    Override {
        /// Field of [`LandmarkOverrides`].
        name: &'static str,
        /// Its value.
        found: [f64; 3],
        /// What it should be.
        expected: &'static str,
    },
    /// No plane touches both ends of the limb from below.
    #[error("no plane under the limb touches both its ends; give three plane points")]
    NoSupport,
    /// The plane given by a person has the limb on its back.
    #[error(
        "{behind_percent:.0} % of the limb lies behind the plane of the plane points, expected less than half"
    )]
    PlaneThroughLimb {
        /// Share of the surface behind the plane.
        behind_percent: f64,
    },
}

/// Finds joint level, rotation axis and supporting plane of a limb.
///
/// `limb` is the skin in the `ct` frame, `mask` one value per voxel of `volume`: whether it
/// belongs to the limb. Scans are patient scans (LPS), so proximal is superior; only when a lower
/// leg shows its ankle the other way round is it turned, with a note.
///
/// * Joint level of a lower leg: the gap between plafond and talar dome in a column along the
///   tibia's shaft. Other limbs: the middle of the limb.
/// * Axis: through the centres of two regions, 50 to 90 mm and 130 to 200 mm proximal of the joint
///   level, closer together when the scan is short; of other limbs around a quarter and three
///   quarters of the length. The centres are those of the tibia, because the paper wants the axis
///   to pass through the joint and a swelling moves the centre of the skin; without bone, or on
///   request, they are those of the limb's cross-sections.
/// * Anterior: −y of the scan across the axis, so that angle 0 is the pose in the scan.
/// * Π_P: the plane that touches the limb from behind at its lowest distal and proximal points
///   and is level from left to right. Its three points are the distal contact and two points 20 mm
///   left and right of the proximal contact, so that no part of the limb lies behind the plane.
///
/// # Errors
/// [`LandmarkError`] when a choice cannot be made or an override is unusable.
pub fn find_landmarks(
    volume: &Volume,
    limb: &Mesh,
    mask: &[bool],
    side: Side,
    overrides: &LandmarkOverrides,
) -> Result<Landmarks, LandmarkError> {
    if mask.len() != volume.grid().len() {
        return Err(LandmarkError::MaskLength {
            found: mask.len(),
            expected: volume.grid().len(),
        });
    }
    let voxels = mask.iter().filter(|inside| **inside).count();
    if voxels == 0 || limb.vertices.is_empty() {
        return Err(LandmarkError::Empty {
            voxels,
            vertices: limb.vertices.len(),
        });
    }
    check_overrides(overrides)?;
    let mut notes = Vec::new();
    let reference = Reference::find(volume, mask, overrides, &mut notes)?;
    let (joint_region, calf_region, axis_source) = reference.regions(overrides, &mut notes)?;
    let [low, high] = [joint_region, calf_region].map(|region| Point3::from(region.centre_mm));
    let direction = reference.sections.direction;
    let axis = (high - low).normalize();
    if axis.dot(&direction) < std::f64::consts::FRAC_1_SQRT_2 {
        return Err(LandmarkError::Region {
            name: "calf region",
            from_mm: calf_region.range_mm[0],
            to_mm: calf_region.range_mm[1],
            problem: "gives an axis more than 45 degrees off the scan's limb direction",
        });
    }
    let (axis_point, joint_centre) = match overrides.joint_centre {
        Some(centre) => (Point3::from(centre), Point3::from(centre)),
        None => {
            let rise = reference.level_mm - direction.dot(&low.coords);
            (low, low + axis * (rise / axis.dot(&direction)))
        }
    };
    let anterior = match overrides.anterior {
        Some(given) => Vector3::from(given),
        None => -Vector3::y(),
    };
    if anterior.cross(&axis).norm() < 0.1 * anterior.norm() {
        return Err(LandmarkError::Override {
            name: "anterior",
            found: anterior.into(),
            expected: "a direction across the limb's axis",
        });
    }
    let across = anterior - axis * axis.dot(&anterior);
    let mut landmarks = Landmarks {
        side,
        limb: reference.kind,
        axis_source,
        scan_direction: direction.into(),
        joint_region,
        calf_region,
        axis_point: axis_point.coords.into(),
        axis_direction: axis.into(),
        anterior: across.normalize().into(),
        joint_centre: joint_centre.coords.into(),
        plane_points: [[0.0; 3]; 3],
        notes,
    };
    match overrides.plane_points {
        Some(points) => {
            landmarks.plane_points = points;
            check_plane(limb, &mut landmarks)?;
        }
        None => landmarks.plane_points = plane_under(limb, &landmarks)?,
    }
    Ok(landmarks)
}

fn check_overrides(overrides: &LandmarkOverrides) -> Result<(), LandmarkError> {
    let [a, b, c] = overrides.plane_points.unwrap_or_default().map(Some);
    let points = [
        ("joint_centre", overrides.joint_centre),
        ("anterior", overrides.anterior),
        ("plane_points", a),
        ("plane_points", b),
        ("plane_points", c),
    ];
    for (name, point) in points {
        if let Some(found) = point.filter(|p| !p.iter().all(|c| c.is_finite())) {
            return Err(LandmarkError::Override {
                name,
                found,
                expected: "three finite numbers",
            });
        }
    }
    match overrides.anterior {
        Some(found) if Vector3::from(found).norm() < 1e-9 => Err(LandmarkError::Override {
            name: "anterior",
            found,
            expected: "a direction of length above 0",
        }),
        _ => Ok(()),
    }
}

/// What region ranges are measured from.
struct Reference<'a> {
    kind: LimbKind,
    sections: Sections<'a>,
    /// Joint level along the scan's limb direction, mm.
    level_mm: f64,
    /// Lowest and highest level with limb in it, from the joint level, mm.
    extent_mm: [f64; 2],
}

impl<'a> Reference<'a> {
    fn find(
        volume: &'a Volume,
        mask: &'a [bool],
        overrides: &LandmarkOverrides,
        notes: &mut Vec<String>,
    ) -> Result<Self, LandmarkError> {
        let mut sections = Sections::along(volume, mask, &Vector3::z());
        let mut ankle = None;
        if overrides.limb != Some(LimbKind::Other) {
            ankle = find_ankle(&sections);
            if ankle.is_none() {
                let reversed = Sections::along(volume, mask, &-Vector3::z());
                ankle = find_ankle(&reversed);
                if ankle.is_some() {
                    sections = reversed;
                    notes.push("the ankle lies superior to the calf: proximal is inferior".into());
                }
            }
        }
        let slices = sections.proximal_to_distal();
        let level = |slice: Option<&usize>| slice.map_or(0.0, |s| sections.level(*s));
        let (high, low) = (level(slices.first()), level(slices.last()));
        let (kind, level_mm) = match (overrides.joint_centre, ankle, overrides.limb) {
            (Some(centre), ankle, limb) => {
                notes.push("joint level: given".into());
                let guess = ankle.map_or(LimbKind::Other, |_| LimbKind::LowerLeg);
                let level = sections.direction.dot(&Vector3::from(centre));
                (limb.unwrap_or(guess), level)
            }
            (None, Some(ankle), _) => {
                notes.push(format!(
                    "joint level: gap between plafond and talar dome, {:.0} HU darker than the \
                     bone on either side",
                    ankle.depth_hu
                ));
                (LimbKind::LowerLeg, ankle.level_mm)
            }
            (None, None, Some(LimbKind::LowerLeg)) => return Err(LandmarkError::NoAnkle),
            (None, None, limb) => {
                let why = if limb.is_none() {
                    "no ankle found"
                } else {
                    "other limb"
                };
                notes.push(format!("joint level: middle of the limb ({why})"));
                (LimbKind::Other, 0.5 * (low + high))
            }
        };
        Ok(Self {
            kind,
            sections,
            level_mm,
            extent_mm: [low - level_mm, high - level_mm],
        })
    }

    fn regions(
        &self,
        overrides: &LandmarkOverrides,
        notes: &mut Vec<String>,
    ) -> Result<(AxisRegion, AxisRegion, AxisSource), LandmarkError> {
        let (joint, calf) = self.default_ranges(overrides, notes)?;
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
            if !(from_mm - 1e-6..=to_mm + 1e-6).contains(&above) {
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

/// The three points of the plane that touches the limb from behind.
fn plane_under(limb: &Mesh, landmarks: &Landmarks) -> Result<[[f64; 3]; 3], LandmarkError> {
    const HALF_WIDTH_MM: f64 = 20.0;
    let patient_from_ct = landmarks.patient_from_ct();
    let points: Vec<Point3<f64>> = limb
        .vertices
        .iter()
        .map(|p| patient_from_ct * p.cast::<f64>())
        .collect();
    let split_mm = split_level(points.iter().map(|p| p.z));
    let (distal, proximal): (Vec<_>, Vec<_>) = points.iter().partition(|p| p.z < split_mm);
    let seen = |half: &[&Point3<f64>]| half.iter().map(|p| [p.z, p.y]).collect();
    let profile = Profile {
        distal: seen(&distal),
        proximal: seen(&proximal),
    };
    let tilt = profile
        .resting_tilt()
        .ok_or(LandmarkError::NoSupport)?
        .angle_rad;
    let up = Vector3::new(0.0, tilt.cos(), tilt.sin());
    let lowest = |half: &[&Point3<f64>]| {
        half.iter()
            .map(|p| (up.dot(&p.coords), **p))
            .min_by(|a, b| a.0.total_cmp(&b.0))
            .ok_or(LandmarkError::NoSupport)
    };
    let ((distal_height, heel), (proximal_height, calf)) = (lowest(&distal)?, lowest(&proximal)?);
    let height = distal_height.min(proximal_height);
    let heel = heel - up * (distal_height - height);
    let calf = calf - up * (proximal_height - height);
    let aside = Vector3::x() * HALF_WIDTH_MM;
    let ct_from_patient = patient_from_ct.inverse();
    Ok([heel, calf - aside, calf + aside].map(|p| (ct_from_patient * p).coords.into()))
}

/// Notes or refuses a given plane that cuts the limb.
fn check_plane(limb: &Mesh, landmarks: &mut Landmarks) -> Result<(), LandmarkError> {
    let plane = landmarks.plane_patient();
    if !plane.normal.iter().all(|c| c.is_finite()) {
        return Err(LandmarkError::Override {
            name: "plane_points",
            found: landmarks.plane_points[0],
            expected: "three points that are not on one line",
        });
    }
    let patient_from_ct = landmarks.patient_from_ct();
    let (mut behind, mut deepest) = (0_usize, 0.0_f64);
    for vertex in &limb.vertices {
        let height = plane.signed_distance(&(patient_from_ct * vertex.cast::<f64>()));
        behind += usize::from(height < 0.0);
        deepest = deepest.min(height);
    }
    let behind_percent = 100.0 * behind as f64 / limb.vertices.len() as f64;
    if behind_percent >= 50.0 {
        return Err(LandmarkError::PlaneThroughLimb { behind_percent });
    }
    landmarks.notes.push(format!(
        "plane points: given; {behind_percent:.1} % of the surface lies behind their plane, up to \
         {:.1} mm",
        -deepest
    ));
    Ok(())
}
