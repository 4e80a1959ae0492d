//! Position of the ankle joint: the gap between tibial plafond and talar dome.

use nalgebra::{Point3, Vector3};

use crate::landmarks::limb_sections::Sections;
use crate::landmarks::notes::LandmarkNote;

/// The ankle of a lower leg.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Ankle {
    /// Level of the joint gap along the scan's limb direction, mm.
    pub(crate) level_mm: f64,
    /// The point of the tibia's shaft at that level.
    pub(crate) centre: Point3<f64>,
    /// How much less dense the gap is than the bone on either side of it.
    pub(crate) depth_hu: f64,
}

impl Ankle {
    /// Note about the ankle for a joint at the given level.
    pub(crate) fn note(&self, joint_mm: f64) -> LandmarkNote {
        LandmarkNote::AnkleFound {
            depth_hu: self.depth_hu,
            joint_above_mm: joint_mm - self.level_mm,
        }
    }
}

/// The tibia flares when its outline is this much larger than at its thinnest.
const FLARE: f64 = 1.5;

/// The flare starts this far above the joint, mm: the distal tibia widens over 15 to 50 mm.
const FLARE_TO_JOINT_MM: [f64; 2] = [5.0, 60.0];

/// Outline of the thinnest adult tibia, roughly; those of adults measure 300 to 500 mm².
const MIN_TIBIA_MM2: f64 = 220.0;

/// Radius of the column through the tibia whose density is followed, mm. The talar dome
/// (radius about 20 mm) falls by less than 1 mm over it.
const COLUMN_MM: f64 = 6.0;

/// Subchondral plates lie within this distance of the gap, mm.
const PLATE_MM: f64 = 10.0;

/// The gap must be darker than the plates by this much.
const MIN_DEPTH_HU: f64 = 30.0;

/// Follows the tibia from its thin shaft to the flare above the ankle and looks for the joint
/// gap below: the first clear dip between two dense plates in a column along the shaft.
///
/// `None` if there is no shaft with a second, thinner bone (the fibula) next to it, no flare or
/// no gap.
pub(crate) fn find_ankle(sections: &Sections) -> Option<Ankle> {
    let slices = sections.proximal_to_distal();
    let (top_mm, shaft) = flare(sections, &slices)?;
    let line = ShaftLine::through(&shaft)?;
    let column: Vec<(f64, f64)> = slices
        .iter()
        .map(|slice| (sections.level(*slice), *slice))
        .filter(|(level, _)| {
            let below = top_mm - level;
            (FLARE_TO_JOINT_MM[0] - PLATE_MM..=FLARE_TO_JOINT_MM[1] + PLATE_MM).contains(&below)
        })
        .filter_map(|(level, slice)| {
            let hu = sections.mean_hu(slice, &line.at(level), COLUMN_MM)?;
            Some((level, hu))
        })
        .collect();
    let dips: Vec<(usize, f64)> = (0..column.len())
        .filter(|i| {
            let below = top_mm - column[*i].0;
            (FLARE_TO_JOINT_MM[0]..=FLARE_TO_JOINT_MM[1]).contains(&below)
        })
        .filter_map(|i| Some((i, depth(&column, i)?)))
        .collect();
    let deepest = dips.iter().map(|(_, depth)| *depth).fold(0.0, f64::max);
    // The subtalar joint, below, can be as dark: the most proximal clear gap is the ankle.
    let (i, depth_hu) = dips
        .into_iter()
        .find(|(_, depth)| *depth >= MIN_DEPTH_HU.max(0.5 * deepest))?;
    let level_mm = vertex(&column, i);
    Some(Ankle {
        level_mm,
        centre: line.at(level_mm),
        depth_hu,
    })
}

/// A level with its largest bone.
struct Level {
    level_mm: f64,
    centre: Point3<f64>,
    has_fibula: bool,
}

/// Level where the flare starts, and the shaft from there 40 mm up.
///
/// A forearm's radius is thinner than any adult tibia, and a femur has only the short kneecap
/// next to it: neither counts as a tibia.
fn flare(sections: &Sections, slices: &[usize]) -> Option<(f64, Vec<Level>)> {
    const SUSTAINED_MM: f64 = 4.0;
    const SHAFT_MM: f64 = 40.0;
    let mut levels: Vec<Level> = Vec::new();
    let mut thinnest_mm2 = f64::INFINITY;
    let mut start: Option<usize> = None;
    let mut shortest_mm = 0.0;
    for (index, slice) in slices.iter().enumerate() {
        let level_mm = sections.level(*slice);
        let bones = sections.bones(*slice);
        let Some(tibia) = bones.first().filter(|bone| bone.area_mm2 >= MIN_TIBIA_MM2) else {
            continue;
        };
        levels.push(Level {
            level_mm,
            centre: tibia.centre,
            has_fibula: bones
                .get(1)
                .is_some_and(|bone| (0.05..0.7).contains(&(bone.area_mm2 / tibia.area_mm2))),
        });
        if tibia.area_mm2 < FLARE * thinnest_mm2 {
            thinnest_mm2 = thinnest_mm2.min(tibia.area_mm2);
            start = None;
            continue;
        }
        let first = *start.get_or_insert(index);
        let top_mm = sections.level(slices[first]);
        if top_mm - level_mm >= SUSTAINED_MM {
            let shaft_mm = levels[0].level_mm - top_mm;
            if shaft_mm < shortest_mm || !fibula_beside(&levels, top_mm) {
                // The end of a thigh: a lower leg may follow, if there is a shaft between the
                // condyles, of which there are two as well, and the next flare.
                levels.clear();
                (thinnest_mm2, start, shortest_mm) = (f64::INFINITY, None, SHAFT_MM);
                continue;
            }
            levels.retain(|l| (top_mm..=top_mm + SHAFT_MM).contains(&l.level_mm));
            return Some((top_mm, levels));
        }
    }
    None
}

/// Direction of the largest bone in the proximal half of the limb, towards proximal; `None` for
/// fewer than ten slices with bone.
///
/// The median of the slopes between any two slices (Theil 1950, Sen 1968, doi:10.1080/01621459.1968.10480934)
/// is not misled by slices in which a knee, a plate or a fused fibula is largest, if they are
/// fewer than a quarter. Centres of oblique sections of a shaft lie on its axis.
pub(crate) fn shaft_direction(sections: &Sections) -> Option<Vector3<f64>> {
    const MOST_SLICES: usize = 100;
    let mut slices = sections.proximal_to_distal();
    slices.truncate(slices.len() / 2);
    let stride = slices.len().div_ceil(MOST_SLICES).max(1);
    let centres: Vec<Point3<f64>> = slices
        .iter()
        .step_by(stride)
        .filter_map(|slice| sections.bones(*slice).first().map(|bone| bone.centre))
        .collect();
    if centres.len() < 10 {
        return None;
    }
    let far = centres.len() / 3;
    let mut slopes: [Vec<f64>; 3] = Default::default();
    for (i, upper) in centres.iter().enumerate() {
        for lower in centres.iter().skip(i + far) {
            let d = upper - lower;
            let slope = d / sections.direction.dot(&d);
            (0..3).for_each(|axis| slopes[axis].push(slope[axis]));
        }
    }
    let median = slopes.map(|mut slopes| {
        let middle = slopes.len() / 2;
        *slopes.select_nth_unstable_by(middle, f64::total_cmp).1
    });
    Vector3::from(median).try_normalize(1e-9)
}

/// Whether a thinner bone runs along most of the shaft above a level.
///
/// Only the proximal half counts: in coarse voxels the fibula is connected with the tibia for about
/// 40 mm above the flare, and the kneecap is next to the flare of a femur.
fn fibula_beside(levels: &[Level], top_mm: f64) -> bool {
    const ALONG_MM: f64 = 80.0;
    let mut shaft: Vec<&Level> = levels
        .iter()
        .filter(|l| (top_mm..=top_mm + ALONG_MM).contains(&l.level_mm))
        .collect();
    shaft.truncate(shaft.len().div_ceil(2));
    let with_fibula = shaft.iter().filter(|l| l.has_fibula).count();
    5 * with_fibula >= 3 * shaft.len()
}

/// Centre of the shaft as a straight function of the level.
struct ShaftLine {
    level_mm: f64,
    centre: Vector3<f64>,
    slope: Vector3<f64>,
}

impl ShaftLine {
    /// Least squares; `None` for fewer than three centres.
    fn through(shaft: &[Level]) -> Option<Self> {
        if shaft.len() < 3 {
            return None;
        }
        let n = shaft.len() as f64;
        let level_mm = shaft.iter().map(|l| l.level_mm).sum::<f64>() / n;
        let centre = shaft.iter().map(|l| l.centre.coords).sum::<Vector3<f64>>() / n;
        let spread: f64 = shaft.iter().map(|l| (l.level_mm - level_mm).powi(2)).sum();
        let moment: Vector3<f64> = shaft
            .iter()
            .map(|l| (l.centre.coords - centre) * (l.level_mm - level_mm))
            .sum();
        Some(Self {
            level_mm,
            centre,
            slope: moment / spread,
        })
    }

    fn at(&self, level_mm: f64) -> Point3<f64> {
        Point3::from(self.centre + self.slope * (level_mm - self.level_mm))
    }
}

/// Depth of a local minimum below the plates on either side.
fn depth(column: &[(f64, f64)], i: usize) -> Option<f64> {
    let (level, hu) = column[i];
    let neighbour = |j: usize| column.get(j).map(|c| c.1);
    if neighbour(i.checked_sub(1)?)? < hu || neighbour(i + 1)? < hu {
        return None;
    }
    let plate = |side: f64| {
        column
            .iter()
            .filter(|(l, _)| (0.0..=PLATE_MM).contains(&((l - level) * side)))
            .map(|(_, hu)| *hu)
            .fold(f64::NEG_INFINITY, f64::max)
    };
    Some(plate(1.0).min(plate(-1.0)) - hu)
}

/// Level of the parabola's vertex through a minimum and its neighbours.
fn vertex(column: &[(f64, f64)], i: usize) -> f64 {
    let [(x0, y0), (x1, y1), (x2, y2)] = [column[i - 1], column[i], column[i + 1]];
    let (left, right) = ((x1 - x0) * (y1 - y2), (x1 - x2) * (y1 - y0));
    let curvature = left - right;
    if curvature == 0.0 {
        return x1;
    }
    x1 - 0.5 * ((x1 - x0) * left - (x1 - x2) * right) / curvature
}

#[cfg(test)]
mod tests {
    use ppa_ct::{Grid, Volume};

    use super::*;

    /// Radii of the larger and the smaller bone at a height above the joint: thigh, condyles, tibia
    /// and fibula that flare above the ankle, talus.
    fn radii_mm(height: f64) -> [f64; 2] {
        match height {
            ..-2.0 => [22.0, 0.0],
            ..2.0 => [0.0, 0.0],
            ..40.0 => [22.0 - 0.27 * (height - 2.0), 5.0],
            ..290.0 => [11.3, 5.0],
            ..350.0 => [25.0, 0.0],
            _ => [14.0, 0.0],
        }
    }

    /// Slices of 2 mm from 30 mm below the ankle up to `top_mm` above it.
    fn leg(top_mm: f64) -> Volume {
        let slices = ((top_mm + 30.0) / 2.0) as usize;
        let grid = Grid::axis_aligned(
            [60, 60, slices],
            Vector3::repeat(2.0),
            Point3::new(0.0, 0.0, -30.0),
        )
        .unwrap();
        let hu = (0..grid.len()).map(|index| {
            let p = grid.centre(grid.voxel(index).map(|v| v as f64));
            let within = |x: f64, radius: f64| (p.x - x).hypot(p.y - 60.0) < radius;
            let [large, small] = radii_mm(p.z);
            let bone = within(60.0, large) || within(94.0, small);
            if bone { 600.0 } else { 20.0 }
        });
        let hu = hu.collect();
        Volume::new(grid, hu).unwrap()
    }

    /// The ankle is found whatever is above the calf, and a knee alone is not taken for one.
    #[test]
    fn a_thigh_does_not_hide_the_ankle() {
        for top_mm in [200.0, 320.0, 420.0] {
            let volume = leg(top_mm);
            let mask = vec![true; volume.grid().len()];
            let sections = Sections::along(&volume, &mask, &Vector3::z());
            let ankle = find_ankle(&sections).unwrap_or_else(|| panic!("none of {top_mm} mm"));
            assert!(ankle.level_mm.abs() < 2.0, "{ankle:?} of {top_mm} mm");
        }
        let whole = leg(420.0);
        let [ni, nj, nk] = whole.grid().size();
        let knee = whole.crop([0, 0, 100], [ni, nj, nk]).unwrap();
        let mask = vec![true; knee.grid().len()];
        let sections = Sections::along(&knee, &mask, &Vector3::z());
        assert_eq!(find_ankle(&sections), None);
    }
}
