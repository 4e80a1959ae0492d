//! NRRD: equivalent headers, and what is refused.

use std::fs;
use std::path::Path;

use nalgebra::{Matrix3, Point3, Vector3};
use ppa_ct::{ReadError, Scan, Values, Volume, WarningCode, WriteError, read, write_nrrd};
use proptest::prelude::*;

use crate::text_headers::{assert_all_small, changed, gzipped, voxels};
use crate::volumes::{max_abs, small, volumes};

proptest! {
    /// Values and positions come back equal to the last bit.
    #[test]
    fn what_is_written_comes_back(volume in volumes()) {
        let folder = tempfile::tempdir()?;
        let path = folder.path().join("v.nrrd");
        write_nrrd(&path, &volume)?;
        let back = read(&path).map_err(|e| TestCaseError::fail(e.to_string()))?;
        prop_assert_eq!(&back.volume, &volume);
        prop_assert!(back.warnings.iter().all(|w| w.code != WarningCode::NoOrientation));
        prop_assert_eq!(fs::read_dir(folder.path())?.count(), 1, "temporary files left");
    }
}

/// The header of [`small`], as a list of lines.
const LINES: &[&str] = &[
    "NRRD0004",
    "type: short",
    "dimension: 3",
    "sizes: 3 2 2",
    "endian: little",
    "encoding: raw",
    "space: left-posterior-superior",
    "space directions: (1,0,0) (0,2,0) (0,0,3)",
    "space origin: (-5,6,7)",
];

/// [`LINES`] with some fields replaced, added, or (an empty text) left out.
pub fn header(changes: &[&str]) -> String {
    changed(LINES, changes, &[':'])
}

/// Reads a file with this header and these bytes.
pub fn attached(changes: &[&str], data: &[u8]) -> Result<Scan, ReadError> {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("v.nrrd");
    fs::write(&path, [header(changes).as_bytes(), b"\n", data].concat()).unwrap();
    read(&path)
}

/// Reads this header with these bytes in `v.raw` next to it.
pub fn detached(changes: &[&str], data: &[u8]) -> Result<Scan, ReadError> {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("v.nhdr");
    fs::write(&path, header(changes)).unwrap();
    fs::write(folder.path().join("v.raw"), data).unwrap();
    read(&path)
}

#[test]
fn raw_packed_attached_and_detached_are_one() {
    let gz = gzipped(&voxels());
    let file = "data file: v.raw";
    assert_all_small([
        attached(&[], &voxels()),
        attached(&["encoding: gzip"], &gz),
        attached(&["encoding: GZ"], &gz),
        detached(&[file], &voxels()),
        detached(&["datafile: v.raw"], &voxels()),
        detached(&["data file: ./v.raw"], &voxels()),
        detached(&[file, "encoding: gzip"], &gz),
        detached(
            &[file, "line skip: 2"],
            &[b"a\nbc\n", &voxels()[..]].concat(),
        ),
        detached(&[file, "byte skip: 5"], &[b"?????", &voxels()[..]].concat()),
        detached(
            &[file, "line skip: 1", "byteskip: 1"],
            &[b"a\n?", &voxels()[..]].concat(),
        ),
        detached(
            &[file, "byte skip: -1"],
            &[b"any length", &voxels()[..]].concat(),
        ),
        // Lines of the file, bytes of its unpacked contents.
        detached(
            &[file, "encoding: gzip", "lineskip: 1", "byte skip: 3"],
            &[b"a\n", &gzipped(&[b"???", &voxels()[..]].concat())[..]].concat(),
        ),
        attached(
            &["# comment: x", "key:=value: 1", "centers: cell cell cell"],
            &voxels(),
        ),
        attached(
            &["kinds: domain space domain", "type: signed  short int"],
            &voxels(),
        ),
    ]);
}

#[test]
fn byte_orders_and_types_are_honoured() {
    let big = (-1000..-988_i16)
        .flat_map(i16::to_be_bytes)
        .collect::<Vec<_>>();
    let volume = |scan: Result<Scan, ReadError>| scan.unwrap().volume;
    assert_eq!(volume(attached(&["endian: big"], &big)), small());
    let doubles = (-1000..-988_i16).flat_map(|v| f64::from(v).to_le_bytes());
    let doubles = doubles.collect::<Vec<_>>();
    assert_eq!(volume(attached(&["type: double"], &doubles)), small());
    // A single byte has no byte order.
    let scan = attached(&["type: uchar", "endian:"], &[7; 12]).unwrap();
    assert_eq!(scan.volume.values(), Values::I16(&[7; 12]));
}

/// The same position stated in three spaces and in micrometres.
#[test]
fn spaces_and_units_lead_to_one_lps() {
    for (space, signs) in [
        ("LPS", [1, 1]),
        ("right-anterior-superior", [-1, -1]),
        ("LAS", [1, -1]),
    ] {
        let [x, y] = signs;
        let scan = attached(
            &[
                &format!("space: {space}"),
                "space units: \"um\" \"um\" \"um\"",
                &format!(
                    "space directions: ( {x}e3 , 0, 0 ) (0,{}, 0) (0,0,3000)",
                    2000 * y
                ),
                &format!("space origin: ({},{},7000)", -5000 * x, 6000 * y),
            ],
            &voxels(),
        )
        .unwrap();
        let (found, truth) = (scan.volume.grid(), small());
        let apart = max_abs(
            found.ct_from_voxel().matrix(),
            truth.grid().ct_from_voxel().matrix(),
        );
        assert!(apart < 1e-12, "{space}: {apart}");
    }
}

#[test]
fn a_sheared_and_permuted_lattice_stays_as_it_is() {
    let scan = attached(&["space directions: (0,0,2) (1,0,0.5) (0,-3,0)"], &voxels()).unwrap();
    let grid = scan.volume.grid();
    let centre = grid.centre([1.0, 1.0, 1.0]);
    assert_eq!(centre, Point3::new(-5.0 + 1.0, 6.0 - 3.0, 7.0 + 2.0 + 0.5));
}

#[test]
fn what_the_header_leaves_open_is_said() {
    let codes = |scan: &Scan| scan.warnings.iter().map(|w| w.code).collect::<Vec<_>>();
    let bare = attached(
        &[
            "space:",
            "space directions:",
            "space origin:",
            "spacings: 1 2 3",
        ],
        &voxels(),
    )
    .unwrap();
    assert_eq!(codes(&bare), [WarningCode::NoOrientation]);
    assert_eq!(bare.volume.grid().spacing_mm(), Vector3::new(1.0, 2.0, 3.0));
    assert_eq!(bare.volume.grid().direction(), Matrix3::identity());
    assert!(
        bare.warnings[0]
            .text
            .contains("left, posterior and superior")
    );
    for (space, words) in [
        ("space: RAS", "right, anterior and superior"),
        ("space: LAS", "left, anterior and superior"),
    ] {
        let open = [space, "space directions:", "spacings: 1 2 3"];
        let scan = attached(&open, &voxels()).unwrap();
        assert_eq!(codes(&scan), [WarningCode::NoOrientation]);
        let text = &scan.warnings[0].text;
        assert!(text.contains(words), "{space}: {text}");
        assert_eq!(scan.volume.grid().direction().row(2)[2], 1.0);
    }
    let nowhere = attached(&["space origin:"], &voxels()).unwrap();
    assert_eq!(codes(&nowhere), [WarningCode::NoOrientation]);
    let unnamed = attached(&["space:", "space dimension: 3"], &voxels()).unwrap();
    assert_eq!(codes(&unnamed), [WarningCode::NoOrientation]);
}

#[test]
fn comments_and_keys_are_reported_by_name() {
    let names = |changes: &[&str]| {
        let scan = attached(changes, &voxels()).unwrap();
        assert!(!format!("{scan:?}").contains("Doe"));
        scan.acquisition.identifiers.into_iter().collect::<Vec<_>>()
    };
    let usual = [
        "# Complete NRRD file format specification at:",
        "# http://teem.sourceforge.net/nrrd/format.html",
    ];
    assert!(names(&usual).is_empty());
    assert_eq!(names(&["# Doe^John"]), ["comments"]);
    let all = ["# Doe", "content: Doe", "name:=Doe"];
    assert_eq!(names(&all), ["comments", "content", "key/value pairs"]);
}

#[test]
fn a_failed_write_leaves_nothing() {
    let folder = tempfile::tempdir().unwrap();
    let write = |name: &str, volume: &Volume| write_nrrd(&folder.path().join(name), volume);
    assert!(matches!(
        write("v.nii", &small()),
        Err(WriteError::Extension { .. })
    ));
    assert!(matches!(
        write("missing/v.nrrd", &small()),
        Err(WriteError::Io { .. })
    ));
    assert_eq!(fs::read_dir(folder.path()).unwrap().count(), 0);
    assert!(write_nrrd(Path::new("/dev/null/v.nrrd"), &small()).is_err());
}

#[test]
fn free_text_is_reported_by_name_and_the_range_of_the_type() {
    let scan = attached(&["content: Doe", "patient:=Doe", "type: uchar"], &[7; 12]).unwrap();
    let names = scan.acquisition.identifiers.iter().copied();
    assert_eq!(names.collect::<Vec<_>>(), ["content", "key/value pairs"]);
    assert_eq!(scan.acquisition.representable_hu, Some([0.0, 255.0]));
}
