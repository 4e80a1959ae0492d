//! Random numbers addressed by (seed, stream, index), and a file that is written completely or not at all.
//!
//! `cargo run -p ppa-core --example addressed_random`

use std::error::Error;
use std::fmt::Write;

use ppa_core::random::Philox;
use ppa_core::{regular_file, whole_file};

fn main() -> Result<(), Box<dyn Error>> {
    // Item 7 of stream 0 gets the same numbers in whatever order the items are visited.
    let (seed, stream) = (42, 0);
    let mut table = String::new();
    for index in (0..10).rev() {
        let number = Philox::new(seed, stream, index).unit();
        writeln!(table, "{index} {number:.6}")?;
    }

    let folder = tempfile::tempdir()?;
    let path = folder.path().join("numbers.txt");
    whole_file::write(&path, table.as_bytes())?;
    let read = regular_file::read_to_string(&path)?;
    println!(
        "{} lines, the last one: {}",
        read.lines().count(),
        read.lines().last().unwrap_or("")
    );
    Ok(())
}
