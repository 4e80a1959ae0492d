//! Facts about the acquisition that a file states in addition to geometry and values, for the audit.

use std::collections::BTreeSet;

use serde::Serialize;

/// Facts from a reader. Whatever the format does not state is `None`, empty or 0.
///
/// Only the names of identifying attributes are kept, never a value.
#[derive(Debug, Clone, Default, PartialEq, Serialize)]
pub struct Acquisition {
    /// Slice Thickness in mm, if it is the same in all slices.
    pub slice_thickness_mm: Option<f64>,
    /// Position of the patient in the scanner (DICOM Patient Position), e.g. `FFS`: feet first, supine.
    pub patient_position: Option<String>,
    /// Table Height in mm, if it is the same in all slices.
    pub table_height_mm: Option<f64>,
    /// Smallest and largest HU that the stored numbers can express in every slice.
    pub representable_hu: Option<[f64; 2]>,
    /// Unit of the values, a DICOM or UCUM term, if the source says that they are not HU.
    pub unit: Option<&'static str>,
    /// Whether the pixels were compressed with loss.
    pub lossy: bool,
    /// Voxels that carried the padding value instead of a measurement.
    pub padded_voxels: usize,
    /// Slices that were not acquired but interpolated, counted from 0 along k.
    pub interpolated_slices: Vec<usize>,
    /// Names of the attributes that hold something about a person, a place, a date or an instance.
    pub identifiers: BTreeSet<&'static str>,
}

impl Acquisition {
    /// Returns the facts that hold for a scan, given those of its slices.
    pub fn of_slices<'a>(slices: impl IntoIterator<Item = &'a Self>) -> Self {
        let mut slices = slices.into_iter();
        let Some(first) = slices.next() else {
            return Self::default();
        };
        let mut whole = first.clone();
        for slice in slices {
            whole.slice_thickness_mm = agreed(whole.slice_thickness_mm, slice.slice_thickness_mm);
            whole.table_height_mm = agreed(whole.table_height_mm, slice.table_height_mm);
            if whole.patient_position != slice.patient_position {
                whole.patient_position = None;
            }
            whole.representable_hu = whole.representable_hu.zip(slice.representable_hu).map(
                |([low, high], [other_low, other_high])| [low.max(other_low), high.min(other_high)],
            );
            whole.lossy |= slice.lossy;
            whole.padded_voxels += slice.padded_voxels;
            whole.identifiers.extend(&slice.identifiers);
        }
        whole
    }
}

/// Returns a length if two sources agree on it to a hundredth of a millimetre.
fn agreed(a: Option<f64>, b: Option<f64>) -> Option<f64> {
    a.zip(b)
        .and_then(|(a, b)| ((a - b).abs() < 0.01).then_some(a))
}
