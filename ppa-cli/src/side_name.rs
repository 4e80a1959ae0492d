//! Sides of limbs on the command line.

use clap::ValueEnum;
use ppa_core::Side;

/// Which limb.
#[derive(Debug, Clone, Copy, ValueEnum)]
pub enum SideName {
    /// Left
    L,
    /// Right
    R,
}

impl From<SideName> for Side {
    fn from(side: SideName) -> Self {
        match side {
            SideName::L => Self::Left,
            SideName::R => Self::Right,
        }
    }
}
