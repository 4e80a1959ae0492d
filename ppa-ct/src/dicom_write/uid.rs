//! Unique identifiers derived from content.

use sha2::{Digest, Sha256};

use crate::volume::Volume;

/// A fingerprint of the voxels and their positions.
pub(super) struct Fingerprint([u8; 32]);

impl Fingerprint {
    pub(super) fn of(volume: &Volume) -> Self {
        let mut hash = Sha256::new();
        hash.update(b"ppa-ct");
        for n in volume.grid().size() {
            hash.update((n as u64).to_le_bytes());
        }
        for v in volume.grid().ct_from_voxel().matrix() {
            hash.update(v.to_le_bytes());
        }
        for values in volume.values().parts(1 << 14) {
            let bytes = values.iter().flat_map(f32::to_le_bytes);
            hash.update(bytes.collect::<Vec<_>>());
        }
        Self(hash.finalize().into())
    }

    /// A UID under the root 2.25 for one object made from the volume: a UUID of version 8 (RFC 9562) as a decimal number.
    pub(super) fn uid(&self, thing: &str, number: usize) -> String {
        let mut hash = Sha256::new();
        hash.update(self.0);
        hash.update((number as u64).to_le_bytes());
        hash.update(thing);
        let digest = hash.finalize();
        let mut uuid: [u8; 16] = std::array::from_fn(|i| digest[i]);
        uuid[6] = uuid[6] & 0x0f | 0x80;
        uuid[8] = uuid[8] & 0x3f | 0x80;
        format!("2.25.{}", u128::from_be_bytes(uuid))
    }
}
