//! Hashes the sources that determine computed labels, so that a dataset records which program computed its labels.

use std::path::PathBuf;
use std::{env, io};

use ppa_core::source_hash;

fn main() -> io::Result<()> {
    let src = PathBuf::from(env::var_os("CARGO_MANIFEST_DIR").expect("set by cargo")).join("src");
    println!("cargo::rustc-env=PPA_LABEL_CODE={}", source_hash(&[src])?);
    Ok(())
}
