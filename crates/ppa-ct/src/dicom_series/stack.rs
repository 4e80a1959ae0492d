//! Slices in space: their order, their step, and whether they make one lattice.

use std::path::Path;

use nalgebra::{Affine3, Matrix4, Point3, Vector3};

use super::frame::Frame;
use super::header::Slice;
use crate::error::{Gap, ReadError};
use crate::grid::{Grid, GridError};
use crate::scan::{Warning, WarningCode};

/// Two slices closer than this lie in the same place.
const SAME_PLACE_MM: f64 = 1e-3;
/// How far a slice may lie from its place on the lattice: positions rounded to 0.1 mm pass.
const OFF_LATTICE_MM: f64 = 0.1;
/// The same for small steps, as a fraction of the step; one missing slice moves others by 0.5.
const OFF_LATTICE_STEPS: f64 = 0.2;
/// A step that leans less than this from the normal is rounding, not a tilted gantry.
const TILT_DEG: f64 = 0.5;

/// The lattice that a series spans.
#[derive(Debug)]
pub(super) struct Stack {
    order: Vec<usize>,
    /// For each slice of the lattice its place among the slices in order; `None` where it is one of them.
    between: Option<Vec<Between>>,
    size: [usize; 3],
    ct_from_voxel: Affine3<f64>,
    warnings: Vec<Warning>,
}

/// A place between two slices of a stack.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Between {
    /// The slice below, counted in order; the other is the next one.
    pub below: usize,
    /// Weight of the other, 0 to 1.
    pub weight: f32,
}

impl Stack {
    /// Sorts the slices of one series (at least one) by position along their normal and fits the lattice.
    ///
    /// The step comes from the first and last position, never from Slice Thickness; it need not
    /// be along the normal. Uneven steps are an error unless `fill_gaps` asks for slices in between.
    pub(super) fn of(source: &Path, slices: &[Slice], fill_gaps: bool) -> Result<Self, ReadError> {
        let first = &slices[0];
        for slice in &slices[1..] {
            same_lattice(first, slice)?;
        }
        let frame = &first.frame;
        let normal = frame.along_row.cross(&frame.down_column).normalize();
        let mut order = (0..slices.len()).collect::<Vec<_>>();
        let along = |index: usize| slices[index].frame.position.coords.dot(&normal);
        order.sort_by(|&a, &b| along(a).total_cmp(&along(b)));

        let mut warnings = Vec::new();
        let mut between = None;
        let step = match order.len() {
            1 => {
                let thickness_mm = frame.thickness_mm.ok_or_else(|| ReadError::MissingTag {
                    path: first.file.path.clone(),
                    tag: "SliceThickness",
                })?;
                warnings.push(Warning {
                    code: WarningCode::SingleSlice,
                    text: format!(
                        "a single slice: its thickness of {thickness_mm} mm stands in for the step"
                    ),
                });
                normal * thickness_mm
            }
            _ => {
                let heights = order.iter().map(|&i| along(i)).collect::<Vec<_>>();
                distinct_places(source, slices, &order, &heights)?;
                let positions = order.iter().map(|&i| slices[i].frame.position);
                let positions = positions.collect::<Vec<_>>();
                match even_step(source, &positions, &heights) {
                    Ok(step) => step,
                    Err(uneven) if !fill_gaps => return Err(uneven),
                    Err(uneven) => {
                        let (step, places) = fill(&positions).ok_or(uneven)?;
                        warnings.push(filled(order.len(), &places));
                        between = Some(places);
                        step
                    }
                }
            }
        };
        let tilt_deg = step.angle(&normal).to_degrees();
        if tilt_deg > TILT_DEG {
            warnings.push(Warning {
                code: WarningCode::GantryTilt,
                text: format!(
                    "the slice step leans {tilt_deg:.2} degrees from the slice normal (tilted gantry); \
                     the sheared affine is kept exactly"
                ),
            });
        }

        let mut matrix = Matrix4::identity();
        let columns = [
            frame.along_row * frame.spacing_mm[0],
            frame.down_column * frame.spacing_mm[1],
            step,
            slices[order[0]].frame.position.coords,
        ];
        for (axis, column) in columns.iter().enumerate() {
            matrix.fixed_view_mut::<3, 1>(0, axis).copy_from(column);
        }
        Ok(Self {
            size: [
                first.image.columns,
                first.image.rows,
                between.as_ref().map_or(order.len(), Vec::len),
            ],
            order,
            between,
            ct_from_voxel: Affine3::from_matrix_unchecked(matrix),
            warnings,
        })
    }

    /// Slices (as given) from the first to the last along k.
    pub(super) fn order(&self) -> &[usize] {
        &self.order
    }

    /// Where the slices of the lattice lie among those in order; `None` where they are the same.
    pub(super) fn between(&self) -> Option<&[Between]> {
        self.between.as_deref()
    }

    /// Slices of the lattice, counted along k, that are interpolated.
    pub(super) fn made_up(&self) -> Vec<usize> {
        let between = self.between().unwrap_or_default();
        let made_up = between.iter().enumerate();
        let made_up = made_up.filter(|(_, place)| !matches!(place.weight, 0.0 | 1.0));
        made_up.map(|(k, _)| k).collect()
    }

    /// The lattice of voxel centres.
    pub(super) fn grid(&self) -> Result<Grid, GridError> {
        Grid::new(self.size, self.ct_from_voxel)
    }

    /// What was odd about the geometry.
    pub(super) fn warnings(&self) -> impl Iterator<Item = Warning> {
        self.warnings.iter().cloned()
    }
}

/// Refuses a slice whose size, spacing or orientation differs from the first.
fn same_lattice(first: &Slice, slice: &Slice) -> Result<(), ReadError> {
    let mixed = |what, found: String, expected: String| ReadError::Mixed {
        path: slice.file.path.clone(),
        what,
        found,
        expected,
    };
    let size = |s: &Slice| format!("{} x {} pixels", s.image.columns, s.image.rows);
    if size(first) != size(slice) {
        return Err(mixed("the image size", size(slice), size(first)));
    }
    let (first, slice) = (&first.frame, &slice.frame);
    let [du, dv] = [0, 1].map(|axis| {
        (slice.spacing_mm[axis] - first.spacing_mm[axis]).abs() / first.spacing_mm[axis]
    });
    // Over 512 pixels, a relative difference of 1e-4 shifts the far edge by a twentieth of a pixel.
    if du.max(dv) > 1e-4 {
        let text = |f: &Frame| format!("{:?} mm", f.spacing_mm);
        return Err(mixed("the pixel spacing", text(slice), text(first)));
    }
    let turned = (slice.along_row - first.along_row)
        .norm()
        .max((slice.down_column - first.down_column).norm());
    if turned > 1e-3 {
        let text = |f: &Frame| {
            let [u, v] = [f.along_row, f.down_column];
            format!(
                "[{:.4}, {:.4}, {:.4}], [{:.4}, {:.4}, {:.4}]",
                u.x, u.y, u.z, v.x, v.y, v.z
            )
        };
        return Err(mixed("the orientation", text(slice), text(first)));
    }
    Ok(())
}

fn distinct_places(
    source: &Path,
    slices: &[Slice],
    order: &[usize],
    heights: &[f64],
) -> Result<(), ReadError> {
    let (mut positions, mut start) = (1, 0);
    let mut crowd = 0..1;
    for k in 1..=heights.len() {
        let apart = k == heights.len() || heights[k] - heights[k - 1] > SAME_PLACE_MM;
        if !apart {
            continue;
        }
        if k - start > crowd.len() {
            crowd = start..k;
        }
        if k < heights.len() {
            positions += 1;
        }
        start = k;
    }
    if crowd.len() == 1 {
        return Ok(());
    }
    Err(ReadError::SamePosition {
        path: source.to_owned(),
        slices: crowd.len(),
        position_mm: slices[order[crowd.start]].frame.position.coords.into(),
        total: slices.len(),
        positions,
    })
}

/// The step from slice to slice, if every slice lies on the lattice that the ends span.
fn even_step(
    source: &Path,
    positions: &[Point3<f64>],
    heights: &[f64],
) -> Result<Vector3<f64>, ReadError> {
    let at = |k: usize| positions[k];
    let last = positions.len() - 1;
    let step = (at(last) - at(0)) / last as f64;
    let slack_mm =
        OFF_LATTICE_MM.min(OFF_LATTICE_STEPS * (heights[last] - heights[0]) / last as f64);
    let off_mm = |k: usize| (at(k) - (at(0) + step * k as f64)).norm();
    if (1..last).all(|k| off_mm(k) <= slack_mm) {
        return Ok(step);
    }
    let (steps, expected_mm) = steps(positions);
    let differs = |found_mm: f64, by_mm: f64| (found_mm - expected_mm).abs() > by_mm;
    let worst_mm = steps
        .iter()
        .map(|s| (s - expected_mm).abs())
        .fold(0.0, f64::max);
    // A slow drift has no single step out of line: then the worst ones are named.
    let by_mm = slack_mm.min(0.999 * worst_mm);
    Err(ReadError::UnevenSteps {
        path: source.to_owned(),
        expected_mm,
        gaps: (0..last)
            .filter(|&k| differs(steps[k], by_mm))
            .map(|k| Gap {
                after_slice: k,
                found_mm: steps[k],
            })
            .collect(),
    })
}

/// The distances of neighbours and the usual one: the lower median, which of a right and a doubled step is the right one.
fn steps(positions: &[Point3<f64>]) -> (Vec<f64>, f64) {
    let steps = positions.windows(2).map(|pair| (pair[1] - pair[0]).norm());
    let steps = steps.collect::<Vec<_>>();
    let mut sorted = steps.clone();
    sorted.sort_by(f64::total_cmp);
    let usual = sorted[(sorted.len() - 1) / 2];
    (steps, usual)
}

/// An even lattice from the first to the last of uneven positions, and where its slices lie between those.
///
/// `None` where the positions do not lie on one line: no lattice would hold them.
fn fill(positions: &[Point3<f64>]) -> Option<(Vector3<f64>, Vec<Between>)> {
    let whole = positions[positions.len() - 1] - positions[0];
    let along = |p: &Point3<f64>| (p - positions[0]).dot(&whole) / whole.norm();
    let strays =
        |p: &Point3<f64>| (p - positions[0] - whole.normalize() * along(p)).norm() > OFF_LATTICE_MM;
    if positions.iter().any(strays) {
        return None;
    }
    let usual_mm = steps(positions).1;
    let count = (whole.norm() / usual_mm).round();
    // Far more slices than there are would be made up, not filled in.
    if !(1.0..=1e5).contains(&count) {
        return None;
    }
    let step = whole / count;
    let places = (0..=count as usize).map(|k| {
        let height = k as f64 * step.norm();
        let above = positions.iter().position(|p| along(p) > height);
        let above = above.unwrap_or(positions.len() - 1).max(1);
        let [low, high] = [above - 1, above].map(|n| along(&positions[n]));
        let weight = ((height - low) / (high - low)).clamp(0.0, 1.0);
        // Rounded positions do not blur slices that are there.
        let slack = OFF_LATTICE_MM.min(OFF_LATTICE_STEPS * usual_mm) / (high - low);
        let weight = if weight < slack {
            0.0
        } else if weight > 1.0 - slack {
            1.0
        } else {
            weight
        };
        Between {
            below: above - 1,
            weight: weight as f32,
        }
    });
    Some((step, places.collect()))
}

fn filled(found: usize, places: &[Between]) -> Warning {
    let made = places.iter().filter(|p| !matches!(p.weight, 0.0 | 1.0));
    Warning {
        code: WarningCode::GapsFilled,
        text: format!(
            "{found} slices are not evenly spaced: {} of the {} slices here are interpolated between their neighbours",
            made.count(),
            places.len()
        ),
    }
}
