//! Energies at which a quantity with absorption edges is tabulated.

use crate::matter::energy_range::{MAX_ENERGY_KEV, MIN_ENERGY_KEV};

/// Smallest and largest energy that reach a detector, keV.
const RANGE_KEV: [f64; 2] = [MIN_ENERGY_KEV, MAX_ENERGY_KEV];

/// Ratio of neighbouring nodes; linear interpolation of E⁻³ is accurate to 6e-4.
const RATIO: f64 = 1.02;

/// Relative distance from an absorption edge of the two nodes around it; the edges of different tables differ by less.
const EDGE_GAP: f64 = 2e-5;

/// Cells per keV of the guide.
const CELLS_PER_KEV: f64 = 2.0;

/// Ascending energies, with two nodes at each edge: one below and one above.
#[derive(Debug, Clone)]
pub(crate) struct EnergyNodes {
    kev: Vec<f64>,
    edges_kev: Vec<f64>,
    /// Interval of nodes that contains the lower end of every cell of the guide.
    guide: Vec<u16>,
}

impl EnergyNodes {
    pub fn with_edges(edges_kev: impl IntoIterator<Item = f64>) -> Self {
        let [low, high] = RANGE_KEV;
        let steps = ((high / low).ln() / RATIO.ln()).ceil();
        let mut kev: Vec<f64> = (0..=steps as u32)
            .map(|i| low * (high / low).powf(f64::from(i) / steps))
            .collect();
        let edges_kev: Vec<f64> = edges_kev
            .into_iter()
            .filter(|&edge| edge > low && edge < high)
            .collect();
        for edge in &edges_kev {
            kev.extend([edge * (1.0 - EDGE_GAP), edge * (1.0 + EDGE_GAP)]);
        }
        kev.sort_by(f64::total_cmp);
        kev.dedup();
        let cells = ((high - low) * CELLS_PER_KEV).ceil() as usize + 1;
        let guide = (0..cells)
            .map(|cell| {
                let start = low + cell as f64 / CELLS_PER_KEV;
                (kev.partition_point(|&node| node <= start).max(1) - 1).min(kev.len() - 2) as u16
            })
            .collect();
        Self {
            kev,
            edges_kev,
            guide,
        }
    }

    pub fn kev(&self) -> &[f64] {
        &self.kev
    }

    /// Energies at which the quantity jumps.
    pub fn edges_kev(&self) -> &[f64] {
        &self.edges_kev
    }

    /// Interval that contains an energy, and the position of the energy in it; energies outside go to the ends.
    #[inline]
    pub fn locate(&self, energy_kev: f64) -> (usize, f64) {
        let [low, high] = RANGE_KEV;
        let energy_kev = energy_kev.clamp(low, high);
        let cell = ((energy_kev - low) * CELLS_PER_KEV) as usize;
        let mut node = usize::from(self.guide[cell]);
        while node + 2 < self.kev.len() && self.kev[node + 1] <= energy_kev {
            node += 1;
        }
        let (from, to) = (self.kev[node], self.kev[node + 1]);
        (node, ((energy_kev - from) / (to - from)).clamp(0.0, 1.0))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn locate_inverts_the_nodes(energy_kev in 1.0..150.0_f64) {
            let nodes = EnergyNodes::with_edges([33.169, 35.985, 200.0]);
            let (node, t) = nodes.locate(energy_kev);
            let back = nodes.kev()[node] + t * (nodes.kev()[node + 1] - nodes.kev()[node]);
            prop_assert!((back / energy_kev - 1.0).abs() < 1e-12);
        }
    }

    #[test]
    fn an_edge_falls_between_two_nodes() {
        let nodes = EnergyNodes::with_edges([33.169]);
        let (below, t_below) = nodes.locate(33.168);
        let (above, t_above) = nodes.locate(33.170);
        assert_eq!(above, below + 2);
        assert!(t_below > 0.9 && t_above < 0.1);
        assert_eq!(nodes.locate(0.2), (0, 0.0));
        assert_eq!(nodes.locate(1e3), (nodes.kev().len() - 2, 1.0));
    }
}
