//! The modules of the CT image (PS3.3, A.3).

use dicom_core::dictionary::{DataDictionary, DataDictionaryEntry};
use dicom_core::{DataElement, PrimitiveValue, Tag, VR};
use dicom_dictionary_std::{StandardDataDictionary, tags, uids};
use dicom_object::{DefaultDicomObject, FileMetaTableBuilder, InMemDicomObject};
use nalgebra::Vector3;

use super::decimal::{decimal, decimals};
use super::rescale::Rescale;
use super::uid::Fingerprint;
use crate::dicom_series::RIGHT_ANGLE;
use crate::error::WriteError;
use crate::volume::Volume;

/// A volume to be written as DICOM slices.
pub(super) struct CtSeries<'a> {
    volume: &'a Volume,
    /// Columns and rows of a slice.
    size: [u16; 2],
    axes: [Vector3<f64>; 2],
    thickness_mm: f64,
    rescale: Rescale,
    fingerprint: Fingerprint,
}

impl<'a> CtSeries<'a> {
    pub(super) fn of(volume: &'a Volume) -> Result<Self, WriteError> {
        let grid = volume.grid();
        let size = grid.size();
        let most = usize::from(u16::MAX);
        if size.iter().any(|&n| n > most) {
            return Err(WriteError::TooLarge {
                size,
                format: "a DICOM CT series",
                most,
            });
        }
        let direction = grid.direction();
        let axes = [0, 1].map(|axis| direction.column(axis).into_owned());
        let lean = axes[0].dot(&axes[1]).abs();
        if lean >= RIGHT_ANGLE {
            let lean_deg = lean.asin().to_degrees();
            return Err(WriteError::SlantedSlices { lean_deg });
        }
        let normal = axes[0].cross(&axes[1]).normalize();
        let step = direction.column(2) * grid.spacing_mm().z;
        Ok(Self {
            volume,
            size: [size[0] as u16, size[1] as u16],
            axes,
            thickness_mm: step.dot(&normal).abs(),
            rescale: Rescale::of(volume.values()),
            fingerprint: Fingerprint::of(volume),
        })
    }

    /// The image of slice k.
    pub(super) fn slice(
        &self,
        k: usize,
    ) -> Result<DefaultDicomObject, Box<dyn std::error::Error + Send + Sync>> {
        let mut image = Elements(InMemDicomObject::new_empty());
        let instance = self.fingerprint.uid("instance", k);
        image.text(tags::SOP_INSTANCE_UID, &instance);
        image.text(tags::INSTANCE_NUMBER, &(k + 1).to_string());
        self.put_series(&mut image);
        self.put_plane(&mut image, k);
        self.put_pixels(&mut image, k);
        let meta = FileMetaTableBuilder::new()
            .transfer_syntax(uids::EXPLICIT_VR_LITTLE_ENDIAN)
            .media_storage_sop_class_uid(uids::CT_IMAGE_STORAGE)
            .media_storage_sop_instance_uid(instance);
        Ok(image.0.with_meta(meta)?)
    }

    fn put_series(&self, image: &mut Elements) {
        for unknown in [
            tags::PATIENT_NAME,
            tags::PATIENT_ID,
            tags::PATIENT_BIRTH_DATE,
            tags::PATIENT_SEX,
            tags::STUDY_DATE,
            tags::STUDY_TIME,
            tags::REFERRING_PHYSICIAN_NAME,
            tags::STUDY_ID,
            tags::ACCESSION_NUMBER,
            tags::PATIENT_POSITION,
            tags::POSITION_REFERENCE_INDICATOR,
            tags::LATERALITY,
            tags::ACQUISITION_NUMBER,
            tags::KVP,
        ] {
            image.put(unknown, PrimitiveValue::Empty);
        }
        let uid = |thing| self.fingerprint.uid(thing, 0);
        image.text(tags::SOP_CLASS_UID, uids::CT_IMAGE_STORAGE);
        image.text(tags::STUDY_INSTANCE_UID, &uid("study"));
        image.text(tags::SERIES_INSTANCE_UID, &uid("series"));
        image.text(tags::FRAME_OF_REFERENCE_UID, &uid("frame of reference"));
        image.text(tags::SERIES_NUMBER, "1");
        image.text(tags::MODALITY, "CT");
        image.text(tags::MANUFACTURER, "ppa-ct");
        image.text(tags::SOFTWARE_VERSIONS, env!("CARGO_PKG_VERSION"));
        image.text(tags::IMAGE_TYPE, "DERIVED\\SECONDARY\\AXIAL");
        image.text(tags::PATIENT_IDENTITY_REMOVED, "YES");
        image.text(
            tags::DEIDENTIFICATION_METHOD,
            "Voxels and their places only; no header was copied",
        );
    }

    fn put_plane(&self, image: &mut Elements, k: usize) {
        let grid = self.volume.grid();
        let position = grid.centre([0.0, 0.0, k as f64]);
        let spacing = grid.spacing_mm();
        let cosines = self.axes.iter().flat_map(|axis| axis.iter().copied());
        image.text(
            tags::IMAGE_POSITION_PATIENT,
            &decimals(position.coords.iter().copied()),
        );
        image.text(tags::IMAGE_ORIENTATION_PATIENT, &decimals(cosines));
        // The distance between rows (along j) comes first.
        image.text(tags::PIXEL_SPACING, &decimals([spacing.y, spacing.x]));
        image.text(tags::SLICE_THICKNESS, &decimal(self.thickness_mm));
    }

    fn put_pixels(&self, image: &mut Elements, k: usize) {
        let [columns, rows] = self.size;
        image.short(tags::SAMPLES_PER_PIXEL, 1);
        image.text(tags::PHOTOMETRIC_INTERPRETATION, "MONOCHROME2");
        image.short(tags::ROWS, rows);
        image.short(tags::COLUMNS, columns);
        image.short(tags::BITS_ALLOCATED, 16);
        image.short(tags::BITS_STORED, 16);
        image.short(tags::HIGH_BIT, 15);
        image.short(tags::PIXEL_REPRESENTATION, 1);
        image.text(tags::RESCALE_SLOPE, &self.rescale.slope);
        image.text(tags::RESCALE_INTERCEPT, &self.rescale.intercept);
        image.text(tags::RESCALE_TYPE, "HU");
        let pixels = usize::from(columns) * usize::from(rows);
        let hu = self.volume.values().part(k * pixels..(k + 1) * pixels);
        let stored = self
            .rescale
            .stored(&hu.to_f32())
            .into_iter()
            .map(i16::cast_unsigned);
        image.0.put(DataElement::new(
            tags::PIXEL_DATA,
            VR::OW,
            PrimitiveValue::U16(stored.collect()),
        ));
    }
}

/// A data set under construction; value representations come from the dictionary.
struct Elements(InMemDicomObject);

impl Elements {
    fn put(&mut self, tag: Tag, value: PrimitiveValue) {
        let vr = StandardDataDictionary
            .by_tag(tag)
            .map_or(VR::UN, |entry| entry.vr().relaxed());
        self.0.put(DataElement::new(tag, vr, value));
    }

    fn text(&mut self, tag: Tag, value: &str) {
        self.put(tag, value.into());
    }

    fn short(&mut self, tag: Tag, value: u16) {
        self.put(tag, value.into());
    }
}
