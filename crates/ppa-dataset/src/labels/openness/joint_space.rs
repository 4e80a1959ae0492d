//! How open the joint space lies to the beam.

use nalgebra::{Point3, Unit, Vector3};
use ppa_scene::Landmarks;
use rayon::prelude::*;
use serde::Serialize;

use super::bones::{AnkleBone, AnkleBones};
use super::exposure::{Exposure, LimbAxes};
use super::gutter::{Gap, gap_mask, gaps, is_superior};
use super::rays::{PIXEL_MM, Ray, Window, middles};

/// One of the three parts of the ankle's joint space.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Gutter {
    /// Between talus and medial malleolus.
    Medial,
    /// Between trochlea and plafond.
    Superior,
    /// Between talus and lateral malleolus.
    Lateral,
}

impl Gutter {
    /// All three.
    pub const ALL: [Self; 3] = [Self::Medial, Self::Superior, Self::Lateral];
}

/// Why bones have no joint space that could be seen.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum JointSpaceError {
    /// A gutter was not found.
    #[error(
        "no {0:?} gutter: talus and {opposite} face each other nowhere across at most 6 mm",
        opposite = if *.0 == Gutter::Lateral { "fibula" } else { "tibia" }
    )]
    NoGutter(Gutter),
    /// No direction of the beam opens a gutter.
    #[error(
        "the {0:?} gutter is open from no direction around the limb: the bones may not be separated"
    )]
    NeverOpen(Gutter),
}

/// Bone on a ray that still counts as free, mm: three tolerances, the middle one for the label, the others for its
/// uncertainty.
pub const FREE_CHORDS_MM: [f64; 3] = [0.5, 1.0, 2.0];

/// Openness of each gutter to one exposure, 0 closed to 1 as open as any direction around the limb makes it.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Openness {
    /// Medial gutter, for each of [`FREE_CHORDS_MM`].
    pub medial: [f64; 3],
    /// Superior gutter.
    pub superior: f64,
    /// Lateral gutter, for each of [`FREE_CHORDS_MM`].
    pub lateral: [f64; 3],
}

impl Openness {
    /// The worst gutter decides; for each of [`FREE_CHORDS_MM`].
    pub fn worst(&self) -> [f64; 3] {
        std::array::from_fn(|n| self.medial[n].min(self.superior).min(self.lateral[n]))
    }
}

/// A ray that runs through a gap for less than this only grazes its rim, mm.
const LEAST_PATH_MM: f64 = 3.0;
/// How far above and below the superior gutter its margins are looked for, mm.
const MARGIN_MM: f64 = 6.0;
/// Columns and rows in which the superior gutter is looked at, mm.
const COLUMN_MM: f64 = 1.0;
const ROW_MM: f64 = 0.5;
/// Turns about the limb's axis among which the most open one is looked for, degrees: all, and those around the best.
const FARTHEST_DEG: f64 = 48.0;
const COARSE_DEG: f64 = 4.0;
const FINE_DEG: f64 = 0.5;

/// The gutters of an ankle, ready to be seen from any direction.
#[derive(Debug, Clone)]
pub struct JointSpace {
    bones: AnkleBones,
    limb: LimbAxes,
    medial: SeenGap,
    superior: SeenGap,
    lateral: SeenGap,
}

#[derive(Debug, Clone)]
struct SeenGap {
    /// The bone opposite the talus.
    opposite: AnkleBone,
    gaps: Vec<Gap>,
    mask: Vec<bool>,
}

impl JointSpace {
    /// Finds the gutters between the bones.
    ///
    /// # Errors
    /// [`JointSpaceError::NoGutter`] when talus and tibia or fibula nowhere face each other across at most 6 mm.
    pub fn new(bones: AnkleBones, landmarks: &Landmarks) -> Result<Self, JointSpaceError> {
        let axis = Unit::new_normalize(Vector3::from(landmarks.axis_direction));
        let anterior = Vector3::from(landmarks.anterior);
        let limb = LimbAxes {
            joint: Point3::from(landmarks.joint_centre),
            axis,
            anterior: Unit::new_normalize(anterior - axis.scale(axis.dot(&anterior))),
        };
        let to_tibia = gaps(&bones, AnkleBone::Tibia);
        let (superior, medial) = to_tibia
            .into_iter()
            .partition(|gap| is_superior(gap, &axis));
        let lateral = gaps(&bones, AnkleBone::Fibula);
        let seen = |gutter, opposite, gaps: Vec<Gap>| match gaps.is_empty() {
            true => Err(JointSpaceError::NoGutter(gutter)),
            false => Ok(SeenGap {
                opposite,
                mask: gap_mask(&bones, &gaps),
                gaps,
            }),
        };
        Ok(Self {
            medial: seen(Gutter::Medial, AnkleBone::Tibia, medial)?,
            superior: seen(Gutter::Superior, AnkleBone::Tibia, superior)?,
            lateral: seen(Gutter::Lateral, AnkleBone::Fibula, lateral)?,
            bones,
            limb,
        })
    }

    /// How open the gutters are to an exposure.
    ///
    /// Medial and lateral gutter, whose faces are nearly plane: the area through which rays pass that run along the gap and
    /// meet at most so much of the two bones beside it ([`FREE_CHORDS_MM`]), relative to the largest such area from any direction around the
    /// limb. For a slab of width w and depth L this is 1 − L tan φ / w at an angle φ off its plane.
    ///
    /// Superior gutter: the plafond's edges reach below the dome, so that no ray is free of bone. Its contrast counts,
    /// 1 − (least bone in the gap) / (most bone beside it), all bones taken together, averaged over the columns of the
    /// image, relative to the highest contrast from any direction around the limb.
    ///
    /// # Errors
    /// [`JointSpaceError::NeverOpen`] if a gutter is open from no direction.
    pub fn openness(&self, exposures: &[Exposure]) -> Result<Vec<Openness>, JointSpaceError> {
        let Some(first) = exposures.first() else {
            return Ok(Vec::new());
        };
        let distance_mm = first.distance_mm();
        let plane = |gutter, seen: &SeenGap, exposures: &[Exposure]| {
            let area = |exposure: &Exposure| self.open_areas_mm2(seen, exposure);
            let best = self.most_open(distance_mm, area);
            match best.iter().all(|&area| area > 0.0) {
                true => Ok(relative_to(best, exposures, area)),
                false => Err(JointSpaceError::NeverOpen(gutter)),
            }
        };
        let medial = plane(Gutter::Medial, &self.medial, exposures)?;
        let lateral = plane(Gutter::Lateral, &self.lateral, exposures)?;
        let contrast = |exposure: &Exposure| [self.contrast(exposure)];
        let best = self.most_open(distance_mm, contrast);
        if best[0] <= 0.0 {
            return Err(JointSpaceError::NeverOpen(Gutter::Superior));
        }
        let superior = relative_to(best, exposures, contrast);
        let of = |n: usize| Openness {
            medial: medial[n],
            superior: superior[n][0],
            lateral: lateral[n],
        };
        Ok((0..exposures.len()).map(of).collect())
    }

    /// The most that any direction around the limb shows.
    fn most_open<const N: usize>(
        &self,
        distance_mm: f64,
        visible: impl Fn(&Exposure) -> [f64; N] + Sync,
    ) -> [f64; N] {
        let among = |middle: f64, reach: f64, step: f64| {
            let half = (reach / step) as i32;
            let turns = (-half..=half).into_par_iter();
            let seen: Vec<([f64; N], f64)> = turns
                .map(|n| middle + step * f64::from(n))
                .map(|degrees| {
                    let turn = degrees.to_radians();
                    let exposure = Exposure::around(&self.limb, turn, distance_mm);
                    (visible(&exposure), degrees)
                })
                .collect();
            // The middle one of three tolerances, or the only value.
            let better = |a: ([f64; N], f64), b: ([f64; N], f64)| {
                if b.0[N / 2] > a.0[N / 2] { b } else { a }
            };
            let best = seen.into_iter().reduce(better);
            best.expect("there are directions")
        };
        let (_, degrees) = among(0.0, FARTHEST_DEG, COARSE_DEG);
        among(degrees, COARSE_DEG, FINE_DEG).0
    }

    /// Areas through which rays pass freely, for each of [`FREE_CHORDS_MM`].
    fn open_areas_mm2(&self, seen: &SeenGap, exposure: &Exposure) -> [f64; 3] {
        let bones = &self.bones;
        let window = Window::around(&seen.gaps, exposure);
        let beside = [bones.body(AnkleBone::Talus), bones.body(seen.opposite)];
        let along = middles(window.along_mm, PIXEL_MM);
        let pixels = middles(window.across_mm, PIXEL_MM)
            .flat_map(|across| along.clone().map(move |along| [across, along]));
        let chords = pixels
            .map(|pixel| Ray::through(exposure, pixel, bones))
            .filter(|ray| ray.path_mm(&seen.mask, bones.size()) >= LEAST_PATH_MM)
            .map(|ray| ray.chord_mm(bones, &beside, FREE_CHORDS_MM[2]));
        let mut areas = [0.0; 3];
        for chord in chords {
            for (area, free) in areas.iter_mut().zip(FREE_CHORDS_MM) {
                if chord <= free {
                    *area += PIXEL_MM * PIXEL_MM;
                }
            }
        }
        areas
    }

    /// Contrast of the superior gutter, averaged over the columns that show it.
    fn contrast(&self, exposure: &Exposure) -> f64 {
        let window = Window::around(&self.superior.gaps, exposure);
        let [low, high] = window.along_mm;
        let rows = middles([low - MARGIN_MM, high + MARGIN_MM], ROW_MM);
        let of_columns: Vec<f64> = middles(window.across_mm, COLUMN_MM)
            .filter_map(|across| self.contrast_of_column(exposure, across, rows.clone()))
            .collect();
        of_columns.iter().sum::<f64>() / of_columns.len().max(1) as f64
    }

    fn contrast_of_column(
        &self,
        exposure: &Exposure,
        across: f64,
        rows: impl Iterator<Item = f64>,
    ) -> Option<f64> {
        let bones = &self.bones;
        let column: Vec<(bool, f64)> = rows
            .map(|along| {
                let ray = Ray::through(exposure, [across, along], bones);
                let path = ray.path_mm(&self.superior.mask, bones.size());
                (
                    path >= LEAST_PATH_MM,
                    ray.chord_mm(bones, &[bones.skeleton()], f64::INFINITY),
                )
            })
            .collect();
        let first = column.iter().position(|(in_gap, _)| *in_gap)?;
        let last = column.iter().rposition(|(in_gap, _)| *in_gap)?;
        let margin = (MARGIN_MM / ROW_MM) as usize;
        let most = |rows: &[(bool, f64)]| rows.iter().map(|row| row.1).fold(0.0, f64::max);
        let above = most(&column[first.saturating_sub(margin)..first]);
        let below = most(&column[last + 1..(last + 1 + margin).min(column.len())]);
        let beside = above.min(below);
        let gap = column[first..=last].iter().map(|row| row.1);
        let least = gap.fold(f64::INFINITY, f64::min);
        Some(if least < beside {
            1.0 - least / beside
        } else {
            0.0
        })
    }
}

/// What each exposure shows relative to the most that could be seen.
fn relative_to<const N: usize>(
    best: [f64; N],
    exposures: &[Exposure],
    visible: impl Fn(&Exposure) -> [f64; N] + Sync,
) -> Vec<[f64; N]> {
    let relative = |exposure| {
        let seen = visible(exposure);
        std::array::from_fn(|n| (seen[n] / best[n]).min(1.0))
    };
    exposures.par_iter().map(relative).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::labels::BoneNumbers;
    use ppa_ct::Grid;
    use ppa_ct::phantom::{LowerLeg, Truth};
    use ppa_scene::{AxisRegion, AxisSource, LimbKind, Side};

    fn landmarks(joint: [f64; 3], side: Side) -> Landmarks {
        let region = AxisRegion {
            range_mm: [0.0, 1.0],
            centre_mm: joint,
        };
        Landmarks {
            side,
            limb: LimbKind::LowerLeg,
            axis_source: AxisSource::Bone,
            scan_direction: [0.0, 0.0, 1.0],
            joint_region: region,
            calf_region: region,
            axis_point: joint,
            axis_direction: [0.0, 0.0, 1.0],
            anterior: [0.0, -1.0, 0.0],
            joint_centre: joint,
            plane_points: [[0.0; 3]; 3],
            notes: Vec::new(),
        }
    }

    /// A talus of 30 x 25 x 15 mm between a fork of boxes: gutters of `width` mm beside it and above it, all 25 mm deep.
    fn fork(spacing: f64, width: f64) -> AnkleBones {
        let half = 42.0;
        let n = (2.0 * half / spacing) as usize;
        // The faces of the boxes lie between voxel centres.
        let first = 0.5 * spacing - half;
        let grid = Grid::axis_aligned(
            [n; 3],
            Vector3::from_element(spacing),
            Point3::from([first; 3]),
        );
        let grid = grid.unwrap();
        let labels: Vec<u8> = (0..grid.len())
            .map(|index| {
                let p = grid.centre(grid.voxel(index).map(|v| v as f64));
                let deep = p.y.abs() <= 12.5;
                match (p.x, p.z) {
                    _ if !deep => 0,
                    (x, z) if x.abs() <= 15.0 && (-15.0..=0.0).contains(&z) => 1,
                    (x, z) if (15.0 + width..40.0).contains(&x) && z >= -12.0 => 3,
                    (x, z) if (-40.0..=-15.0 - width).contains(&x) && z >= -12.0 => 4,
                    (x, z) if x.abs() <= 14.0 && z >= width => 3,
                    _ => 0,
                }
            })
            .collect();
        AnkleBones::new(&grid, &labels, BoneNumbers::default(), &Point3::origin()).unwrap()
    }

    fn openness(space: &JointSpace, degrees: &[f64]) -> Vec<Openness> {
        // Far away, so that rays are nearly parallel, as the formula of the slab has them.
        let exposures: Vec<_> = degrees
            .iter()
            .map(|d| Exposure::around(&space.limb, d.to_radians(), 1e5))
            .collect();
        space.openness(&exposures).unwrap()
    }

    /// A slab of width w and depth L closes at atan(w / L), within half a degree, and is half open at half its tangent.
    #[test]
    fn a_slab_closes_at_the_angle_whose_tangent_is_width_over_depth() {
        for width in [3.0_f64, 4.0] {
            let bones = fork(0.5, width);
            let space = JointSpace::new(bones, &landmarks([0.0; 3], Side::Right)).unwrap();
            let closes = (width / 25.0).atan().to_degrees();
            let degrees = [0.0, 0.5 * closes, -0.5 * closes, closes - 0.7, closes + 0.5];
            let found = openness(&space, &degrees);
            for of in [|o: &Openness| o.medial[1], |o: &Openness| o.lateral[1]] {
                let found: Vec<f64> = found.iter().map(of).collect();
                assert!(found[0] > 0.95, "{width}: {found:?}");
                // A pixel is a twelfth of the narrower slab.
                assert!((found[1] - 0.5).abs() < 0.1, "{width}: {found:?}");
                assert!((found[2] - 0.5).abs() < 0.1, "{width}: {found:?}");
                assert!(found[3] > 0.1 && found[4] < 0.1, "{width}: {found:?}");
            }
        }
    }

    fn mortise(name: &str, side: ppa_ct::phantom::Side, spacing_mm: f64) -> (JointSpace, Truth) {
        let leg = LowerLeg::family(name, side).unwrap();
        let truth = leg.truth();
        let low = truth.joint_centre - Vector3::from_element(62.0);
        let n = (124.0 / spacing_mm) as usize;
        let grid = Grid::axis_aligned([n; 3], Vector3::from_element(spacing_mm), low).unwrap();
        let labels = leg.bone_labels(&grid);
        let joint = truth.joint_centre;
        let bones = AnkleBones::new(&grid, &labels, BoneNumbers::default(), &joint).unwrap();
        let mut landmarks = landmarks(joint.into(), Side::Right);
        landmarks.axis_direction = truth.axis_direction.into_inner().into();
        (JointSpace::new(bones, &landmarks).unwrap(), truth)
    }

    /// Internal rotation at which the worst gutter is most open, among those within 8 degrees of the mortise angle.
    fn most_open_rotation(space: &JointSpace, truth: &Truth, side: ppa_ct::phantom::Side) -> f64 {
        let mortise_angle = truth.mortise_angle_rad.to_degrees();
        let degrees: Vec<f64> = (-8..=8)
            .map(|n| mortise_angle.round() + f64::from(n))
            .collect();
        let sign = match side {
            ppa_ct::phantom::Side::Right => -1.0,
            ppa_ct::phantom::Side::Left => 1.0,
        };
        let exposures: Vec<_> = degrees
            .iter()
            .map(|d| Exposure::around(&space.limb, sign * d.to_radians(), 1050.0))
            .collect();
        let found = space.openness(&exposures).unwrap();
        let worst: Vec<f64> = found.iter().map(|o| o.worst()[1]).collect();
        // Both flanks are steep: the middle of what is at least nine tenths of the best.
        let best = worst.iter().copied().fold(0.0, f64::max);
        assert!(best > 0.2, "{worst:?}");
        let near: Vec<f64> = (0..worst.len())
            .filter(|&n| worst[n] >= 0.9 * best)
            .map(|n| degrees[n])
            .collect();
        near.iter().sum::<f64>() / near.len() as f64
    }

    #[test]
    fn a_phantom_opens_at_its_mortise_angle() {
        use ppa_ct::phantom::Side::{Left, Right};
        for (name, side) in [("P01", Right), ("P10", Left)] {
            let (space, truth) = mortise(name, side, 0.8);
            let found = most_open_rotation(&space, &truth, side);
            let expected = truth.mortise_angle_rad.to_degrees();
            assert!(
                (found - expected).abs() < 3.0,
                "{name}: {found}, {expected}"
            );
        }
    }

    #[test]
    #[ignore = "a minute: seventeen ankles, each seen from many sides"]
    fn every_phantom_opens_at_its_mortise_angle_and_all_of_them_as_published() {
        let side = ppa_ct::phantom::Side::Right;
        let found: Vec<f64> = (1..=17)
            .map(|n| {
                let (space, truth) = mortise(&format!("P{n:02}"), side, 0.8);
                let found = most_open_rotation(&space, &truth, side);
                let expected = truth.mortise_angle_rad.to_degrees();
                println!("P{n:02}: most open at {found:.1}, mortise angle {expected:.1}");
                assert!(
                    (found - expected).abs() < 3.0,
                    "P{n:02}: {found}, {expected}"
                );
                found
            })
            .collect();
        // 19.1 ± 5.0 degrees in 128 feet (CT, 2001).
        let mean = found.iter().sum::<f64>() / 17.0;
        assert!((mean - 19.1).abs() < 5.0, "{mean}");
    }
}
