//! The nearest depth per pixel, filled by many threads at once.

use std::sync::atomic::{AtomicU32, Ordering};

/// Depths in mm, as bits: those of positive floats are ordered as the floats are. The minimum does not depend on the order of
/// arrival, so the image does not depend on the number of threads.
pub(crate) struct DepthBuffer(Vec<AtomicU32>);

impl DepthBuffer {
    /// A buffer in which nothing was seen.
    pub(crate) fn empty(pixels: usize) -> Self {
        let far = f32::INFINITY.to_bits();
        Self((0..pixels).map(|_| AtomicU32::new(far)).collect())
    }

    /// Nearest depth so far, ∞ if none.
    #[inline]
    pub(crate) fn nearest(&self, pixel: usize) -> f32 {
        f32::from_bits(self.0[pixel].load(Ordering::Relaxed))
    }

    /// Keeps the nearer of the stored depth and `z_mm` > 0.
    #[inline]
    pub(crate) fn offer(&self, pixel: usize, z_mm: f32) {
        if z_mm < self.nearest(pixel) {
            self.0[pixel].fetch_min(z_mm.to_bits(), Ordering::Relaxed);
        }
    }

    /// Depths, 0 where nothing was seen.
    pub(crate) fn into_depths(self) -> Vec<f32> {
        let depth = |bits: AtomicU32| {
            let z_mm = f32::from_bits(bits.into_inner());
            if z_mm.is_finite() { z_mm } else { 0.0 }
        };
        self.0.into_iter().map(depth).collect()
    }
}
