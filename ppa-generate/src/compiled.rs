//! Identity of the compiled program.

use std::any::TypeId;
use std::sync::LazyLock;

use sha2::{Digest, Sha256};

use ppa_dataset::files::hex;

/// Hash of all that the bytes of an image follow from besides plan and scans.
///
/// Sources, physics data and target come from `build.rs`. Which versions of other crates were compiled cannot be read there: without
/// `--locked`, `cargo install` ignores Cargo.lock and passes nothing of it to a build script. But the compiler knows. It
/// mixes into the identity of a type that of its crate: version, features, profile and compiler, and those of all
/// crates that it depends on.
pub(crate) fn code() -> &'static str {
    static CODE: LazyLock<String> = LazyLock::new(|| {
        let crates = [
            TypeId::of::<ppa_ct::Volume>(),
            TypeId::of::<ppa_dataset::Manifest>(),
            TypeId::of::<ppa_mesh::LimbSettings>(),
            TypeId::of::<ppa_scene::RoomSpec>(),
            TypeId::of::<ppa_depth::CameraSpec>(),
            TypeId::of::<ppa_xray::Spectrum>(),
        ];
        let hash = Sha256::digest(format!("{} {crates:?}", env!("PPA_CODE")));
        hex(&hash[..8])
    });
    &CODE
}
