//! Hashes what determines the bytes of a dataset apart from plan and scans: the sources and the physics data of the crates that make it,
//! and the machine that they are compiled for.
//!
//! In a checkout these are files next to this crate. A published crate cannot see the other crates of the workspace; `src/compiled.rs` adds
//! their versions instead, and always adds those of third-party crates.

use std::path::PathBuf;
use std::{env, io};

use ppa_core::source_hash;

/// Crates that determine the bytes of an image, as folders next to this one.
const CRATES: [&str; 8] = [
    "ppa-core",
    "ppa-ct",
    "ppa-dataset",
    "ppa-depth",
    "ppa-generate",
    "ppa-mesh",
    "ppa-scene",
    "ppa-xray",
];

/// Parts of a crate that are hashed.
const PARTS: [&str; 3] = ["Cargo.toml", "data", "src"];

fn main() -> io::Result<()> {
    let this = PathBuf::from(env::var_os("CARGO_MANIFEST_DIR").expect("set by cargo"));
    let beside = this.parent().expect("a crate lies in a folder");
    let in_crate = |name: &str| PARTS.map(|part| beside.join(name).join(part));
    let (roots, neighbours): (Vec<_>, _) = match beside.join("ppa-ct").is_dir() {
        true => (
            CRATES.iter().flat_map(|name| in_crate(name)).collect(),
            "sources",
        ),
        false => (PARTS.map(|part| this.join(part)).into(), "compiled"),
    };

    let code = source_hash(&roots)? + &machine();
    println!("cargo::rustc-env=PPA_CODE={code}");
    println!("cargo::rustc-env=PPA_NEIGHBOURS={neighbours}");
    Ok(())
}

/// The target and its CPU features, which `-C target-cpu` adds to.
fn machine() -> String {
    println!("cargo::rerun-if-env-changed=CARGO_ENCODED_RUSTFLAGS");
    let target = ["TARGET", "CARGO_CFG_TARGET_FEATURE"].map(env::var);
    let target = target.map(|value| value.unwrap_or_default());
    format!(" {} {}", target[0], target[1])
}
