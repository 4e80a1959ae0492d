//! NRRD files that are refused, and the messages.

use std::fs;

use ppa_ct::{ReadError, read};

use crate::nrrd::{attached, detached, header};
use crate::text_headers::{gzipped, voxels};

#[test]
fn what_cannot_be_read_right_is_refused_by_name() {
    for (changes, reason) in [
        (vec!["encoding: bzip2"], "encoding bzip2"),
        (vec!["encoding: hex"], "encoding hex"),
        (vec!["encoding: ascii"], "encoding ascii"),
        (vec!["type: block"], "type block"),
        (vec!["dimension: 4", "sizes: 3 2 2 1"], "three axes"),
        (vec!["sizes: 3 2"], "three axes"),
        (vec!["sizes: 3 2 0"], "three axes"),
        (vec!["kinds: RGB-color domain domain"], "RGB-color"),
        (vec!["endian:"], "lacks `endian`"),
        (vec!["endian: middle"], "endian middle"),
        (vec!["space: scanner-xyz"], "space scanner-xyz"),
        (vec!["space: LPST"], "space LPST"),
        (
            vec!["space directions: none (0,2,0) (0,0,3)"],
            "space directions",
        ),
        (
            vec!["space directions: (1,0,0) (0,2,0)"],
            "space directions",
        ),
        (vec!["space directions:"], "lacks `space directions`"),
        (vec!["space origin: (1,2)"], "space origin"),
        (vec!["space units: \"mm\" \"mm\" \"s\""], "space units"),
        (
            vec!["spacing: 1 2 3"],
            "line 10 of the header is not a field",
        ),
        (vec!["byte skip: -2"], "byte skip -2"),
        (
            vec!["encoding: gzip", "byte skip: -1"],
            "expected uncompressed",
        ),
        (vec!["data file: LIST"], "LIST"),
        (vec!["data file: v%03d.raw 1 3 1"], "numbered series"),
        (vec!["data file: ../v.raw"], "next to the header"),
        (vec!["data file: /etc/passwd"], "next to the header"),
        (vec!["data file: .\\v.raw"], "next to the header"),
        (vec!["data file: .."], "next to the header"),
        (vec!["data file: ./../v.raw"], "next to the header"),
    ] {
        let error = attached(&changes, &voxels()).unwrap_err().to_string();
        assert!(error.contains(reason), "{changes:?}: {error}");
    }
    let missing = attached(&["data file: nothing.raw"], &[]).unwrap_err();
    assert!(matches!(missing, ReadError::Io { .. }), "{missing}");
    let twice = header(&[]) + "sizes: 3 2 2\n\n";
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("v.nrrd");
    fs::write(&path, [twice.as_bytes(), &voxels()].concat()).unwrap();
    assert!(
        read(&path)
            .unwrap_err()
            .to_string()
            .contains("repeats a field")
    );
    fs::write(&path, "NIFTI?").unwrap();
    assert!(read(&path).unwrap_err().to_string().contains("NRRD0001"));
}

#[test]
fn a_data_file_cut_anywhere_is_refused() {
    let file = "data file: v.raw";
    let gz = gzipped(&voxels());
    for (encoding, data) in [("encoding: raw", &voxels()), ("encoding: gzip", &gz)] {
        assert!(detached(&[encoding, file], data).is_ok());
        for length in 0..data.len() {
            let cut = detached(&[encoding, file], &data[..length]);
            assert!(cut.is_err(), "{encoding}: {length} of {}", data.len());
        }
    }
    for skip in ["byte skip: -1", "line skip: 1"] {
        assert!(detached(&[file, skip], &voxels()[1..]).is_err(), "{skip}");
    }
}

/// A header may contain personal information; messages repeat none of it.
#[test]
fn a_line_that_is_not_understood_is_not_repeated() {
    for line in ["Doe John", "Doe John: 1950", "key without end"] {
        let error = attached(&[line], &voxels()).unwrap_err().to_string();
        assert!(
            !error.contains("Doe") && error.contains("line 10"),
            "{error}"
        );
    }
}

#[test]
fn too_few_and_too_many_bytes_are_refused() {
    let (mut fewer, mut more) = (voxels(), voxels());
    fewer.pop();
    more.push(0);
    for (changes, pack) in [(vec![], false), (vec!["encoding: gzip"], true)] {
        for data in [&fewer, &more] {
            let data = if pack { gzipped(data) } else { data.clone() };
            let error = attached(&changes, &data).unwrap_err();
            let counted = matches!(error, ReadError::PixelCount { expected: 24, .. });
            assert!(counted, "{error}");
        }
    }
    // A size that no file can hold is refused before memory is reserved.
    let error = attached(&["sizes: 3 2 4294967296000"], &voxels()).unwrap_err();
    assert!(
        matches!(error, ReadError::PixelCount { found: 24, .. }),
        "{error}"
    );
    let sizes = "sizes: 4294967296000 4294967296000 4294967296000";
    assert!(attached(&[sizes], &voxels()).is_err());
    let bomb = attached(
        &["sizes: 3 2 42949672960", "encoding: gzip"],
        &gzipped(&voxels()),
    );
    let error = bomb.unwrap_err().to_string();
    assert!(
        error.contains("more than this file can decompress to"),
        "{error}"
    );
}
