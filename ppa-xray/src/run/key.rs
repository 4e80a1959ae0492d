//! Key of a simulation: two tallies with the same key count the same histories.

use std::fmt::{self, Write};

use sha2::{Digest, Sha256};

use crate::beam::projection::Projection;
use crate::beam::spectrum::Spectrum;
use crate::dose::settings::DoseSettings;
use crate::engine::analog::AnalogSettings;
use crate::phantom::voxels::VoxelPhantom;

/// SHA-256, in hexadecimal, of everything that determines the result of a history: phantom, spectrum, exposure, models, requested
/// doses, seed and version of this crate. The number of histories is not included.
///
/// Settings enter as their `Debug` text, which shows every field and the exact value of every number, so that a new field cannot be
/// forgotten here. The voxels enter as bytes.
pub(crate) fn key(
    phantom: &VoxelPhantom,
    spectrum: &Spectrum,
    projection: &Projection,
    settings: &AnalogSettings,
    dose: Option<&DoseSettings>,
) -> String {
    let mut hash = Hash(Sha256::new());
    let settings = AnalogSettings {
        histories: 0,
        ..*settings
    };
    write!(
        hash,
        "{} {spectrum:?} {projection:?} {settings:?} {dose:?} {:?} {:?} {:?}",
        env!("CARGO_PKG_VERSION"),
        phantom.grid(),
        phantom.interpolation(),
        phantom.materials(),
    )
    .expect("hashing does not fail");
    if let Some(labels) = dose.and_then(|dose| dose.labels.as_ref()) {
        hash.0.update(&labels.0);
    }
    hash.0.update(phantom.material());
    for densities in phantom.density_g_cm3().chunks(4_096) {
        let bytes: Vec<u8> = densities.iter().flat_map(|d| d.to_le_bytes()).collect();
        hash.0.update(&bytes);
    }
    hex(&hash.0.finalize())
}

/// Formats bytes in hexadecimal.
pub(crate) fn hex(bytes: &[u8]) -> String {
    bytes.iter().map(|byte| format!("{byte:02x}")).collect()
}

struct Hash(Sha256);

impl Write for Hash {
    fn write_str(&mut self, text: &str) -> fmt::Result {
        self.0.update(text.as_bytes());
        Ok(())
    }
}
