//! Integer tallies of the energy that reaches the detector.

use std::sync::atomic::{AtomicU64, Ordering::Relaxed};

use crate::beam::raster::Raster;

/// Interactions of a detected photon on its way.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum Category {
    /// No interaction.
    Primary,
    /// One Compton scattering, nothing else.
    Compton,
    /// One Rayleigh scattering, nothing else.
    Rayleigh,
    /// Two scatterings or more, or a K x-ray of the phantom.
    Multiple,
}

impl Category {
    /// All four categories, in the order of the layers.
    pub const ALL: [Self; 4] = [Self::Primary, Self::Compton, Self::Rayleigh, Self::Multiple];

    /// Lower-case name, as in layer names and JSON keys.
    pub fn name(self) -> &'static str {
        match self {
            Self::Primary => "primary",
            Self::Compton => "compton",
            Self::Rayleigh => "rayleigh",
            Self::Multiple => "multiple",
        }
    }
}

/// Largest number of histories of a run: no sum overflows, even if all photons of 150 keV hit one cell.
pub(crate) const MOST_HISTORIES: u64 = 500_000_000_000;

/// Energy quantum 1/64 eV: a cell holds 1.9e12 photons of 150 keV before it overflows.
const STEPS_PER_KEV: f64 = 64_000.0;

/// Quantum of the squared energy, 2⁻¹⁰ keV²: room for 8e11 photons of 150 keV in one cell.
const STEPS_PER_KEV2: f64 = 1_024.0;

/// Rounds a non-negative number to the nearest integer; `round` would be a call into the C library.
#[inline]
pub(crate) fn nearest(steps: f64) -> u64 {
    // The cast through i64 is a single instruction.
    (steps + 0.5) as i64 as u64
}

/// Sums of energy and squared energy per cell and category.
///
/// Integer additions commute, so any number of threads may add in any order and the bytes are the same.
#[derive(Debug)]
pub(crate) struct Tally {
    pub raster: Raster,
    sums: Vec<[[AtomicU64; 2]; 4]>,
}

/// First two moments per history of one quantity.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub(crate) struct Moments {
    /// Mean energy, keV per history.
    pub mean_kev: f64,
    /// Mean squared energy, keV² per history.
    pub square_kev2: f64,
}

impl std::iter::Sum for Moments {
    fn sum<I: Iterator<Item = Self>>(moments: I) -> Self {
        moments.fold(Self::default(), |sum, more| Self {
            mean_kev: sum.mean_kev + more.mean_kev,
            square_kev2: sum.square_kev2 + more.square_kev2,
        })
    }
}

/// Mixes the moments, each per own history, of two kinds of photons by their shares of all histories; `share` is that of `those`.
pub(crate) fn mix(these: &mut [Moments], those: &[Moments], share: f64) {
    for (this, that) in these.iter_mut().zip(those) {
        *this = [this.scaled(1.0 - share), that.scaled(share)]
            .into_iter()
            .sum();
    }
}

impl Moments {
    /// Multiplies both moments by `factor`.
    pub fn scaled(self, factor: f64) -> Self {
        Self {
            mean_kev: self.mean_kev * factor,
            square_kev2: self.square_kev2 * factor,
        }
    }

    /// Standard error of the mean over `histories`, each of which scores at most once.
    pub fn standard_error_kev(&self, histories: f64) -> f64 {
        ((self.square_kev2 - self.mean_kev * self.mean_kev).max(0.0) / histories).sqrt()
    }
}

/// Contribution of one photon to one cell.
#[derive(Debug, Clone, Copy)]
struct Hit {
    cell: usize,
    category: Category,
    energy_kev: f64,
    /// Share of the photon that belongs to the cell.
    share: f64,
}

/// Collects photons for a [`Tally`] and adds them in batches, at the latest when dropped.
///
/// Hits are scattered over the detector, mostly outside the cache. Reading the cells of all hits first lets the cache misses overlap,
/// which the additions, each a locked instruction, would not.
#[derive(Debug)]
pub(crate) struct TallyBuffer<'a> {
    tally: &'a Tally,
    hits: Vec<Hit>,
}

impl<'a> TallyBuffer<'a> {
    const ROOM: usize = 128;

    pub fn new(tally: &'a Tally) -> Self {
        Self {
            tally,
            hits: Vec::with_capacity(Self::ROOM),
        }
    }

    /// Counts a photon that crosses the plane at device (x, y); photons outside the raster are ignored.
    #[inline]
    pub fn score(&mut self, x_mm: f64, y_mm: f64, category: Category, energy_kev: f64) {
        if let Some(cell) = self.tally.raster.cell_at(x_mm, y_mm) {
            self.push(Hit {
                cell,
                category,
                energy_kev,
                share: 1.0,
            });
        }
    }

    /// Counts a photon whose energy is spread over a square of `spot` cells, at most 1.
    ///
    /// Its squared energy is divided in the same way as its energy, so that each cell keeps the ratio of squared energy to energy,
    /// and sums over cells are those of whole photons.
    pub fn spread(&mut self, x_mm: f64, y_mm: f64, spot: f64, category: Category, energy_kev: f64) {
        let shares = self.tally.raster.cells_about(x_mm, y_mm, spot);
        for (cell, share) in shares.into_iter().flatten() {
            if share > 0.0 {
                self.push(Hit {
                    cell,
                    category,
                    energy_kev,
                    share,
                });
            }
        }
    }

    #[inline]
    fn push(&mut self, hit: Hit) {
        self.hits.push(hit);
        if self.hits.len() == Self::ROOM {
            self.hand_over();
        }
    }

    #[inline(never)]
    fn hand_over(&mut self) {
        let sums = &self.tally.sums;
        let touched = self.hits.iter().fold(0, |touched, hit| {
            touched ^ sums[hit.cell][hit.category as usize][0].load(Relaxed)
        });
        std::hint::black_box(touched);
        for hit in self.hits.drain(..) {
            self.tally.add(&hit);
        }
    }
}

impl Drop for TallyBuffer<'_> {
    fn drop(&mut self) {
        self.hand_over();
    }
}

impl Tally {
    pub fn new(raster: Raster) -> Self {
        Self {
            raster,
            sums: (0..raster.cells()).map(|_| Default::default()).collect(),
        }
    }

    #[inline]
    fn add(&self, hit: &Hit) {
        let [energy, square] = &self.sums[hit.cell][hit.category as usize];
        let energy_kev = hit.share * hit.energy_kev;
        energy.fetch_add(nearest(energy_kev * STEPS_PER_KEV), Relaxed);
        square.fetch_add(
            nearest(energy_kev * hit.energy_kev * STEPS_PER_KEV2),
            Relaxed,
        );
    }

    /// Number of bytes of [`Tally::to_bytes`] for a raster, or `None` on overflow.
    pub fn byte_len_of(raster: &Raster) -> Option<usize> {
        raster.columns.checked_mul(raster.rows)?.checked_mul(64)
    }

    /// Number of bytes of [`Tally::to_bytes`].
    pub fn byte_len(&self) -> usize {
        64 * self.sums.len()
    }

    /// Serialises all sums, cell by cell, little-endian.
    pub fn to_bytes(&self) -> Vec<u8> {
        let words = self.sums.iter().flatten().flatten();
        words
            .flat_map(|sum| sum.load(Relaxed).to_le_bytes())
            .collect()
    }

    /// Adds the sums of [`Tally::to_bytes`] from a tally of the same raster; `None` on overflow.
    pub fn add_bytes(&mut self, bytes: &[u8]) -> Option<()> {
        assert_eq!(bytes.len(), self.byte_len(), "tallies of one raster");
        let sums = self.sums.iter_mut().flatten().flatten();
        for (sum, bytes) in sums.zip(bytes.chunks_exact(8)) {
            let word = u64::from_le_bytes(bytes.try_into().expect("8 bytes"));
            *sum.get_mut() = sum.get_mut().checked_add(word)?;
        }
        Some(())
    }

    /// Moments per history of every cell, row-major.
    pub fn moments(&self, category: Category, histories: u64) -> Vec<Moments> {
        self.sums
            .iter()
            .map(|cell| {
                let [energy, square] = &cell[category as usize];
                moments(
                    u128::from(energy.load(Relaxed)),
                    u128::from(square.load(Relaxed)),
                    histories,
                )
            })
            .collect()
    }

    /// Moments per history of the whole raster.
    pub fn total(&self, category: Category, histories: u64) -> Moments {
        let (mut energy, mut square) = (0, 0);
        for cell in &self.sums {
            energy += u128::from(cell[category as usize][0].load(Relaxed));
            square += u128::from(cell[category as usize][1].load(Relaxed));
        }
        moments(energy, square, histories)
    }
}

fn moments(energy: u128, square: u128, histories: u64) -> Moments {
    let histories = histories as f64;
    Moments {
        mean_kev: energy as f64 / STEPS_PER_KEV / histories,
        square_kev2: square as f64 / STEPS_PER_KEV2 / histories,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Sums over cells are those of whole photons.
    #[test]
    fn spread_photons_keep_energy_and_square() {
        let raster = Raster {
            columns: 3,
            rows: 3,
            centre_mm: [0.0; 2],
            extent_mm: [3.0; 2],
        };
        let tally = Tally::new(raster);
        let mut buffer = TallyBuffer::new(&tally);
        buffer.spread(0.4, -0.3, 0.9, Category::Rayleigh, 60.0);
        buffer.spread(1.49, 1.49, 0.9, Category::Rayleigh, 40.0);
        buffer.spread(1.6, 0.0, 0.9, Category::Rayleigh, 30.0);
        drop(buffer);
        let total = tally.total(Category::Rayleigh, 1);
        assert!((total.mean_kev - 100.0).abs() < 1e-4, "{}", total.mean_kev);
        assert!(
            (total.square_kev2 - 5_200.0).abs() < 1e-2,
            "{}",
            total.square_kev2
        );
    }
}
