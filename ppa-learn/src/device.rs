//! Devices on which networks compute, as named in configurations and commands.

pub mod launch;

use std::fmt;
use std::str::FromStr;

use candle_core::Device;
use serde::{Deserialize, Serialize};

/// Device on which a network computes: `"cpu"`, `"cuda"` for the first NVIDIA device, or `"cuda:1"` for the second.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(try_from = "String", into = "String")]
pub enum DeviceName {
    /// The processor, with our kernels.
    #[default]
    Cpu,
    /// An NVIDIA device by its number, with our kernels and candle's matrix products.
    Cuda(usize),
}

/// Error in opening a device.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum DeviceError {
    /// An unknown name.
    #[error(
        "unknown device {found:?}; expected \"cpu\", \"cuda\" or a numbered one such as \"cuda:1\""
    )]
    Unknown {
        /// The name found.
        found: String,
    },
    /// The feature `cuda` is off.
    #[error(
        "this program was built for the CPU only; device \"{name}\" needs a build with `--features cuda`"
    )]
    NotBuilt {
        /// The device.
        name: DeviceName,
    },
    /// There is no such device, or its driver fails.
    #[error("device \"{name}\" cannot be used")]
    Unavailable {
        /// The device.
        name: DeviceName,
        /// Error of candle or of the driver.
        source: candle_core::Error,
    },
}

impl DeviceName {
    /// Opens the device.
    ///
    /// # Errors
    /// [`DeviceError`] if the program was built without it, or the machine has none.
    pub fn open(self) -> Result<Device, DeviceError> {
        match self {
            Self::Cpu => Ok(Device::Cpu),
            #[cfg(not(feature = "cuda"))]
            Self::Cuda(_) => Err(DeviceError::NotBuilt { name: self }),
            #[cfg(feature = "cuda")]
            Self::Cuda(number) => launch::open(number)
                .map_err(|source| DeviceError::Unavailable { name: self, source }),
        }
    }
}

impl fmt::Display for DeviceName {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Cpu => write!(f, "cpu"),
            Self::Cuda(0) => write!(f, "cuda"),
            Self::Cuda(number) => write!(f, "cuda:{number}"),
        }
    }
}

impl FromStr for DeviceName {
    type Err = DeviceError;

    fn from_str(name: &str) -> Result<Self, DeviceError> {
        let number = match name {
            "cpu" => return Ok(Self::Cpu),
            "cuda" => Some(0),
            other => other.strip_prefix("cuda:").and_then(|n| n.parse().ok()),
        };
        let unknown = || DeviceError::Unknown {
            found: name.to_owned(),
        };
        Ok(Self::Cuda(number.ok_or_else(unknown)?))
    }
}

impl TryFrom<String> for DeviceName {
    type Error = DeviceError;

    fn try_from(name: String) -> Result<Self, DeviceError> {
        name.parse()
    }
}

impl From<DeviceName> for String {
    fn from(name: DeviceName) -> Self {
        name.to_string()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_are_read_as_they_are_written() {
        for name in ["cpu", "cuda", "cuda:1", "cuda:12"] {
            assert_eq!(name.parse::<DeviceName>().unwrap().to_string(), name);
        }
        for name in ["gpu", "CUDA", "cuda:", "cuda:-1", "cuda:x", ""] {
            let error = name.parse::<DeviceName>().unwrap_err().to_string();
            assert!(
                error.contains(&format!("unknown device {name:?}")),
                "{error}"
            );
        }
    }

    #[test]
    #[cfg(not(feature = "cuda"))]
    fn a_program_for_the_cpu_says_how_to_build_one_for_devices() {
        use crate::train::{Source, TrainConfig, train};
        assert!(DeviceName::Cpu.open().is_ok());
        let config = TrainConfig {
            device: DeviceName::Cuda(1),
            training: vec![Source {
                dataset: "unread".into(),
                patients: None,
                shapes: None,
                every_pose: None,
                labels: None,
            }],
            ..TrainConfig::quick()
        };
        let folder = tempfile::tempdir().unwrap();
        let run = folder.path().join("run");
        let refused = train(
            &config,
            &run,
            &std::sync::atomic::AtomicBool::new(false),
            |_| (),
        );
        let error = refused.unwrap_err().to_string();
        assert!(!run.exists());
        assert!(
            error.contains("\"cuda:1\"") && error.contains("--features cuda"),
            "{error}"
        );
    }
}
