//! Limits of a cluster, as `scontrol show config` prints them.

use crate::error::SlurmError;

/// Slurm's default MaxArraySize.
pub const DEFAULT_MAX_ARRAY_SIZE: u64 = 1001;

/// Reads MaxArraySize from the output of `scontrol show config`; indices of an array are below it.
///
/// # Errors
/// [`SlurmError::NoArraySize`] if the number is missing, [`SlurmError::NoArrays`] if the cluster does not support job arrays.
pub fn max_array_size(config: &str) -> Result<u64, SlurmError> {
    let value = config.lines().find_map(|line| {
        let (key, value) = line.split_once('=')?;
        (key.trim() == "MaxArraySize").then(|| value.trim())
    });
    match value.and_then(|value| value.parse().ok()) {
        None => Err(SlurmError::NoArraySize {
            found: value.unwrap_or("no such line").to_owned(),
        }),
        Some(found @ 0..=1) => Err(SlurmError::NoArrays { found }),
        Some(size) => Ok(size),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const CONFIG: &str = "Configuration data as of 2026-01-02T03:04:05\n\
        AccountingStorageHost   = localhost\n\
        MaxArraySize            = 4001\n\
        MaxJobCount             = 10000\n";

    #[test]
    fn the_largest_array_is_read_from_the_configuration() {
        assert_eq!(max_array_size(CONFIG).unwrap(), 4001);
    }

    #[test]
    fn a_configuration_without_arrays_is_refused() {
        for (value, words) in [
            ("4001x", "4001x"),
            ("0", "no job arrays"),
            ("1", "no job arrays"),
        ] {
            let said = max_array_size(&CONFIG.replace("4001", value)).unwrap_err();
            assert!(said.to_string().contains(words), "{said}");
        }
        let said = max_array_size("").unwrap_err().to_string();
        assert!(said.contains("no such line"), "{said}");
    }
}
