//! Shared by the tests of MetaImage and NRRD: headers of lines, and the voxels of [`small`].

use std::io::Write;

use flate2::Compression;
use flate2::write::GzEncoder;
use ppa_ct::{ReadError, Scan};

use crate::volumes::small;

/// Lines with some fields replaced, added, or removed (nothing after the separator).
pub fn changed(lines: &[&str], changes: &[&str], separators: &[char]) -> String {
    let field = |line: &str| line.split(separators).next().unwrap().to_owned();
    let mut lines = lines.iter().map(|l| (*l).to_owned()).collect::<Vec<_>>();
    for change in changes {
        let known = lines.iter().position(|l| field(l) == field(change));
        match known {
            Some(n) if change.ends_with(separators) => drop(lines.remove(n)),
            Some(n) => lines[n] = (*change).to_owned(),
            None => lines.push((*change).to_owned()),
        }
    }
    lines.join("\n") + "\n"
}

pub fn voxels() -> Vec<u8> {
    (-1000..-988_i16).flat_map(i16::to_le_bytes).collect()
}

pub fn gzipped(bytes: &[u8]) -> Vec<u8> {
    let mut gzip = GzEncoder::new(Vec::new(), Compression::default());
    gzip.write_all(bytes).unwrap();
    gzip.finish().unwrap()
}

/// Every scan equals [`small`] and has no warnings.
pub fn assert_all_small(scans: impl IntoIterator<Item = Result<Scan, ReadError>>) {
    for (way, scan) in scans.into_iter().enumerate() {
        let scan = scan.unwrap_or_else(|e| panic!("{way}: {e}"));
        assert_eq!(scan.volume, small(), "{way}");
        assert_eq!(scan.warnings, [], "{way}");
    }
}
