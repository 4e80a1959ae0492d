//! The gap between the condyles of a femur and a tibial plateau, column by column along the limb.

use nalgebra::{Matrix3, Vector2, Vector3};
use ppa_ct::Volume;

use crate::landmarks::bone_spans::Lengthwise;

/// Hounsfield units at a place across the limb and a level: the mean of five points within 1.5 mm; `None` outside
/// the scan.
pub(crate) fn density(
    volume: &Volume,
    frame: &Lengthwise,
    place: &Vector2<f64>,
    level_mm: f64,
) -> Option<f64> {
    const NEAR_MM: f64 = 1.5;
    let offsets = [[0.0, 0.0], [1.0, 0.0], [-1.0, 0.0], [0.0, 1.0], [0.0, -1.0]];
    let mut sum = 0.0;
    for offset in offsets {
        let near = place + Vector2::from(offset) * NEAR_MM;
        sum += volume.sample(&frame.point(&near, level_mm))?;
    }
    Some(sum / offsets.len() as f64)
}

/// Point where a column crosses the gap.
#[derive(Debug, Clone, Copy)]
pub(crate) struct GapPoint {
    pub(crate) place: Vector2<f64>,
    /// Half-way between the two plates, mm.
    pub(crate) level_mm: f64,
    /// How much less dense the gap is than the thinner plate.
    pub(crate) depth_hu: f64,
}

/// The gap, as the points where columns cross it.
#[derive(Debug, Clone)]
pub(crate) struct Gap {
    pub(crate) points: Vec<GapPoint>,
}

/// Distance of neighbouring columns, mm.
const COLUMN_MM: f64 = 3.0;

/// Step between the levels of a column, mm.
const STEP_MM: f64 = 1.0;

/// Plates lie within this distance of the middle of the gap, mm.
const PLATE_MM: f64 = 10.0;

/// Plates are at least this dense and the gap is less dense by at least that.
const MIN_PLATE_HU: f64 = 200.0;
const MIN_DEPTH_HU: f64 = 80.0;

/// Both compartments of a small knee have about 1,000 mm².
const MIN_GAP_MM2: f64 = 300.0;

impl Gap {
    /// Looks for the nearly level gap that most columns between two places and two levels cross; `None` if too
    /// few do.
    pub(crate) fn find(
        volume: &Volume,
        frame: &Lengthwise,
        places: [Vector2<f64>; 2],
        levels_mm: [f64; 2],
    ) -> Option<Self> {
        let [low, high] = places;
        let steps = ((high - low) / COLUMN_MM).map(|steps| steps.ceil() as usize);
        let columns = (0..=steps.x).flat_map(|i| (0..=steps.y).map(move |j| [i as f64, j as f64]));
        let points = columns
            .filter_map(|step| {
                let place = low + Vector2::from(step) * COLUMN_MM;
                deepest_dip(volume, frame, &place, levels_mm)
            })
            .collect();
        let points = nearly_level(points)?;
        let area_mm2 = points.len() as f64 * COLUMN_MM * COLUMN_MM;
        (area_mm2 >= MIN_GAP_MM2).then_some(Self { points })
    }

    /// Median depth of the gap, HU.
    pub(crate) fn depth_hu(&self) -> f64 {
        median(self.points.iter().map(|point| point.depth_hu).collect())
    }

    /// Mean place and level of the gap, each column weighted by its depth.
    pub(crate) fn centre(&self) -> Option<(Vector2<f64>, f64)> {
        let weight: f64 = self.points.iter().map(|point| point.depth_hu).sum();
        if weight <= 0.0 {
            return None;
        }
        let (mut place, mut level) = (Vector2::zeros(), 0.0);
        for point in &self.points {
            place += point.place * (point.depth_hu / weight);
            level += point.level_mm * (point.depth_hu / weight);
        }
        Some((place, level))
    }

    /// The columns for which `keep` holds.
    pub(crate) fn part(&self, keep: impl Fn(&GapPoint) -> bool) -> Self {
        let points = self.points.iter().copied().filter(|point| keep(point));
        Self {
            points: points.collect(),
        }
    }
}

/// The clearest dip between two plates in a column.
fn deepest_dip(
    volume: &Volume,
    frame: &Lengthwise,
    place: &Vector2<f64>,
    [low, high]: [f64; 2],
) -> Option<GapPoint> {
    let steps = ((high - low) / STEP_MM) as usize;
    let level = |i: usize| low + i as f64 * STEP_MM;
    let column: Vec<Option<f64>> = (0..=steps)
        .map(|i| density(volume, frame, place, level(i)))
        .collect();
    let reach = (PLATE_MM / STEP_MM) as usize;
    let plate = |range: std::ops::Range<usize>| {
        let dense = column[range].iter().flatten();
        dense.fold(f64::NEG_INFINITY, |most, hu| most.max(*hu))
    };
    let (i, hu, plate_hu) = (reach..column.len().saturating_sub(reach))
        .filter_map(|i| {
            let hu = column[i]?;
            let least = plate(i - reach..i).min(plate(i + 1..i + 1 + reach));
            Some((i, hu, least))
        })
        .max_by(|a, b| (a.2 - a.1).total_cmp(&(b.2 - b.1)))?;
    let depth_hu = plate_hu - hu;
    if plate_hu < MIN_PLATE_HU || depth_hu < MIN_DEPTH_HU {
        return None;
    }
    // Half-way up either flank: slices thicker than the gap would tie a minimum to their centres.
    let half = hu + 0.5 * depth_hu;
    let flank = |towards: isize| {
        let mut from = (level(i), hu);
        for step in 1..=reach as isize {
            let j = i.checked_add_signed(towards * step)?;
            let to = (level(j), (*column.get(j)?)?);
            if to.1 >= half {
                return Some(from.0 + (to.0 - from.0) * (half - from.1) / (to.1 - from.1));
            }
            from = to;
        }
        None
    };
    Some(GapPoint {
        place: *place,
        level_mm: 0.5 * (flank(1)? + flank(-1)?),
        depth_hu,
    })
}

/// The points near the plane that contains most of them, weighted by depth.
fn nearly_level(points: Vec<GapPoint>) -> Option<Vec<GapPoint>> {
    /// A plateau slopes by 10 degrees to the back: 4 mm on 25 mm.
    const FIRST_MM: f64 = 7.0;
    const LAST_MM: f64 = 4.0;
    const ROUNDS: usize = 8;
    /// Metal next to a gap does not outweigh all other columns.
    const MOST_HU: f64 = 500.0;
    let weight = |point: &GapPoint| point.depth_hu.min(MOST_HU);
    let support = |level: f64| {
        let near = points
            .iter()
            .filter(|p| (p.level_mm - level).abs() <= FIRST_MM);
        near.map(weight).sum::<f64>()
    };
    let level = points.iter().map(|point| point.level_mm);
    let level = level.max_by(|a, b| support(*a).total_cmp(&support(*b)))?;
    let mut plane = Vector3::new(level, 0.0, 0.0);
    let mut kept = Vec::new();
    for round in 0..ROUNDS {
        let share = round as f64 / (ROUNDS - 1) as f64;
        let reach_mm = FIRST_MM + (LAST_MM - FIRST_MM) * share;
        let origin = points.first()?.place;
        let row = |p: &GapPoint| {
            let d = p.place - origin;
            Vector3::new(1.0, d.x, d.y)
        };
        let near = points
            .iter()
            .filter(|p| (p.level_mm - plane.dot(&row(p))).abs() <= reach_mm);
        kept = near.copied().collect();
        let (mut normal, mut right) = (Matrix3::zeros(), Vector3::zeros());
        for point in &kept {
            let row = row(point);
            normal += row * row.transpose() * weight(point);
            right += row * (point.level_mm * weight(point));
        }
        plane = normal.cholesky()?.solve(&right);
        // Steeper than 20 degrees is not a joint line of a leg cut across its shaft.
        if plane.y.hypot(plane.z) > 0.36 {
            return None;
        }
    }
    Some(kept)
}

fn median(mut values: Vec<f64>) -> f64 {
    if values.is_empty() {
        return 0.0;
    }
    let middle = values.len() / 2;
    *values.select_nth_unstable_by(middle, f64::total_cmp).1
}
