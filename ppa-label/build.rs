//! Hashes the sources that computed labels follow from, so that a dataset records which program computed its labels.

use std::path::{Path, PathBuf};
use std::{env, fs, io};

use sha2::{Digest, Sha256};

fn main() -> io::Result<()> {
    let src = PathBuf::from(env::var_os("CARGO_MANIFEST_DIR").expect("set by cargo")).join("src");
    println!("cargo::rerun-if-changed={}", src.display());
    let mut hasher = Sha256::new();
    for file in files(&src)? {
        let name = file.strip_prefix(&src).expect("found below it");
        hasher.update(name.to_string_lossy().as_bytes());
        let bytes = fs::read(file)?;
        hasher.update((bytes.len() as u64).to_le_bytes());
        hasher.update(bytes);
    }
    let bytes = hasher.finalize();
    let hash: String = bytes[..8].iter().map(|b| format!("{b:02x}")).collect();
    println!("cargo::rustc-env=PPA_LABEL_CODE={hash}");
    Ok(())
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
