//! Femoral condyles: the notch between them, and the line behind them.

use nalgebra::{Matrix2, Vector2};
use ppa_ct::Volume;

use crate::landmarks::bone_spans::{Lengthwise, Span};
use crate::landmarks::hull::longest;
use crate::landmarks::knee_gap::density;

/// Smallest HU of spongy bone in condyles and plateau; muscle with contrast agent stays below.
const SOLID_HU: f64 = 130.0;

/// Smallest HU of cortex in the condyles, as for bone elsewhere.
const CORTEX_HU: f64 = 200.0;

/// Direction in which a knee faces, across the limb, in coordinates of a [`Lengthwise`].
#[derive(Debug, Clone, Copy)]
pub(crate) struct Facing {
    /// Unit direction to the back.
    pub(crate) posterior: Vector2<f64>,
    /// Middle of the intercondylar notch from side to side: its place along [`Self::aside`].
    pub(crate) notch_mm: f64,
    /// Whether [`Self::posterior`] is perpendicular to the posterior condylar line; otherwise to the longest extent of the bones,
    /// since the scan does not show the back of both condyles.
    pub(crate) by_condyles: bool,
}

impl Facing {
    /// Unit direction from side to side.
    pub(crate) fn aside(&self) -> Vector2<f64> {
        side_of(&self.posterior)
    }
}

fn side_of(posterior: &Vector2<f64>) -> Vector2<f64> {
    Vector2::new(-posterior.y, posterior.x)
}

/// A femur above a gap and what lies below it.
pub(crate) struct Condyles<'a> {
    pub(crate) volume: &'a Volume,
    pub(crate) frame: &'a Lengthwise,
    /// Level of the gap, mm.
    pub(crate) gap_mm: f64,
    /// Slices of the broad stretch around the gap.
    pub(crate) broad: &'a [&'a Span],
}

impl Condyles<'_> {
    /// Direction in which the knee faces; `None` if no notch opens to the back above the gap, or if one does below it: no knee,
    /// or one upside down.
    pub(crate) fn facing(&self) -> Option<Facing> {
        let weight: f64 = self.broad.iter().map(|span| span.hull.area_mm2).sum();
        let (mut centre, mut moments) = (Vector2::zeros(), Matrix2::zeros());
        for span in self.broad {
            centre += span.hull.centre * (span.hull.area_mm2 / weight);
            moments += span.hull.moments;
        }
        let axis = side_of(&longest(&moments));
        let posterior = axis * self.behind(&centre, &axis)?;
        let rear = self.rear(&centre, &posterior);
        let line = self.condylar_line(&rear, &centre, &posterior);
        let (posterior, by_condyles) = match line {
            Some(line) => (line, true),
            None => (posterior, false),
        };
        let rear_mm = rear
            .iter()
            .map(|p| p.dot(&posterior))
            .max_by(f64::total_cmp)?;
        let notch_mm = self.notch(&centre, &posterior, rear_mm)?;
        Some(Facing {
            posterior,
            notch_mm,
            by_condyles,
        })
    }

    /// 1 if the back is towards `axis`, −1 if it is opposite: between the condyles there is bone in front only.
    fn behind(&self, centre: &Vector2<f64>, axis: &Vector2<f64>) -> Option<f64> {
        const LEAST_MM: f64 = 4.0;
        let side = side_of(axis);
        let mean = |asides: &[f64]| {
            let (mut sum, mut count) = (0.0, 0_u32);
            for above in steps(8.0, 28.0, 2.0) {
                for aside in asides {
                    for back in steps(-40.0, 40.0, 2.0) {
                        let place = centre + side * *aside + axis * back;
                        let hu = density(self.volume, self.frame, &place, self.gap_mm + above);
                        if hu.is_some_and(|hu| hu >= SOLID_HU) {
                            sum += back;
                            count += 1;
                        }
                    }
                }
            }
            (count > 0).then(|| sum / f64::from(count))
        };
        let condyles = mean(&[-28.0, -24.0, -20.0, -16.0, 16.0, 20.0, 24.0, 28.0])?;
        let between = mean(&[-5.0, -2.5, 0.0, 2.5, 5.0]).unwrap_or(condyles);
        let shift = condyles - between;
        (shift.abs() >= LEAST_MM).then(|| shift.signum())
    }

    /// Points where lines from behind meet the femur.
    fn rear(&self, centre: &Vector2<f64>, posterior: &Vector2<f64>) -> Vec<Vector2<f64>> {
        /// Thicker than the walls of vessels.
        const CORTEX_MM: f64 = 3.0;
        const STEP_MM: f64 = 0.5;
        let side = side_of(posterior);
        let ends = self.broad.iter().map(|span| span.hull.extent(posterior)[1]);
        let Some(far) = ends.max_by(f64::total_cmp) else {
            return Vec::new();
        };
        let far = far - centre.dot(posterior) + 4.0;
        let mut points = Vec::new();
        for above in steps(6.0, 34.0, 2.0) {
            let hu = |aside: f64, back: f64| {
                let place = centre + side * aside + posterior * back;
                let point = self.frame.point(&place, self.gap_mm + above);
                self.volume.sample(&point)
            };
            for aside in steps(-45.0, 45.0, 1.5) {
                let mut before = None;
                for back in steps(0.0, far, STEP_MM).map(|forward| far - forward) {
                    let Some(here) = hu(aside, back) else {
                        continue;
                    };
                    let inwards = steps(0.0, CORTEX_MM, STEP_MM).map(|d| hu(aside, back - d));
                    if here >= CORTEX_HU && inwards.flatten().all(|hu| hu >= SOLID_HU) {
                        let beyond = match before {
                            Some(hu) if hu < CORTEX_HU => {
                                STEP_MM * (here - CORTEX_HU) / (here - hu)
                            }
                            _ => 0.0,
                        };
                        points.push(centre + side * aside + posterior * (back + beyond));
                        break;
                    }
                    before = Some(here);
                }
            }
        }
        points
    }

    /// Unit direction to the back, perpendicular to the line that touches both condyles from behind; `None` if the scan cuts one.
    fn condylar_line(
        &self,
        rear: &[Vector2<f64>],
        centre: &Vector2<f64>,
        posterior: &Vector2<f64>,
    ) -> Option<Vector2<f64>> {
        const ROUNDS: usize = 20;
        const HALF_NOTCH_MM: f64 = 8.0;
        let mut posterior = *posterior;
        let mut touched = [Vector2::zeros(); 2];
        for _ in 0..ROUNDS {
            let side = side_of(&posterior);
            let last = |sign: f64| {
                let beside = |p: &&Vector2<f64>| sign * (*p - centre).dot(&side) > HALF_NOTCH_MM;
                hindmost(rear.iter().filter(beside).copied().collect(), &posterior)
            };
            touched = [last(-1.0)?, last(1.0)?];
            let line = (touched[1] - touched[0]).normalize();
            let turned = Vector2::new(line.y, -line.x);
            let turned = turned * turned.dot(&posterior).signum();
            let still = (turned - posterior).norm() < 1e-6;
            posterior = turned;
            if still {
                break;
            }
        }
        let side = side_of(&posterior);
        let whole = |p: &Vector2<f64>, outwards: f64| self.shows(&(p + side * (4.0 * outwards)));
        (whole(&touched[0], -1.0) && whole(&touched[1], 1.0)).then_some(posterior)
    }

    /// Whether the scan shows a place above the gap.
    fn shows(&self, place: &Vector2<f64>) -> bool {
        let point = self.frame.point(place, self.gap_mm + 15.0);
        self.volume.sample(&point).is_some()
    }

    /// Middle of the notch along the side, mean over rows in front of the back of the condyles; `None` when most rows above
    /// the gap show none, or rows below it show one nearly as often.
    fn notch(&self, centre: &Vector2<f64>, posterior: &Vector2<f64>, rear_mm: f64) -> Option<f64> {
        let side = side_of(posterior);
        let rows = |levels: &[f64]| {
            let mut holes = Vec::new();
            for above in levels {
                for forward in [12.0, 16.0, 20.0] {
                    let level_mm = self.gap_mm + above;
                    let is_solid = |aside: f64, forward: f64| {
                        let back = rear_mm - forward - centre.dot(posterior);
                        let place = centre + side * aside + posterior * back;
                        let hu = density(self.volume, self.frame, &place, level_mm);
                        hu.is_some_and(|hu| hu >= SOLID_HU)
                    };
                    let row = steps(-45.0, 45.0, 1.0).filter(|aside| is_solid(*aside, forward));
                    let hole = widest_hole(&row.collect::<Vec<f64>>());
                    // A notch opens to the back, unlike marrow inside a shell.
                    let is_open = |aside: &f64| {
                        !steps(-2.0, forward, 1.0).any(|ahead| is_solid(*aside, ahead))
                    };
                    holes.push(hole.filter(is_open));
                }
            }
            holes
        };
        let share = |holes: &[Option<f64>]| {
            holes.iter().flatten().count() as f64 / holes.len().max(1) as f64
        };
        let above = rows(&[6.0, 9.0, 12.0, 15.0, 18.0]);
        let below = rows(&[-8.0, -10.0, -12.0, -14.0]);
        let (above_share, below_share) = (share(&above), share(&below));
        if above_share < 0.5 || below_share > above_share - 0.3 {
            return None;
        }
        let middles: Vec<f64> = above.into_iter().flatten().collect();
        Some(centre.dot(&side) + middles.iter().sum::<f64>() / middles.len() as f64)
    }
}

/// Middle of the widest hole in a row of places, when it is as wide as a notch.
fn widest_hole(solid: &[f64]) -> Option<f64> {
    /// Narrower at the top of the notch, wider where condyles turn up in front and behind.
    const NOTCH_MM: std::ops::Range<f64> = 8.0..45.0;
    let holes = solid
        .windows(2)
        .map(|pair| (pair[1] - pair[0], 0.5 * (pair[0] + pair[1])));
    let (width, middle) = holes.max_by(|a, b| a.0.total_cmp(&b.0))?;
    NOTCH_MM.contains(&width).then_some(middle)
}

/// Mean of the five points farthest to the back.
fn hindmost(mut points: Vec<Vector2<f64>>, posterior: &Vector2<f64>) -> Option<Vector2<f64>> {
    const MOST: usize = 5;
    points.sort_by(|a, b| b.dot(posterior).total_cmp(&a.dot(posterior)));
    points.truncate(MOST);
    let n = points.len() as f64;
    (n > 0.0).then(|| points.iter().sum::<Vector2<f64>>() / n)
}

fn steps(from: f64, to: f64, step: f64) -> impl Iterator<Item = f64> {
    (0..=((to - from) / step) as usize).map(move |i| from + i as f64 * step)
}
