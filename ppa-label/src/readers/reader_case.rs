//! Radiographs shown to readers: order, pseudonyms, and the key to them.

use std::path::Path;

use ppa_core::random::seed_of_address;
use ppa_dataset::files::{FileError, hex};
use ppa_dataset::manifest::{FileKind, Manifest};
use serde::{Deserialize, Serialize};
use sha2::{Digest, Sha256};

use crate::table::{TableError, read_table, write_table};

/// One picture that a reader grades; a row of the key.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct ReaderCase {
    /// The name readers see: ten hexadecimal digits without a meaning.
    pub name: String,
    /// Path of the radiograph from the dataset's root.
    pub image: String,
    /// SHA-256 of the radiograph's file.
    pub sha256: String,
}

/// Share of the radiographs that are shown twice, at least one radiograph.
const REPEATED: f64 = 0.1;

impl ReaderCase {
    /// Returns all radiographs of a dataset at multiples of `every_deg` degrees in random order, and a tenth of them, rounded up,
    /// again in the second half, when the reader has forgotten them.
    ///
    /// The seed determines names and order, and names also depend on the image's bytes, so grades of another export or
    /// another dataset do not match any picture in the key.
    pub fn of_dataset(manifest: &Manifest, seed: u64, every_deg: f64) -> Vec<Self> {
        let radiographs = manifest.files.iter().filter(|row| {
            row.kind == FileKind::Radiograph && (row.angle_deg / every_deg).fract() == 0.0
        });
        let seed = seed_of_address(&format!("{seed}/showing"));
        let reader_case = |image: &str, sha256: &str, time: u32| {
            let address = format!("{seed}/{image}/{sha256}/{time}");
            let digest = hex(&Sha256::digest(address.as_bytes()));
            Self {
                name: digest[..10].to_owned(),
                image: image.to_owned(),
                sha256: sha256.to_owned(),
            }
        };
        let mut shown: Vec<_> = radiographs
            .map(|row| reader_case(&row.file, &row.sha256, 1))
            .collect();
        shown.sort_by(|a, b| a.name.cmp(&b.name));
        let repeated = (REPEATED * shown.len() as f64).ceil() as usize;
        let again: Vec<_> = shown[..repeated]
            .iter()
            .map(|first| reader_case(&first.image, &first.sha256, 2))
            .collect();
        // A single radiograph has no second half.
        let half = shown.len().div_ceil(2);
        shown.extend(again);
        shown[half..].sort_by(|a, b| a.name.cmp(&b.name));
        shown
    }
}

/// Writes the key as CSV, in the order of the reader cases.
///
/// # Errors
/// [`FileError`] when it cannot be written.
pub fn write_key(path: &Path, shown: &[ReaderCase]) -> Result<(), FileError> {
    write_table(path, shown)
}

/// Reads a key.
///
/// # Errors
/// [`TableError`] naming the file and the line at fault.
pub fn read_key(path: &Path) -> Result<Vec<ReaderCase>, TableError> {
    read_table(path)
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::collections::HashSet;

    use ppa_dataset::BodyShape;
    use ppa_dataset::layout::LimbId;
    use ppa_dataset::layout::Side;
    use ppa_dataset::manifest::FileRow;

    /// Radiographs of one limb at steps 0, 1, …
    fn manifest(radiographs: u32) -> Manifest {
        let limb = LimbId {
            patient: 0,
            side: Side::Left,
        };
        let row = |step| FileRow {
            file: limb.radiograph_png(step),
            sha256: format!("{step}"),
            kind: FileKind::Radiograph,
            limb,
            step,
            angle_deg: f64::from(step) / 2.0,
            camera: None,
            shape: BodyShape::Orig,
            volume_change_mm3: None,
            too_far_pixels: 0,
            cut_share: None,
            patient_from_ct: [[0.0; 4]; 4],
            room_from_patient: [[0.0; 4]; 4],
            ct_from_device: None,
            mas: None,
            exposure_index: None,
            seed: None,
        };
        Manifest {
            files: (0..radiographs).map(row).collect(),
            ..Manifest::default()
        }
    }

    #[test]
    fn every_radiograph_is_shown_and_a_tenth_twice() {
        for (count, repeats) in [(1, 1), (2, 1), (10, 1), (11, 2), (181, 19)] {
            let shown = ReaderCase::of_dataset(&manifest(count), 1, 0.5);
            assert_eq!(shown.len(), count as usize + repeats);
            let mut names: Vec<_> = shown.iter().map(|s| &s.name).collect();
            names.sort();
            names.dedup();
            assert_eq!(names.len(), shown.len());
            let mut images: Vec<_> = shown.iter().map(|s| &s.image).collect();
            images.sort();
            images.dedup();
            assert_eq!(images.len(), count as usize);
            for (place, reader_case) in shown.iter().enumerate() {
                let again = shown[..place].iter().any(|s| s.image == reader_case.image);
                assert!(!again || place >= count as usize / 2, "{place} of {count}");
            }
        }
        assert!(ReaderCase::of_dataset(&manifest(0), 1, 0.5).is_empty());
        assert_eq!(ReaderCase::of_dataset(&manifest(181), 1, 45.0).len(), 4);
    }

    #[test]
    fn order_and_names_follow_from_seed_and_bytes_and_tell_nothing() {
        let shown = ReaderCase::of_dataset(&manifest(60), 1, 0.5);
        assert_eq!(shown, ReaderCase::of_dataset(&manifest(60), 1, 0.5));
        let names = |shown: &[ReaderCase]| -> HashSet<String> {
            shown.iter().map(|s| s.name.clone()).collect()
        };
        let other_seed = ReaderCase::of_dataset(&manifest(60), 2, 0.5);
        assert!(names(&shown).is_disjoint(&names(&other_seed)));
        let mut other_bytes = manifest(60);
        for row in &mut other_bytes.files {
            row.sha256 += "1";
        }
        let other_bytes = ReaderCase::of_dataset(&other_bytes, 1, 0.5);
        assert!(names(&shown).is_disjoint(&names(&other_bytes)));
        // Shuffled: of 60 in order about half would rise from one to the next; of 60 by angle, all.
        let steps = |shown: &[ReaderCase]| -> Vec<u32> {
            let step = |s: &ReaderCase| s.sha256.parse().unwrap();
            shown.iter().map(step).collect()
        };
        let rising = steps(&shown).windows(2).filter(|w| w[0] < w[1]).count();
        assert!((15..=50).contains(&rising), "{rising}");
    }
}
