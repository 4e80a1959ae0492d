//! CT numbers are whole numbers of 16 bits in most scans, and can be stored as such.

/// Whether int16 holds every value exactly.
pub(crate) fn fits_i16(hu: &[f32]) -> bool {
    let range = f32::from(i16::MIN)..=f32::from(i16::MAX);
    hu.iter().all(|v| v.fract() == 0.0 && range.contains(v))
}
