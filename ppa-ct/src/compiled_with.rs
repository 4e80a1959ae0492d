//! Identities of the third-party crates that affect the results of this one.

use std::any::TypeId;

/// Returns the compiler's identities of the third-party crates that this one is compiled with, for the code key of datasets: each changes
/// with version, features and profile of its crate and with the compiler, see `ppa-generate/src/compiled.rs`.
pub fn compiled_with() -> Vec<TypeId> {
    vec![
        #[cfg(feature = "dicom")]
        TypeId::of::<dicom_core::Tag>(),
        #[cfg(feature = "dicom")]
        TypeId::of::<dicom_dictionary_std::StandardDataDictionary>(),
        #[cfg(feature = "dicom")]
        TypeId::of::<dicom_object::InMemDicomObject>(),
        #[cfg(feature = "dicom")]
        TypeId::of::<hayro_jpeg2000::DecodeSettings>(),
        #[cfg(feature = "dicom")]
        TypeId::of::<libjpeg_turbo_rs::PixelFormat>(),
        #[cfg(feature = "nifti")]
        TypeId::of::<nifti::NiftiHeader>(),
        #[cfg(any(
            feature = "dicom",
            feature = "nifti",
            feature = "metaimage",
            feature = "nrrd"
        ))]
        TypeId::of::<flate2::Compression>(),
    ]
}
