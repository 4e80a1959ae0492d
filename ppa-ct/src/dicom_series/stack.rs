//! Slices in space: order, spacing, and whether they form one lattice.

mod gaps;
mod steps;

use std::path::Path;

use nalgebra::{Affine3, Matrix4};

use super::frame::Frame;
use super::header::Slice;
use crate::error::ReadError;
use crate::grid::{Grid, GridError};
use crate::scan::{Warning, WarningCode};
pub(super) use gaps::Between;
use gaps::{fill, filled};
use steps::Steps::{Even, Uneven};
use steps::{distinct_places, even_step};

/// Largest tilt of the step from the normal that is attributed to rounding rather than a tilted gantry.
const TILT_DEG: f64 = 0.5;

/// The lattice that a series spans.
#[derive(Debug)]
pub(super) struct Stack {
    order: Vec<usize>,
    /// Place of each lattice slice among the sorted slices; `None` if the two are the same.
    between: Option<Vec<Between>>,
    size: [usize; 3],
    ct_from_voxel: Affine3<f64>,
    warnings: Vec<Warning>,
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
                        "a single slice: its thickness of {thickness_mm} mm is used as the step"
                    ),
                });
                normal * thickness_mm
            }
            _ => {
                let heights = order.iter().map(|&i| along(i)).collect::<Vec<_>>();
                let positions = order.iter().map(|&i| slices[i].frame.position);
                let positions = positions.collect::<Vec<_>>();
                distinct_places(source, &positions, &heights)?;
                match even_step(source, &positions, &heights)? {
                    Even(step) => step,
                    Uneven(uneven) if !fill_gaps => return Err(uneven),
                    Uneven(_) => {
                        let (step, places) = fill(source, &positions)?;
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
                    "the slice step deviates by {tilt_deg:.2} degrees from the slice normal (tilted gantry); \
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

    /// Indices of the given slices from first to last along k.
    pub(super) fn order(&self) -> &[usize] {
        &self.order
    }

    /// Places of the lattice slices among the sorted slices; `None` if the two are the same.
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

    /// Warnings about the geometry.
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
        let text = |f: &Frame| format!("{} mm", ppa_core::text::numbers(f.spacing_mm));
        return Err(mixed("the pixel spacing", text(slice), text(first)));
    }
    let turned = (slice.along_row - first.along_row)
        .norm()
        .max((slice.down_column - first.down_column).norm());
    if turned > 1e-3 {
        let text = |f: &Frame| {
            let [u, v] = [f.along_row, f.down_column];
            let [u, v] = [u, v].map(|axis| ppa_core::text::numbers(axis.iter().copied()));
            format!("({u:.4}), ({v:.4})")
        };
        return Err(mixed("the orientation", text(slice), text(first)));
    }
    Ok(())
}
