//! Radiographs as DICOM Digital X-Ray images (PS3.3 A.26), For Processing and For Presentation.

mod elements;
pub(crate) mod examination;
mod modules;
mod uid;

use std::path::Path;

use dicom_dictionary_std::{tags, uids};
use dicom_object::{FileMetaTableBuilder, InMemDicomObject};

use crate::beam::projection::Projection;
use crate::beam::tube::TubeSpec;
use crate::image::dx::elements::Elements;
use crate::image::dx::examination::Examination;
use crate::image::output::{OutputError, write_whole};
use crate::image::presentation::Presentation;
use crate::image::radiograph::Radiograph;

/// Stored value of the bare field in a For Processing image; scatter can raise a pixel above it.
const OPEN_STORED: f64 = 40_000.0;

/// Stored values per unit of log exposure after latitude reduction in a For Presentation image, and the log exposure stored as 0.
const STORED_PER_LOG: f64 = 6_000.0;
const LOG_OF_ZERO: f64 = -1.0;

/// Data of a DICOM header that are not in the radiograph.
#[derive(Debug, Clone, Copy)]
#[non_exhaustive]
pub struct DxExposure<'a> {
    /// The exposure of the radiograph.
    pub projection: &'a Projection,
    /// The tube that emitted the spectrum.
    pub tube: &'a TubeSpec,
    /// Anatomy, side and view.
    pub examination: Examination,
    /// Distance from the source to the table or the skin along the central ray, mm, if it is known.
    pub source_patient_mm: Option<f64>,
    /// Target exposure index of the examination, if any; it gives the deviation index.
    pub target_exposure_index: Option<f64>,
    /// Text that identifies the study, such as the hash of a scan: images with the same text share a study. The file does not
    /// reveal it.
    pub study: &'a str,
}

impl<'a> DxExposure<'a> {
    /// An exposure without optional data; images with the same `study` share a study.
    pub fn new(
        projection: &'a Projection,
        tube: &'a TubeSpec,
        examination: Examination,
        study: &'a str,
    ) -> Self {
        Self {
            projection,
            tube,
            examination,
            source_patient_mm: None,
            target_exposure_index: None,
            study,
        }
    }

    /// Sets [`source_patient_mm`](Self::source_patient_mm).
    #[must_use]
    pub fn with_source_patient_mm(self, source_patient_mm: Option<f64>) -> Self {
        Self {
            source_patient_mm,
            ..self
        }
    }

    /// Sets [`target_exposure_index`](Self::target_exposure_index).
    #[must_use]
    pub fn with_target_exposure_index(self, target_exposure_index: Option<f64>) -> Self {
        Self {
            target_exposure_index,
            ..self
        }
    }
}

/// Purpose of a DICOM image.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum DxIntent {
    /// Detector signal divided by that of the bare field, linear: the input of a workstation.
    Processing,
    /// Enhanced log exposure with the window as a VOI LUT: the image for a reader.
    Presentation(Presentation),
}

impl Radiograph {
    /// Writes a DICOM Digital X-Ray image. The file is written completely or not at all. Needs the feature `dicom`.
    ///
    /// The image is flagged as synthetic, derived and free of identity; dates and names are empty. Its UIDs are hashes of its
    /// contents (2.25.‹hash›), so the same radiograph gives the same bytes.
    ///
    /// * [`DxIntent::Processing`]: stored value = 40 000 × reading / bare field, clipped at 65 535 (LIN, sign +1).
    /// * [`DxIntent::Presentation`]: stored value = 6 000 × (t + 1) with the enhanced log exposure t after latitude reduction (LOG,
    ///   sign −1). The window is a VOI LUT, whose values are the grey of [`Radiograph::write_png`]. They are P-values (Presentation LUT
    ///   Shape IDENTITY): equal steps look equal on a display that follows the Grayscale Standard Display Function (PS3.14).
    ///
    /// Pixels outside the collimated field are stored as the bare field and covered by a display shutter.
    ///
    /// # Errors
    /// [`OutputError`] naming the file, for an invalid receptor or an image with sides of more than 65 535 pixels, the limit of
    /// DICOM.
    pub fn write_dicom(
        &self,
        path: &Path,
        exposure: &DxExposure,
        intent: DxIntent,
    ) -> Result<(), OutputError> {
        let failed = |source: Box<dyn std::error::Error + Send + Sync>| OutputError::Dicom {
            path: path.into(),
            source,
        };
        let [columns, rows] = [self.detector.columns, self.detector.rows].map(u16::try_from);
        let (Ok(columns), Ok(rows)) = (columns, rows) else {
            return Err(OutputError::DicomSize {
                columns: self.detector.columns,
                rows: self.detector.rows,
            });
        };
        self.check_layers()?;
        let pixels = match intent {
            DxIntent::Processing => self.linear_pixels(),
            DxIntent::Presentation(presentation) => self.logarithmic_pixels(&presentation)?,
        };
        let mut elements = Elements::new();
        self.put_modules(&mut elements, exposure, intent, [columns, rows]);
        let index = self.exposure_index(&exposure.projection.receptor)?;
        modules::put_exposure_index(&mut elements, index, exposure.target_exposure_index);
        elements.words(tags::PIXEL_DATA, pixels);
        let study = uid::of(&[b"study", exposure.study.as_bytes()]);
        let kind: &[u8] = match intent {
            DxIntent::Processing => b"processing",
            DxIntent::Presentation(_) => b"presentation",
        };
        let series = uid::of(&[b"series", exposure.study.as_bytes(), kind]);
        let instance = uid::of(&[
            b"instance",
            study.as_bytes(),
            &elements.bytes().map_err(failed)?,
        ]);
        elements.text(tags::STUDY_INSTANCE_UID, &study);
        elements.text(tags::SERIES_INSTANCE_UID, &series);
        elements.text(tags::SOP_INSTANCE_UID, &instance);
        let encode = |object: InMemDicomObject| -> Result<Vec<u8>, Box<dyn std::error::Error + Send + Sync>> {
            let meta = FileMetaTableBuilder::new()
                .transfer_syntax(uids::EXPLICIT_VR_LITTLE_ENDIAN)
                .media_storage_sop_class_uid(intent.sop_class())
                .media_storage_sop_instance_uid(&instance);
            let mut encoded = Vec::new();
            object.with_meta(meta)?.write_all(&mut encoded)?;
            Ok(encoded)
        };
        write_whole(path, &encode(elements.into_object()).map_err(failed)?)
    }

    fn linear_pixels(&self) -> Vec<u16> {
        let stored = |(pixel, &reading): (usize, &f32)| {
            let share = if self.in_field(pixel) {
                f64::from(reading) / self.open_field_at(pixel)
            } else {
                1.0
            };
            // Casts saturate, so negative values and NaN become 0.
            (OPEN_STORED * share).round() as u16
        };
        self.total().iter().enumerate().map(stored).collect()
    }

    fn logarithmic_pixels(&self, presentation: &Presentation) -> Result<Vec<u16>, OutputError> {
        let stored = |(pixel, &t): (usize, &f32)| {
            let t = if self.in_field(pixel) {
                f64::from(t)
            } else {
                0.0
            };
            (STORED_PER_LOG * (t - LOG_OF_ZERO)).round() as u16
        };
        let enhanced = self.enhanced_log_exposure(presentation)?;
        Ok(enhanced.iter().enumerate().map(stored).collect())
    }
}

impl DxIntent {
    fn sop_class(self) -> &'static str {
        match self {
            Self::Processing => uids::DIGITAL_X_RAY_IMAGE_STORAGE_FOR_PROCESSING,
            Self::Presentation(_) => uids::DIGITAL_X_RAY_IMAGE_STORAGE_FOR_PRESENTATION,
        }
    }
}
