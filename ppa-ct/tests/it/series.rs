//! Synthetic DICOM series with known voxels and positions.

use std::path::Path;

use dicom_core::{DataElement, PrimitiveValue, Tag, VR};
use dicom_dictionary_std::{tags, uids};
use dicom_object::{FileMetaTableBuilder, InMemDicomObject};
use flate2::Compression;
use flate2::write::DeflateEncoder;
use nalgebra::{Point3, Vector3};

/// One slice to be written.
#[derive(Clone)]
pub struct SliceSpec {
    pub size: [u16; 2],
    pub position: Point3<f64>,
    pub along_row: Vector3<f64>,
    pub down_column: Vector3<f64>,
    /// Distance between columns (along i), then between rows (along j).
    pub spacing_mm: [f64; 2],
    /// Stored values, columns fastest; signed ones as bit patterns.
    pub stored: Vec<u16>,
    pub signed: bool,
    pub bits_stored: u16,
    pub rescale: [f64; 2],
    pub series: u32,
    pub modality: &'static str,
    pub image_type: &'static str,
    pub syntax: &'static str,
    /// Last change to the data set, which makes it unusual.
    pub change: fn(&mut InMemDicomObject),
}

impl SliceSpec {
    /// A signed axial slice at height `z`, filled with `hu`.
    pub fn axial(size: [u16; 2], z: f64, hu: impl Fn(usize, usize) -> i16) -> Self {
        let [nx, ny] = size.map(usize::from);
        Self {
            size,
            position: Point3::new(-10.0, 20.0, z),
            along_row: Vector3::x(),
            down_column: Vector3::y(),
            spacing_mm: [0.5, 0.75],
            stored: (0..nx * ny)
                .map(|n| hu(n % nx, n / nx).cast_unsigned())
                .collect(),
            signed: true,
            bits_stored: 16,
            rescale: [1.0, 0.0],
            series: 3,
            modality: "CT",
            image_type: "ORIGINAL\\PRIMARY\\AXIAL",
            syntax: uids::EXPLICIT_VR_LITTLE_ENDIAN,
            change: |_| {},
        }
    }

    pub fn write(&self, path: &Path) {
        self.write_changed(path, self.change);
    }

    /// Writes the slice with a last change to the data set.
    pub fn write_changed(&self, path: &Path, change: impl FnOnce(&mut InMemDicomObject)) {
        let decimal = |values: &[f64]| {
            let texts = values.iter().map(|v| format!("{v:.10}"));
            PrimitiveValue::from(texts.collect::<Vec<_>>().join("\\"))
        };
        let (p, u, v) = (self.position, self.along_row, self.down_column);
        let texts: [(Tag, VR, PrimitiveValue); 12] = [
            (tags::PATIENT_NAME, VR::PN, "Planted^Name".into()),
            (tags::PATIENT_ID, VR::LO, "PLANTED-ID".into()),
            (tags::SERIES_DESCRIPTION, VR::LO, "planted words".into()),
            (tags::IMAGE_TYPE, VR::CS, self.image_type.into()),
            (tags::MODALITY, VR::CS, self.modality.into()),
            (
                tags::SERIES_INSTANCE_UID,
                VR::UI,
                format!("2.25.{}", self.series).into(),
            ),
            (tags::SERIES_NUMBER, VR::IS, self.series.to_string().into()),
            (tags::SLICE_THICKNESS, VR::DS, "9.5".into()),
            (
                tags::IMAGE_POSITION_PATIENT,
                VR::DS,
                decimal(&[p.x, p.y, p.z]),
            ),
            (
                tags::IMAGE_ORIENTATION_PATIENT,
                VR::DS,
                decimal(&[u.x, u.y, u.z, v.x, v.y, v.z]),
            ),
            (
                tags::PIXEL_SPACING,
                VR::DS,
                decimal(&[self.spacing_mm[1], self.spacing_mm[0]]),
            ),
            (
                tags::PHOTOMETRIC_INTERPRETATION,
                VR::CS,
                "MONOCHROME2".into(),
            ),
        ];
        let numbers = [
            (tags::SAMPLES_PER_PIXEL, 1),
            (tags::ROWS, self.size[1]),
            (tags::COLUMNS, self.size[0]),
            (tags::BITS_ALLOCATED, 16),
            (tags::BITS_STORED, self.bits_stored),
            (tags::HIGH_BIT, self.bits_stored - 1),
            (tags::PIXEL_REPRESENTATION, u16::from(self.signed)),
        ];
        let mut object = InMemDicomObject::new_empty();
        for (tag, vr, value) in texts {
            object.put(DataElement::new(tag, vr, value));
        }
        for (tag, number) in numbers {
            object.put(DataElement::new(tag, VR::US, PrimitiveValue::from(number)));
        }
        for (tag, number) in [
            (tags::RESCALE_SLOPE, self.rescale[0]),
            (tags::RESCALE_INTERCEPT, self.rescale[1]),
        ] {
            object.put(DataElement::new(tag, VR::DS, decimal(&[number])));
        }
        object.put(DataElement::new(
            tags::PIXEL_DATA,
            VR::OW,
            PrimitiveValue::U16(self.stored.iter().copied().collect()),
        ));
        change(&mut object);
        let file = |syntax| {
            let meta = FileMetaTableBuilder::new()
                .transfer_syntax(syntax)
                .media_storage_sop_class_uid(uids::CT_IMAGE_STORAGE)
                .media_storage_sop_instance_uid("2.25.1");
            object.clone().with_meta(meta).expect("a valid meta group")
        };
        if self.syntax == uids::DEFLATED_EXPLICIT_VR_LITTLE_ENDIAN {
            // dicom-object needs a feature for this, which the program does not enable.
            let mut bytes = [&[0; 128][..], b"DICM"].concat();
            file(self.syntax).meta().write(&mut bytes).unwrap();
            let mut encoder = DeflateEncoder::new(&mut bytes, Compression::fast());
            let data_set = file(uids::EXPLICIT_VR_LITTLE_ENDIAN);
            data_set.write_dataset(&mut encoder).unwrap();
            encoder.finish().unwrap();
            std::fs::write(path, bytes).expect("a writable folder");
        } else {
            let written = file(self.syntax).write_to_file(path);
            written.expect("a writable folder");
        }
    }
}

/// Writes slices into `folder` under names unrelated to their order.
pub fn write_series(folder: &Path, slices: &[SliceSpec]) {
    for (n, slice) in slices.iter().enumerate() {
        let scrambled = (n * 7919 + 13) % 10007;
        slice.write(&folder.join(format!("IM{scrambled:05}")));
    }
}
