//! Facts about the acquisition that a file states beyond geometry and values, for the audit.

use std::collections::BTreeSet;

use serde::Serialize;

/// Facts a reader hands over. Whatever the format cannot say is `None`, empty or 0.
///
/// Of identifying attributes only the names pass on, never a value.
#[derive(Debug, Clone, Default, PartialEq, Serialize)]
pub struct Acquisition {
    /// Slice Thickness in mm, where all slices agree.
    pub slice_thickness_mm: Option<f64>,
    /// How the patient lay in the scanner (DICOM Patient Position), e.g. `FFS`: feet first, supine.
    pub patient_position: Option<String>,
    /// Table Height in mm, where all slices agree.
    pub table_height_mm: Option<f64>,
    /// Smallest and largest HU that the stored numbers can express in every slice.
    pub representable_hu: Option<[f64; 2]>,
    /// Unit of the values, where the source says that they are no HU: a term of DICOM or UCUM.
    pub unit: Option<&'static str>,
    /// The pixels went through a lossy compression.
    pub lossy: bool,
    /// Voxels that carried the padding value instead of a measurement.
    pub padded_voxels: usize,
    /// Slices that were not acquired but interpolated, counted from 0 along k.
    pub interpolated_slices: Vec<usize>,
    /// Names of the attributes that hold something about a person, a place, a date or an instance.
    pub identifiers: BTreeSet<&'static str>,
}

impl Acquisition {
    /// What holds for a scan as a whole, given what its slices state.
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

/// A length that two sources state alike, to a hundredth of a millimetre.
fn agreed(a: Option<f64>, b: Option<f64>) -> Option<f64> {
    a.zip(b)
        .and_then(|(a, b)| ((a - b).abs() < 0.01).then_some(a))
}
