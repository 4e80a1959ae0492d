//! The identity of a scan by its contents.

use sha2::{Digest, Sha256};

use crate::volume::Volume;

impl Volume {
    /// SHA-256 over size, affine and values in lower-case hexadecimal, which identifies a scan independently of its file name.
    pub fn sha256(&self) -> String {
        let mut hasher = Sha256::new();
        for side in self.grid().size() {
            hasher.update((side as u64).to_le_bytes());
        }
        for value in self.grid().ct_from_voxel().matrix() {
            hasher.update(value.to_le_bytes());
        }
        for values in self.values().parts(1 << 14) {
            let bytes = values.iter().flat_map(f32::to_le_bytes);
            hasher.update(bytes.collect::<Vec<_>>());
        }
        let hash = hasher.finalize();
        hash.iter().map(|byte| format!("{byte:02x}")).collect()
    }
}
