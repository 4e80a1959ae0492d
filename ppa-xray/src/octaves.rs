//! Grids with a fixed number of equal steps per octave, indexed by the bits of a number instead of its logarithm.

/// Nodes at 2^k (1 + i / 2^bits); the bin of a value and the position inside it cost a shift and a mask.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Octaves {
    first_key: u64,
    /// Number of bins, one less than the nodes.
    bins: usize,
    shift: u32,
}

impl Octaves {
    /// Grid with 2^`bits` bins per octave whose nodes enclose `low` to `high`, both positive.
    pub(crate) fn covering(low: f64, high: f64, bits: u32) -> Self {
        let shift = f64::MANTISSA_DIGITS - 1 - bits;
        let first_key = low.to_bits() >> shift;
        let last_key = (high.to_bits() >> shift) + 1;
        Self {
            first_key,
            bins: (last_key - first_key) as usize,
            shift,
        }
    }

    /// The same grid with every bin divided into 2^`bits` equal bins.
    pub(crate) fn refined(self, bits: u32) -> Self {
        Self {
            first_key: self.first_key << bits,
            bins: self.bins << bits,
            shift: self.shift - bits,
        }
    }

    /// Position of node `index`.
    pub(crate) fn node(&self, index: usize) -> f64 {
        f64::from_bits((self.first_key + index as u64) << self.shift)
    }

    /// Nodes in ascending order.
    pub(crate) fn nodes(self) -> impl Iterator<Item = f64> {
        (0..=self.bins).map(move |index| self.node(index))
    }

    /// Position of the first node.
    #[inline]
    pub(crate) fn first(&self) -> f64 {
        f64::from_bits(self.first_key << self.shift)
    }

    /// Bin of `x` and its position in the bin, 0 to 1; values outside go to the nearest end of the grid.
    #[inline]
    pub(crate) fn locate(&self, x: f64) -> (usize, f64) {
        let bits = x.to_bits();
        let bin = (bits >> self.shift).wrapping_sub(self.first_key) as usize;
        if x < self.first() {
            (0, 0.0)
        } else if bin >= self.bins {
            (self.bins - 1, 1.0)
        } else {
            let mask = (1_u64 << self.shift) - 1;
            (
                bin,
                (bits & mask) as f64 * (1.0 / (1_u64 << self.shift) as f64),
            )
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn locate_inverts_the_nodes(x in 1.0..150.0_f64) {
            let grid = Octaves::covering(1.0, 150.0, 8);
            let (bin, fraction) = grid.locate(x);
            let back = grid.node(bin) + fraction * (grid.node(bin + 1) - grid.node(bin));
            prop_assert!((back / x - 1.0).abs() < 1e-12);
        }
    }

    #[test]
    fn a_refined_grid_keeps_the_nodes() {
        let grid = Octaves::covering(1.0, 150.0, 5);
        let fine: Vec<f64> = grid.refined(2).nodes().collect();
        assert_eq!(fine.len(), 4 * grid.bins + 1);
        for (index, node) in grid.nodes().enumerate() {
            assert_eq!(fine[4 * index], node);
            if index < grid.bins {
                assert_eq!(fine[4 * index + 2], 0.5 * (node + grid.node(index + 1)));
            }
        }
    }

    #[test]
    fn values_outside_go_to_the_ends() {
        let grid = Octaves::covering(1.0, 150.0, 8);
        assert_eq!(grid.locate(0.3), (0, 0.0));
        assert_eq!(grid.locate(f64::INFINITY), (grid.bins - 1, 1.0));
        assert!(grid.node(grid.bins) >= 150.0 && grid.first() <= 1.0);
    }
}
