//! K-fluorescence of the elements that detectors are made of.

/// K shell of an element: xraylib 4.3.0 (`EdgeEnergy`, `FluorYield`, `JumpFactor`, `LineEnergy`, `RadRate`).
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct KShell {
    /// Atomic number.
    pub z: u8,
    pub edge_kev: f64,
    /// K x-rays per vacancy.
    pub fluorescence_yield: f64,
    /// Share of the photoelectric absorption above the edge that happens in the K shell: 1 − 1/jump.
    pub share: f64,
    /// Kα and Kβ: mean energy in keV, and share of the K x-rays.
    pub lines: [(f64, f64); 2],
}

/// Selenium, iodine, caesium.
pub(crate) const K_SHELLS: [KShell; 3] = [
    KShell {
        z: 34,
        edge_kev: 12.6578,
        fluorescence_yield: 0.6019,
        share: 1.0 - 1.0 / 7.225,
        lines: [(11.2082, 0.8634), (12.5020, 0.1366)],
    },
    KShell {
        z: 53,
        edge_kev: 33.1694,
        fluorescence_yield: 0.8819,
        share: 1.0 - 1.0 / 6.039,
        lines: [(28.5090, 0.8136), (32.4182, 0.1864)],
    },
    KShell {
        z: 55,
        edge_kev: 35.9846,
        fluorescence_yield: 0.8942,
        share: 1.0 - 1.0 / 5.949,
        lines: [(30.8507, 0.8096), (35.1330, 0.1904)],
    },
];

impl KShell {
    pub fn of(z: u8) -> Option<&'static Self> {
        K_SHELLS.iter().find(|shell| shell.z == z)
    }
}
