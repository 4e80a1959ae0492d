//! Differential scattering of one material at all lines, stored contiguously for vector code.

use crate::engine::scatter_table::ScatterTable;
use crate::vector_math::WIDTH;

/// Quantities of a row: Compton and Rayleigh scattering, mean energy after Compton scattering.
const KINDS: usize = 3;

/// [`ScatterTable`]s of all lines: step by step, quantity by quantity, line by line.
#[derive(Debug)]
pub(crate) struct LineScattering {
    values: Vec<f32>,
    /// Number of lines, padded.
    width: usize,
}

/// Values of a [`LineScattering`] at one angle, line by line.
#[derive(Debug, Default)]
pub(crate) struct LinesAtAngle {
    values: Vec<f32>,
}

impl LineScattering {
    pub fn new(tables: &[ScatterTable]) -> Self {
        let width = tables.len().next_multiple_of(WIDTH);
        let steps = tables.first().map_or(0, |table| table.rows().len());
        let mut values = vec![0.0; steps * KINDS * width];
        for (line, table) in tables.iter().enumerate() {
            for (step, row) in table.rows().iter().enumerate() {
                for (kind, value) in row.iter().enumerate() {
                    values[(step * KINDS + kind) * width + line] = *value;
                }
            }
        }
        Self { values, width }
    }

    /// Interpolates at an angle given by [`ScatterTable::locate`].
    pub fn at(&self, (step, fraction): (usize, f32), found: &mut LinesAtAngle) {
        let row = KINDS * self.width;
        let (low, high) = self.values[step * row..][..2 * row].split_at(row);
        found.values.clear();
        let pairs = low.iter().zip(high);
        found
            .values
            .extend(pairs.map(|(low, high)| low + fraction * (high - low)));
    }
}

impl LinesAtAngle {
    /// Compton scattering and Rayleigh scattering of a gram, mm⁻¹ per g/cm³ and sr, and the mean energy after Compton
    /// scattering, keV.
    pub fn parts(&self) -> [&[f32]; KINDS] {
        let width = self.values.len() / KINDS;
        std::array::from_fn(|kind| &self.values[kind * width..][..width])
    }
}
