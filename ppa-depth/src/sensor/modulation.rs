//! Phase of modulated light.

use std::f64::consts::PI;

/// Speed of light in mm · MHz.
const LIGHT_MM_MHZ: f64 = 299_792.458;

/// Radians per mm of range at a modulation frequency: 4π f / c.
pub(crate) fn phase_per_mm(modulation_mhz: f64) -> f64 {
    4.0 * PI * modulation_mhz / LIGHT_MM_MHZ
}
