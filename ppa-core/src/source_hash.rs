//! A hash of source files, for the build scripts of crates whose results record the code that made them.

use std::path::{Path, PathBuf};
use std::{fs, io};

use sha2::{Digest, Sha256};

/// Returns the first eight bytes, in hexadecimal, of a SHA-256 over the names and contents of all files at or below the given paths;
/// missing paths are skipped.
///
/// Tells Cargo to run the build script again when one of them changes.
///
/// # Errors
/// The system's error for a file that cannot be read.
pub fn source_hash(roots: &[PathBuf]) -> io::Result<String> {
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

/// Lists all files at or below a path, sorted by name.
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_and_contents_of_files_decide_the_hash() {
        let folder = tempfile::tempdir().unwrap();
        let roots = [folder.path().join("src"), folder.path().join("missing")];
        let write = |name: &str, text: &str| {
            let path = roots[0].join(name);
            fs::create_dir_all(path.parent().unwrap()).unwrap();
            fs::write(path, text).unwrap();
            source_hash(&roots).unwrap()
        };
        let first = write("a/b.rs", "1");
        assert_eq!(write("a/b.rs", "1"), first);
        assert_eq!(first.len(), 16);
        let second = write("c.rs", "");
        assert_ne!(second, first);
        assert_ne!(write("a/b.rs", "2"), second);
    }
}
