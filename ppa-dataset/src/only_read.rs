//! A begun dataset goes on when sources change that no image follows from; which they are is said in `build.rs`.

use std::fs;
use std::path::Path;

/// Bones are named in a case file, but only computed labels follow from them.
const ALLOWED: [(&str, &str); 1] = [("case.rs", "use crate::labels::BoneFile;")];

#[test]
fn nothing_that_images_follow_from_uses_what_only_reads_them() {
    let src = Path::new(env!("CARGO_MANIFEST_DIR")).join("src");
    let only_read: Vec<_> = env!("PPA_ONLY_READ").split(',').collect();
    let modules: Vec<_> = only_read
        .iter()
        .map(|name| format!("crate::{}", name.trim_end_matches(".rs")))
        .collect();
    let mut hashed = 0;
    let mut folders = vec![src.clone()];
    while let Some(folder) = folders.pop() {
        for entry in fs::read_dir(folder).unwrap() {
            let path = entry.unwrap().path();
            let name = path.strip_prefix(&src).unwrap().to_str().unwrap();
            if only_read.contains(&name) {
                continue;
            }
            if path.is_dir() {
                folders.push(path);
                continue;
            }
            hashed += 1;
            for line in fs::read_to_string(&path).unwrap().lines() {
                // `crate::check`, but not `crate::checksums`.
                let ends =
                    |rest: &str| !rest.starts_with(|c: char| c.is_alphanumeric() || c == '_');
                let names = |module: &String| line.split(module.as_str()).skip(1).any(ends);
                let uses = modules.iter().any(names);
                assert!(!uses || ALLOWED.contains(&(name, line)), "{name}: {line}");
            }
        }
    }
    for name in only_read {
        assert!(src.join(name).exists(), "{name} is no source");
    }
    assert!(hashed > 20, "{hashed} files");
}
