//! MetaImage: equivalent headers, and what is refused.

use std::fs;
use std::io::Write;

use flate2::Compression;
use flate2::write::ZlibEncoder;
use nalgebra::{Matrix3, Point3, Vector3};
use ppa_ct::{ReadError, ReadOptions, Scan, WarningCode, read, read_with};

use crate::text_headers::{assert_all_small, changed, gzipped, voxels};
use crate::volumes::small;

/// The header of [`small`] as lines; `ElementDataFile` follows.
const LINES: &[&str] = &[
    "ObjectType = Image",
    "NDims = 3",
    "BinaryData = True",
    "BinaryDataByteOrderMSB = False",
    "CompressedData = False",
    "TransformMatrix = 1 0 0 0 1 0 0 0 1",
    "Offset = -5 6 7",
    "ElementSpacing = 1 2 3",
    "DimSize = 3 2 2",
    "ElementType = MET_SHORT",
];

/// [`LINES`] with some keys replaced, added, or (an empty value) left out.
pub fn header(changes: &[&str], data_file: &str) -> String {
    changed(LINES, changes, &[' ', '=', ':']) + "ElementDataFile = " + data_file + "\n"
}

fn deflated(bytes: &[u8]) -> Vec<u8> {
    let mut zlib = ZlibEncoder::new(Vec::new(), Compression::default());
    zlib.write_all(bytes).unwrap();
    zlib.finish().unwrap()
}

fn local(changes: &[&str], data: &[u8]) -> Result<Scan, ReadError> {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("v.mha");
    fs::write(&path, [header(changes, "LOCAL").as_bytes(), data].concat()).unwrap();
    read(&path)
}

fn beside(changes: &[&str], name: &str, data: &[u8]) -> Result<Scan, ReadError> {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("v.mhd");
    fs::write(&path, header(changes, name)).unwrap();
    fs::write(folder.path().join("v 1.raw"), data).unwrap();
    read(&path)
}

#[test]
fn raw_packed_local_and_beside_are_one() {
    let packed = ["CompressedData = True"];
    let zlib = deflated(&voxels());
    let gzip = gzipped(&voxels());
    assert_all_small([
        local(&[], &voxels()),
        local(&packed, &zlib),
        local(&packed, &gzip),
        beside(&[], "v 1.raw", &voxels()),
        beside(&packed, "v 1.raw", &zlib),
        beside(
            &["HeaderSize = 3"],
            "v 1.raw",
            &[b"abc", &voxels()[..]].concat(),
        ),
        beside(
            &["HeaderSize = -1"],
            "v 1.raw",
            &[b"any", &voxels()[..]].concat(),
        ),
        // Other names of the same keys, and optional keys left out.
        local(
            &["TransformMatrix =", "Rotation = 1 0 0 0 1 0 0 0 1"],
            &voxels(),
        ),
        local(&["Offset =", "Position = -5 6 7"], &voxels()),
        local(&["Offset =", "Origin: -5 6 7"], &voxels()),
        local(
            &["ObjectType =", "BinaryData =", "BinaryDataByteOrderMSB ="],
            &voxels(),
        ),
        local(
            &["AnatomicalOrientation = RAI", "CenterOfRotation = 0 0 0"],
            &voxels(),
        ),
        local(
            &["Comment = anything", "Modality = MET_MOD_OTHER"],
            &voxels(),
        ),
    ]);
}

/// Whatever part of the voxels the buffer holds when their packing is detected.
#[test]
fn packed_voxels_are_known_wherever_the_header_ends() {
    let gzip = gzipped(&voxels());
    let bare = ["CompressedData = True", "Comment = "];
    let length = header(&bare, "LOCAL").len();
    for end in 8190..8194 {
        let comment = format!("Comment = {}", "x".repeat(end - length));
        assert_eq!(header(&[bare[0], &comment], "LOCAL").len(), end);
        for data in [&gzip, &deflated(&voxels())] {
            let scan = local(&[bare[0], &comment], data);
            assert_eq!(scan.unwrap().volume, small(), "{end}");
        }
    }
}

#[test]
fn byte_orders_types_and_intensities_are_honoured() {
    let big = (-1000..-988_i16)
        .flat_map(i16::to_be_bytes)
        .collect::<Vec<_>>();
    let volume = |scan: Result<Scan, ReadError>| scan.unwrap().volume;
    assert_eq!(
        volume(local(&["BinaryDataByteOrderMSB = True"], &big)),
        small()
    );
    let element = ["BinaryDataByteOrderMSB =", "ElementByteOrderMSB = True"];
    assert_eq!(volume(local(&element, &big)), small());
    // Four bytes on every machine.
    let longs = (-1000..-988_i32)
        .flat_map(i32::to_le_bytes)
        .collect::<Vec<_>>();
    assert_eq!(volume(local(&["ElementType = MET_LONG"], &longs)), small());
    let stored = (0..12_u8).collect::<Vec<_>>();
    let intensity = [
        "ElementType = MET_UCHAR",
        "ElementToIntensityFunctionSlope = 0.5",
        "ElementToIntensityFunctionOffset = -1000",
    ];
    assert_eq!(volume(local(&intensity, &stored)).hu()[3], -998.5);
}

/// The first three numbers are the direction of i, the next three that of j.
#[test]
fn the_matrix_lists_the_axes_one_after_the_other() {
    let scan = local(&["TransformMatrix = 0 0 1 1 0 0 0 -1 0"], &voxels()).unwrap();
    let centre = scan.volume.grid().centre([1.0, 1.0, 1.0]);
    assert_eq!(centre, Point3::new(-5.0 + 2.0, 6.0 - 3.0, 7.0 + 1.0));
    let scan = local(&["DistanceUnits = cm"], &voxels()).unwrap();
    assert_eq!(
        scan.volume.grid().spacing_mm(),
        Vector3::new(10.0, 20.0, 30.0)
    );
}

#[test]
fn modality_is_taken_from_the_header() {
    let ct = local(&["Modality = MET_MOD_CT"], &voxels()).unwrap();
    assert_eq!(ct.modality.as_deref(), Some("CT"));
    match local(&["Modality = MET_MOD_MR"], &voxels()) {
        Err(ReadError::NotCt { modality, .. }) => assert_eq!(modality, "MR"),
        other => panic!("{other:?}"),
    }
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("v.mha");
    let header = header(&["Modality = MET_MOD_MR"], "LOCAL");
    fs::write(&path, [header.as_bytes(), &voxels()].concat()).unwrap();
    let options = ReadOptions {
        force: true,
        ..ReadOptions::default()
    };
    let forced = read_with(&path, &options).unwrap();
    assert_eq!(forced.modality.as_deref(), Some("MR"));
    assert_eq!(forced.warnings[0].code, WarningCode::NotCt);
}

#[test]
fn what_the_header_leaves_open_is_said() {
    for missing in ["TransformMatrix =", "Offset ="] {
        let scan = local(&[missing], &voxels()).unwrap();
        let codes = scan.warnings.iter().map(|w| w.code).collect::<Vec<_>>();
        assert_eq!(codes, [WarningCode::NoOrientation]);
        assert_eq!(scan.volume.grid().direction(), Matrix3::identity());
    }
}

#[test]
fn what_cannot_be_read_right_is_refused_by_name() {
    for (change, reason) in [
        ("ObjectType = Mesh", "type Mesh"),
        ("NDims = 4", "three axes"),
        ("DimSize = 3 2", "three axes"),
        ("DimSize = 3 2 -2", "three axes"),
        ("ElementNumberOfChannels = 3", "3 channels"),
        ("BinaryData = False", "as text"),
        ("BinaryDataByteOrderMSB = maybe", "True or False"),
        ("ElementType = MET_STRING", "MET_STRING"),
        ("ElementType =", "lacks ElementType"),
        ("ElementSpacing =", "lacks ElementSpacing"),
        ("ElementSpacing = 1 0 1", "positive"),
        ("TransformMatrix = 1 0 0 0 1 0 0 0", "9 finite numbers"),
        ("Offset = 1 2 x", "3 finite numbers"),
        ("DistanceUnits = inch", "DistanceUnits"),
        ("Modality = John Doe", "Modality is not a value"),
        ("HeaderSize = x", "HeaderSize"),
        ("John Doe", "line 11 of the header"),
    ] {
        let error = local(&[change], &voxels()).unwrap_err().to_string();
        assert!(
            error.contains(reason) && !error.contains("Doe"),
            "{change}: {error}"
        );
    }
    for (name, reason) in [
        ("LIST", "LIST"),
        ("v%03d.raw 1 3 1", "numbered series"),
        ("../v 1.raw", "next to the header"),
        ("/etc/passwd", "next to the header"),
    ] {
        let error = beside(&[], name, &voxels()).unwrap_err().to_string();
        assert!(error.contains(reason), "{name}: {error}");
    }
    let packed = ["CompressedData = True", "HeaderSize = -1"];
    let error = beside(&packed, "v 1.raw", &deflated(&voxels())).unwrap_err();
    assert!(
        error.to_string().contains("expected uncompressed"),
        "{error}"
    );
}

#[test]
fn too_few_and_too_many_bytes_are_refused() {
    let (mut fewer, mut more) = (voxels(), voxels());
    fewer.pop();
    more.push(0);
    for data in [&fewer, &more] {
        for scan in [
            local(&[], data),
            local(&["CompressedData = True"], &deflated(data)),
        ] {
            let error = scan.unwrap_err();
            assert!(
                matches!(error, ReadError::PixelCount { expected: 24, .. }),
                "{error}"
            );
        }
    }
}

#[test]
fn free_text_is_reported_by_name() {
    let scan = local(&["Comment = Doe", "0010|0010 = Doe^John"], &voxels()).unwrap();
    let names = scan.acquisition.identifiers.iter().copied();
    assert_eq!(names.collect::<Vec<_>>(), ["Comment", "further keys"]);
    assert!(!format!("{scan:?}").contains("Doe"));
}
