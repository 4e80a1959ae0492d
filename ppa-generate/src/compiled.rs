//! Identity of the compiled program.

use std::any::TypeId;
use std::sync::LazyLock;

use sha2::{Digest, Sha256};

use ppa_dataset::files::hex;

/// Hash of everything that determines the bytes of an image apart from plan and scans.
///
/// Sources, physics data and target come from `build.rs`. The compiled versions of other crates cannot be read there: without `--locked`,
/// `cargo install` ignores Cargo.lock and passes nothing of it to a build script. But the compiler includes in the identity of a type that
/// of its crate: version, features, profile and compiler, and those of all its dependencies.
///
/// For a crate in a checkout, Cargo adds its folder, relative to the workspace if it is inside, so that a package built from the same files
/// in another folder would seem to be another program. Such crates are identified by their sources; type identities are used only for
/// registry crates, which have no folder.
pub(crate) fn code() -> &'static str {
    static CODE: LazyLock<String> = LazyLock::new(|| {
        let mut crates = vec![
            TypeId::of::<nalgebra::Dyn>(),
            TypeId::of::<rayon::iter::Empty<()>>(),
            TypeId::of::<serde::de::IgnoredAny>(),
            TypeId::of::<serde_json::Value>(),
            TypeId::of::<Sha256>(),
            TypeId::of::<tempfile::TempDir>(),
            TypeId::of::<toml::Value>(),
            TypeId::of::<toml_edit::DocumentMut>(),
        ];
        crates.extend(ppa_ct::compiled_with());
        crates.extend(ppa_dataset::compiled_with());
        crates.extend(ppa_depth::compiled_with());
        crates.extend(ppa_mesh::compiled_with());
        if env!("PPA_NEIGHBOURS") == "compiled" {
            crates.extend(neighbours());
        }
        let hash = Sha256::digest(format!("{} {crates:?}", env!("PPA_CODE")));
        hex(&hash[..8])
    });
    &CODE
}

/// Types of the other workspace crates, used if their sources are not next to this one: registry crates, identified by their versions.
fn neighbours() -> [TypeId; 6] {
    [
        TypeId::of::<ppa_ct::Volume>(),
        TypeId::of::<ppa_dataset::Manifest>(),
        TypeId::of::<ppa_mesh::LimbSettings>(),
        TypeId::of::<ppa_scene::RoomSpec>(),
        TypeId::of::<ppa_depth::CameraSpec>(),
        TypeId::of::<ppa_xray::Spectrum>(),
    ]
}
