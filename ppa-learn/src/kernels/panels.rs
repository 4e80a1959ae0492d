//! Weights of a pointwise convolution in the order in which its kernel reads them.

use pulp::{Simd, WithSimd};

use super::batch_norm::Affine;
use super::buffer::{Buffer, Pool};
use super::simd::{dispatch, lanes, lanes_mut};

/// Number of channels that are laid out together, equal to the lanes of the widest vectors.
pub(super) const PANEL: usize = 16;

/// Weights of a pointwise convolution with the normalisation after it folded in, in the order in which the kernel reads them.
///
/// Channels are in groups that fit the kernel's registers, with zeros after the last channel; each group is [columns, width].
#[derive(Debug)]
pub struct Panels {
    pub(super) values: Buffer,
    pub(super) shift: Vec<f32>,
    channels: usize,
    columns: usize,
}

/// Returns the first channel and the width of each group, of at most `widest` panels.
///
/// If three panels fit, a group has at least two, unless there is only one panel: a single vector would wait for its sums.
pub(super) fn groups(channels: usize, widest: usize) -> impl Iterator<Item = (usize, usize)> {
    let mut first = 0;
    std::iter::from_fn(move || {
        let left = channels.saturating_sub(first).div_ceil(PANEL);
        let panels = if widest == 3 && left == 4 {
            2
        } else {
            left.min(widest)
        };
        let group = (first, panels * PANEL);
        first += group.1;
        (panels > 0).then_some(group)
    })
}

/// Returns the maximum number of panels of a group: as many as fill the registers with sums of a few pixels.
pub(super) fn widest<S: Simd>() -> usize {
    if S::F32_LANES == PANEL { 3 } else { 1 }
}

impl Panels {
    /// Lays out weights [channels, columns] with the normalisation of their output.
    pub fn new(weight: &[f32], affine: &Affine, pool: &Pool) -> Self {
        let channels = affine.scale.len();
        let columns = weight.len() / channels;
        let padded = channels.next_multiple_of(PANEL);
        let mut shift = affine.shift.clone();
        shift.resize(padded, 0.0);
        let mut values = pool.take(padded * columns);
        let lay_out = LayOut {
            weight,
            scale: &affine.scale,
            values: &mut values,
        };
        dispatch(PANEL, lay_out);
        Self {
            values,
            shift,
            channels,
            columns,
        }
    }

    /// Returns the number of output channels.
    pub fn channels(&self) -> usize {
        self.channels
    }

    /// Returns the number of input channels.
    pub fn columns(&self) -> usize {
        self.columns
    }

    /// Returns the weights with each input channel multiplied by its gate.
    pub fn gated(&self, gate: &[f32], pool: &Pool) -> Self {
        let mut values = pool.take(self.values.len());
        let to = &mut values;
        dispatch(
            PANEL,
            Gate {
                panels: self,
                gate,
                to,
            },
        );
        Self {
            values,
            shift: self.shift.clone(),
            ..*self
        }
    }
}

pub(super) struct LayOut<'a> {
    pub weight: &'a [f32],
    pub scale: &'a [f32],
    pub values: &'a mut [f32],
}

impl WithSimd for LayOut<'_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, _: S) {
        let columns = self.weight.len() / self.scale.len();
        for (first, width) in groups(self.scale.len(), widest::<S>()) {
            let group = &mut self.values[first * columns..][..width * columns];
            for start in (0..width).step_by(PANEL) {
                let rows = self.weight.chunks_exact(columns).zip(self.scale);
                let mut panel = [(&[][..], 0.0); PANEL];
                let rows = rows.skip(first + start);
                panel
                    .iter_mut()
                    .zip(rows)
                    .for_each(|(to, (row, scale))| *to = (row, *scale));
                turn(panel, width, start, group);
            }
        }
    }
}

/// Writes rows of weights times their scale as columns of a group [columns, width] from column `start` on, with zeros for empty rows.
fn turn(rows: [(&[f32], f32); PANEL], width: usize, start: usize, group: &mut [f32]) {
    for (number, group) in group.chunks_mut(PANEL * width).enumerate() {
        // One block of known size at a time.
        let mut block = [[0.0; PANEL]; PANEL];
        for (to, (row, _)) in block.iter_mut().zip(&rows) {
            let row = row.get(number * PANEL..).unwrap_or_default();
            match row.first_chunk() {
                Some(row) => *to = *row,
                None => to[..row.len()].copy_from_slice(row),
            }
        }
        for (k, group) in group.chunks_exact_mut(width).enumerate() {
            for (i, to) in group[start..start + PANEL].iter_mut().enumerate() {
                *to = block[i][k] * rows[i].1;
            }
        }
    }
}

struct Gate<'a> {
    panels: &'a Panels,
    gate: &'a [f32],
    to: &'a mut [f32],
}

impl WithSimd for Gate<'_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) {
        let columns = self.panels.columns;
        for (first, width) in groups(self.panels.channels, widest::<S>()) {
            let group = first * columns..(first + width) * columns;
            let from = lanes::<S>(&self.panels.values[group.clone()]);
            let to = lanes_mut::<S>(&mut self.to[group]);
            let width = width / S::F32_LANES;
            let rows = to.chunks_exact_mut(width).zip(from.chunks_exact(width));
            for ((to, from), gate) in rows.zip(self.gate) {
                let gate = simd.splat_f32s(*gate);
                for (to, from) in to.iter_mut().zip(from) {
                    *to = simd.mul_f32s(*from, gate);
                }
            }
        }
    }
}
