//! Settings of the C library's memory allocator.
#![allow(unsafe_code)]

/// Keeps freed memory in the process instead of returning it to the system. A training step frees gradients of all weights and
/// allocates as many in the next one; their pages would be mapped anew each time, a quarter of the CPU time of `standard`.
///
/// Returns whether the allocator took the settings; only glibc's has them.
pub fn keep_freed_memory() -> bool {
    #[cfg(all(target_os = "linux", target_env = "gnu"))]
    {
        // The largest size that every version of glibc accepts on 64-bit systems; the gradients take 16 MiB.
        const LARGEST_FROM_HEAP: i32 = 32 << 20;
        let settings = [
            (libc::M_MMAP_THRESHOLD, LARGEST_FROM_HEAP),
            (libc::M_TRIM_THRESHOLD, i32::MAX),
        ];
        // SAFETY: mallopt changes numbers of the allocator under the allocator's own lock and touches no memory of this program.
        settings.map(|(setting, value)| unsafe { libc::mallopt(setting, value) }) == [1, 1]
    }
    #[cfg(not(all(target_os = "linux", target_env = "gnu")))]
    false
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn glibc_takes_the_settings() {
        let is_glibc = cfg!(all(target_os = "linux", target_env = "gnu"));
        assert_eq!(keep_freed_memory(), is_glibc);
    }
}
