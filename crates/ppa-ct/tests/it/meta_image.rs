//! MetaImage: the ways to say the same, and what is refused.

use std::fs;
use std::io::Write;

use flate2::Compression;
use flate2::write::{GzEncoder, ZlibEncoder};
use nalgebra::{Matrix3, Point3, Vector3};
use ppa_ct::{
    ReadError, ReadOptions, Scan, WarningCode, WriteError, read, read_with, write_meta_image,
};
use proptest::prelude::*;

use crate::volumes::{max_abs, small, volumes};

proptest! {
    /// Values come back equal, places up to the rounding of spacing x direction.
    #[test]
    fn what_is_written_comes_back(volume in volumes(), detached in any::<bool>()) {
        let folder = tempfile::tempdir()?;
        let path = folder.path().join(if detached { "v.mhd" } else { "v.mha" });
        write_meta_image(&path, &volume)?;
        let back = read(&path).map_err(|e| TestCaseError::fail(e.to_string()))?;
        prop_assert_eq!(back.volume.hu(), volume.hu());
        let (a, b) = (back.volume.grid().ct_from_voxel(), volume.grid().ct_from_voxel());
        prop_assert!(max_abs(a.matrix(), b.matrix()) < 1e-14);
        prop_assert!(back.warnings.iter().all(|w| w.code != WarningCode::NoOrientation));
        let files = if detached { 2 } else { 1 };
        prop_assert_eq!(fs::read_dir(folder.path())?.count(), files, "temporary files left");
    }
}

/// The header of [`small`] as lines; `ElementDataFile` comes behind.
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
fn header(changes: &[&str], data_file: &str) -> String {
    let key = |line: &str| line.split([' ', '=', ':']).next().unwrap().to_owned();
    let mut lines = LINES.iter().map(|l| (*l).to_owned()).collect::<Vec<_>>();
    for change in changes {
        let known = lines.iter().position(|l| key(l) == key(change));
        match known {
            Some(n) if change.ends_with('=') => drop(lines.remove(n)),
            Some(n) => lines[n] = (*change).to_owned(),
            None => lines.push((*change).to_owned()),
        }
    }
    lines.join("\n") + "\nElementDataFile = " + data_file + "\n"
}

fn voxels() -> Vec<u8> {
    (-1000..-988_i16).flat_map(i16::to_le_bytes).collect()
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
    let mut gzip = GzEncoder::new(Vec::new(), Compression::default());
    gzip.write_all(&voxels()).unwrap();
    let gzip = gzip.finish().unwrap();
    for (way, scan) in [
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
        // Other names for the same, and what the format lets be left out.
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
    ]
    .into_iter()
    .enumerate()
    {
        let scan = scan.unwrap_or_else(|e| panic!("{way}: {e}"));
        assert_eq!(scan.volume, small(), "{way}");
        assert_eq!(scan.warnings, [], "{way}");
    }
}

/// Whatever of the voxels the buffer holds when their packing is looked at.
#[test]
fn packed_voxels_are_known_wherever_the_header_ends() {
    let mut gzip = GzEncoder::new(Vec::new(), Compression::default());
    gzip.write_all(&voxels()).unwrap();
    let gzip = gzip.finish().unwrap();
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

/// The first three numbers are where i runs, the next where j runs.
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
        ("TransformMatrix = 1 0 0 0 1 0 0 0", "9 numbers"),
        ("Offset = 1 2 x", "3 numbers"),
        ("DistanceUnits = inch", "DistanceUnits"),
        ("Modality = John Doe", "Modality is none"),
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
        ("../v 1.raw", "beside the header"),
        ("/etc/passwd", "beside the header"),
    ] {
        let error = beside(&[], name, &voxels()).unwrap_err().to_string();
        assert!(error.contains(reason), "{name}: {error}");
    }
    let packed = ["CompressedData = True", "HeaderSize = -1"];
    let error = beside(&packed, "v 1.raw", &deflated(&voxels())).unwrap_err();
    assert!(error.to_string().contains("expected raw"), "{error}");
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
fn a_failed_write_leaves_nothing() {
    let folder = tempfile::tempdir().unwrap();
    let write = |name: &str| write_meta_image(&folder.path().join(name), &small());
    assert!(matches!(write("v.nii"), Err(WriteError::Extension { .. })));
    assert!(matches!(write("missing/v.mha"), Err(WriteError::Io { .. })));
    assert_eq!(fs::read_dir(folder.path()).unwrap().count(), 0);
    // The voxels are written when the header turns out to be impossible.
    fs::create_dir(folder.path().join("v.mhd")).unwrap();
    assert!(matches!(write("v.mhd"), Err(WriteError::Io { .. })));
    assert_eq!(fs::read_dir(folder.path()).unwrap().count(), 1);
}

/// Until the header is replaced the old pair is there to be read, afterwards no file of it is left.
#[test]
fn a_pair_is_replaced_by_its_header() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("v.mhd");
    let other = small().crop([0; 3], [3, 2, 1]).unwrap();
    let names = || {
        let files = fs::read_dir(folder.path()).unwrap();
        let mut names = files
            .map(|e| e.unwrap().file_name().into_string().unwrap())
            .collect::<Vec<_>>();
        names.sort();
        names
    };
    write_meta_image(&path, &small()).unwrap();
    let (old_header, old) = (fs::read(&path).unwrap(), names());
    write_meta_image(&path, &other).unwrap();
    let new = names();
    assert_eq!([old.len(), new.len()], [2, 2]);
    assert_eq!(read(&path).unwrap().volume, other);

    // A crash between the two files: the new data file beside the old pair.
    let new_data = fs::read(folder.path().join(&new[0])).unwrap();
    write_meta_image(&path, &small()).unwrap();
    fs::write(folder.path().join(&new[0]), new_data).unwrap();
    assert_eq!(fs::read(&path).unwrap(), old_header);
    assert_eq!(read(&path).unwrap().volume, small());

    // A data file that another program wrote may belong to others too.
    fs::write(folder.path().join("v.raw"), voxels()).unwrap();
    fs::write(&path, header(&[], "v.raw")).unwrap();
    write_meta_image(&path, &small()).unwrap();
    assert!(names().contains(&"v.raw".to_owned()));
}

#[test]
fn names_come_back_or_are_refused() {
    for name in ["a b", "über", "100", "a.b", "LOCAL", "list", "x LIST"] {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join(name).with_added_extension("mhd");
        write_meta_image(&path, &small()).unwrap();
        assert_eq!(read(&path).unwrap().volume, small(), "{name}");
    }
    for name in ["50%", " a", "LIST", "LIST a", "LISTED", "a\nb", "a\\b"] {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join(name);
        let refused = write_meta_image(&path.with_added_extension("mhd"), &small());
        assert!(matches!(refused, Err(WriteError::Name { .. })), "{name}");
        assert_eq!(fs::read_dir(folder.path()).unwrap().count(), 0);
        // A single file needs no name in its header.
        let single = path.with_added_extension("mha");
        write_meta_image(&single, &small()).unwrap();
        assert_eq!(read(&single).unwrap().volume, small(), "{name}");
    }
}

#[test]
fn free_text_is_reported_by_name() {
    let scan = local(&["Comment = Doe", "0010|0010 = Doe^John"], &voxels()).unwrap();
    let names = scan.acquisition.identifiers.iter().copied();
    assert_eq!(names.collect::<Vec<_>>(), ["Comment", "further keys"]);
    assert!(!format!("{scan:?}").contains("Doe"));
}
