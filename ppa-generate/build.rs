//! Hashes what the bytes of a dataset follow from besides plan and scans: the sources and the
//! physics data of the crates that make it, and the machine that they are compiled for.
//!
//! In a checkout these are files beside this crate. A published crate cannot see its neighbours; their versions, which stand
//! in for their contents, and those of all other crates are added by `src/compiled.rs`.

use std::path::{Path, PathBuf};
use std::{env, fs, io};

use sha2::{Digest, Sha256};

/// Crates that decide the bytes of an image, as folders beside this one.
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

/// What of a crate decides them.
const PARTS: [&str; 3] = ["Cargo.toml", "data", "src"];

fn main() -> io::Result<()> {
    let this = PathBuf::from(env::var_os("CARGO_MANIFEST_DIR").expect("set by cargo"));
    let beside = this.parent().expect("a crate lies in a folder");
    let in_crate = |name: &str| PARTS.map(|part| beside.join(name).join(part));
    let mut roots: Vec<_> = CRATES.iter().flat_map(|name| in_crate(name)).collect();
    if !beside.join("ppa-ct").is_dir() {
        roots = PARTS.map(|part| this.join(part)).into();
    }

    let code = hash(&roots)? + &machine();
    println!("cargo::rustc-env=PPA_CODE={code}");
    Ok(())
}

/// The target and its instructions, which `-C target-cpu` adds to.
fn machine() -> String {
    println!("cargo::rerun-if-env-changed=CARGO_ENCODED_RUSTFLAGS");
    let target = ["TARGET", "CARGO_CFG_TARGET_FEATURE"].map(env::var);
    let target = target.map(|value| value.unwrap_or_default());
    format!(" {} {}", target[0], target[1])
}

/// The first eight bytes of a hash over the names and contents of files below some roots.
fn hash(roots: &[PathBuf]) -> io::Result<String> {
    let mut hasher = Sha256::new();
    for root in roots.iter().filter(|root| root.exists()) {
        println!("cargo::rerun-if-changed={}", root.display());
        for file in &files(root)? {
            let name = file.strip_prefix(root).expect("found below it");
            hasher.update(name.to_string_lossy().as_bytes());
            let bytes = fs::read(file)?;
            hasher.update((bytes.len() as u64).to_le_bytes());
            hasher.update(bytes);
        }
    }
    let bytes = hasher.finalize();
    Ok(bytes[..8].iter().map(|b| format!("{b:02x}")).collect())
}

/// All files at or below a path, in the order of their names.
fn files(path: &Path) -> io::Result<Vec<PathBuf>> {
    if path.is_file() {
        return Ok(vec![path.to_owned()]);
    }
    let entries = fs::read_dir(path)?.map(|entry| Ok(entry?.path()));
    let mut paths = entries.collect::<io::Result<Vec<_>>>()?;
    paths.sort();
    let below: Vec<_> = paths
        .iter()
        .map(|path| files(path))
        .collect::<io::Result<_>>()?;
    Ok(below.concat())
}
