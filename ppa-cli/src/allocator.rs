//! Settings of the C library's memory allocator.
#![allow(unsafe_code)]

#[cfg(all(target_os = "linux", target_env = "gnu"))]
use libc::{M_MMAP_THRESHOLD, M_TRIM_THRESHOLD};

/// Keeps freed memory in the process instead of returning it to the system. A training step frees the gradients of all weights and
/// allocates as many in the next one; otherwise their pages would be mapped again each time, a quarter of the CPU time of `standard`.
///
/// Returns whether the allocator accepted the settings; only glibc has them.
pub fn keep_freed_memory() -> bool {
    #[cfg(all(target_os = "linux", target_env = "gnu"))]
    {
        // The largest size that every version of glibc accepts on 64-bit systems; the gradients take 16 MiB.
        const LARGEST_FROM_HEAP: i32 = 32 << 20;
        set(M_MMAP_THRESHOLD, LARGEST_FROM_HEAP) && set(M_TRIM_THRESHOLD, i32::MAX)
    }
    #[cfg(not(all(target_os = "linux", target_env = "gnu")))]
    false
}

/// Returns large blocks to the system as soon as they are freed. glibc keeps more of them the longer a program runs: the studio, whose
/// images are computed on many threads, would use nearly twice the memory it needs.
///
/// Returns whether the allocator accepted the setting; only glibc has it.
pub fn return_freed_memory() -> bool {
    #[cfg(all(target_os = "linux", target_env = "gnu"))]
    {
        const SMALLEST_RETURNED: i32 = 256 << 10;
        set(M_MMAP_THRESHOLD, SMALLEST_RETURNED)
    }
    #[cfg(not(all(target_os = "linux", target_env = "gnu")))]
    false
}

#[cfg(all(target_os = "linux", target_env = "gnu"))]
fn set(setting: i32, value: i32) -> bool {
    // SAFETY: mallopt changes parameters of the allocator under the allocator's own lock and touches no memory of this program.
    unsafe { libc::mallopt(setting, value) == 1 }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn glibc_takes_the_settings() {
        let is_glibc = cfg!(all(target_os = "linux", target_env = "gnu"));
        assert_eq!([keep_freed_memory(), return_freed_memory()], [is_glibc; 2]);
    }
}
