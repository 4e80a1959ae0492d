//! Writing MetaImage: what is read back, and which files are replaced.

use std::fs;

use ppa_ct::{WarningCode, WriteError, read, write_meta_image};
use proptest::prelude::*;

use crate::meta_image::header;
use crate::text_headers::voxels;
use crate::volumes::{max_abs, small, volumes};

proptest! {
    /// Values come back equal, positions up to the rounding of spacing x direction.
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

#[test]
fn a_failed_write_leaves_nothing() {
    let folder = tempfile::tempdir().unwrap();
    let write = |name: &str| write_meta_image(&folder.path().join(name), &small());
    assert!(matches!(write("v.nii"), Err(WriteError::Extension { .. })));
    assert!(matches!(write("missing/v.mha"), Err(WriteError::Io { .. })));
    assert_eq!(fs::read_dir(folder.path()).unwrap().count(), 0);
    // The voxels are already written when writing the header fails.
    fs::create_dir(folder.path().join("v.mhd")).unwrap();
    assert!(matches!(write("v.mhd"), Err(WriteError::Io { .. })));
    assert_eq!(fs::read_dir(folder.path()).unwrap().count(), 1);
}

/// Until the header is replaced the old pair stays readable; afterwards no file of it is left.
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

    // A crash between the two files: the new data file next to the old pair.
    let new_data = fs::read(folder.path().join(&new[0])).unwrap();
    write_meta_image(&path, &small()).unwrap();
    fs::write(folder.path().join(&new[0]), new_data).unwrap();
    assert_eq!(fs::read(&path).unwrap(), old_header);
    assert_eq!(read(&path).unwrap().volume, small());

    // A data file written by another program may be shared by other headers.
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
        // A single file does not need a name in its header.
        let single = path.with_added_extension("mha");
        write_meta_image(&single, &small()).unwrap();
        assert_eq!(read(&single).unwrap().volume, small(), "{name}");
    }
}
