//! Ring buffer of image rows with channels in separate panels, in the order in which a depthwise convolution reads them.

use super::buffer::{Buffer, Pool};
use super::panels::PANEL;

/// Rows of an activated image, [panels, rows, width + 2 padding, [`PANEL`]], zero in the padding and in channels that fill up the last panel.
/// Row `y` replaces row `y - count`.
pub struct PanelRows {
    /// A row of zeros, followed by the panels.
    values: Buffer,
    count: usize,
    height: usize,
    width: usize,
    padding: usize,
}

impl PanelRows {
    /// Allocates `count` rows of an image.
    pub fn new(
        pool: &Pool,
        count: usize,
        [height, width]: [usize; 2],
        padding: usize,
        channels: usize,
    ) -> Self {
        let row = (width + 2 * padding) * PANEL;
        let mut values = pool.take(row + channels.div_ceil(PANEL) * count * row);
        let (zeros, rows) = values.split_at_mut(row);
        zeros.fill(0.0);
        for row in rows.chunks_exact_mut(row) {
            row[..padding * PANEL].fill(0.0);
            row[(padding + width) * PANEL..].fill(0.0);
        }
        Self {
            values,
            count,
            height,
            width,
            padding,
        }
    }

    fn row(&self) -> usize {
        (self.width + 2 * self.padding) * PANEL
    }

    /// Returns the number of values from a pixel in one panel to the same pixel in the next one.
    pub fn panel(&self) -> usize {
        self.count * self.row()
    }

    /// Returns the index of the first pixel of a row in [`values_mut`](Self::values_mut), in the first panel and without padding.
    pub fn start(&self, y: usize) -> usize {
        self.row() * (1 + y % self.count) + self.padding * PANEL
    }

    pub fn values_mut(&mut self) -> &mut [f32] {
        &mut self.values
    }

    /// Returns `K` padded rows from row `first` on; zeros above and below the image.
    pub fn under<const K: usize>(&self, first: isize) -> Under<'_, K> {
        let row = self.row();
        let place = |ky| match usize::try_from(first + ky as isize) {
            Ok(y) if y < self.height => (row * (1 + y % self.count), self.panel()),
            _ => (0, 0),
        };
        Under {
            values: &self.values,
            places: std::array::from_fn(place),
            row,
        }
    }
}

/// Rows under a kernel.
#[derive(Clone, Copy)]
pub struct Under<'a, const K: usize> {
    values: &'a [f32],
    /// Start of each row in the first panel, and the step to the next panel.
    places: [(usize, usize); K],
    row: usize,
}

impl<'a, const K: usize> Under<'a, K> {
    /// Returns the rows in one panel.
    pub fn panel(&self, panel: usize) -> [&'a [f32]; K] {
        (self.places).map(|(start, step)| &self.values[start + panel * step..][..self.row])
    }
}
