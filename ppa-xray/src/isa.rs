//! Compiles a kernel for several vector instruction sets and selects one that the machine supports.
#![allow(unsafe_code)]

/// A vector instruction set supported by this machine.
///
/// Every kernel rounds each operation on its own (no fused multiply-add), so all sets give the same bits.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct Isa(Set);

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Set {
    Baseline,
    #[cfg(target_arch = "x86_64")]
    Avx2,
    #[cfg(target_arch = "x86_64")]
    Avx512,
}

impl Isa {
    /// All supported sets, the widest last.
    fn available() -> impl DoubleEndedIterator<Item = Self> {
        #[cfg(target_arch = "x86_64")]
        let sets = [
            (Set::Baseline, true),
            (Set::Avx2, is_x86_feature_detected!("avx2")),
            (
                Set::Avx512,
                is_x86_feature_detected!("avx512f")
                    && is_x86_feature_detected!("avx512bw")
                    && is_x86_feature_detected!("avx512dq")
                    && is_x86_feature_detected!("avx512vl"),
            ),
        ];
        #[cfg(not(target_arch = "x86_64"))]
        let sets = [(Set::Baseline, true)];
        sets.into_iter()
            .filter(|(_, present)| *present)
            .map(|(set, _)| Self(set))
    }

    /// The widest supported set.
    pub fn widest() -> Self {
        Self::available().next_back().unwrap_or(Self(Set::Baseline))
    }

    #[cfg(test)]
    pub fn all() -> Vec<Self> {
        Self::available().collect()
    }

    #[inline(always)]
    pub(crate) fn run(self, kernel: impl Kernel) {
        match self.0 {
            Set::Baseline => kernel.run(),
            // SAFETY: `available` alone makes this value, and only where the instructions were detected.
            #[cfg(target_arch = "x86_64")]
            Set::Avx2 => unsafe { with_avx2(kernel) },
            // SAFETY: as above.
            #[cfg(target_arch = "x86_64")]
            Set::Avx512 => unsafe { with_avx512(kernel) },
        }
    }
}

/// Prefetches the memory of an element that will be read soon.
#[inline(always)]
pub(crate) fn prefetch<T>(slice: &[T], index: usize) {
    #[cfg(target_arch = "x86_64")]
    if let Some(element) = slice.get(index) {
        use std::arch::x86_64::{_MM_HINT_T0, _mm_prefetch};
        // SAFETY: the address is that of a reference, and a prefetch changes nothing that a program can see.
        unsafe { _mm_prefetch::<_MM_HINT_T0>(std::ptr::from_ref(element).cast()) }
    }
    #[cfg(not(target_arch = "x86_64"))]
    let _ = (slice, index);
}

/// Straight-line work on many elements at once. `run` is `#[inline(always)]`, so that it is compiled into each copy.
pub(crate) trait Kernel {
    fn run(self);
}

#[cfg(target_arch = "x86_64")]
#[target_feature(enable = "avx2")]
fn with_avx2(kernel: impl Kernel) {
    kernel.run();
}

#[cfg(target_arch = "x86_64")]
#[target_feature(enable = "avx2,avx512f,avx512bw,avx512dq,avx512vl")]
fn with_avx512(kernel: impl Kernel) {
    kernel.run();
}
