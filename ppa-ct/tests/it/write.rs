//! The name determines the format, and any two formats agree.

use std::fs;

use nalgebra::{Point3, Vector3};
use ppa_ct::{Grid, Volume, WriteError, read, write};
use proptest::prelude::*;

use crate::volumes::small;

const NAMES: [&str; 7] = [
    "a.nii", "b.nii.gz", "c.nrrd", "d.mha", "e.mhd", "f", "g.dicom/",
];

proptest! {
    #![proptest_config(ProptestConfig::with_cases(48))]

    /// Through a chain of formats, integers and positions in f32 are unchanged.
    #[test]
    fn a_chain_of_conversions_changes_nothing(
        names in prop::sample::subsequence(NAMES.to_vec(), 1..=NAMES.len()).prop_shuffle(),
        size in prop::array::uniform3(1..6_usize),
        spacing in prop::array::uniform3(1..40_u16),
        origin in prop::array::uniform3(-800..800_i16),
        low in -1024..3000_i16,
    ) {
        let spacing = Vector3::from(spacing).map(|v| f64::from(v) / 8.0);
        let origin = Point3::from(origin).map(|v| f64::from(v) / 4.0);
        let grid = Grid::axis_aligned(size, spacing, origin)?;
        let hu = (0..grid.len()).map(|n| f32::from(low) + n as f32).collect();
        let volume = Volume::new(grid, hu)?;
        let folder = tempfile::tempdir()?;
        let mut last = volume.clone();
        for name in names {
            let path = folder.path().join(name);
            write(&path, &last)?;
            last = read(&path).map_err(|e| TestCaseError::fail(e.to_string()))?.volume;
            prop_assert_eq!(&last, &volume, "{}", name);
        }
    }
}

#[test]
fn a_name_that_says_no_format_is_refused() {
    let folder = tempfile::tempdir().unwrap();
    for name in ["v.dcm", "v.png", "v.gz", "v.nhdr", "v.2"] {
        let refused = write(&folder.path().join(name), &small());
        assert!(
            matches!(refused, Err(WriteError::Extension { .. })),
            "{name}"
        );
    }
    assert_eq!(fs::read_dir(folder.path()).unwrap().count(), 0);
}
