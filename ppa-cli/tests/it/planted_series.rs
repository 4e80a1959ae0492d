//! A DICOM series of the phantom in which every attribute about a person, a place, a date or an instance contains a searchable value.

use std::path::Path;

use dicom_core::value::DataSetSequence;
use dicom_core::{DataElement, PrimitiveValue, Tag, VR};
use dicom_dictionary_std::{tags, uids};
use dicom_object::{FileMetaTableBuilder, InMemDicomObject};
use ppa_phantom::{LowerLeg, TableTop};

/// Part of every planted text, and of the names of files and folders.
pub const WORD: &str = "Zwetschgenkern";
/// Start of every planted UID.
pub const UID_ROOT: &str = "1.2.826.0.1.3680043.31415926";
/// Planted dates and times, in DICOM and in common notation.
pub const DATES: [&str; 4] = ["19370519", "1937-05-19", "20240229", "031459.265358"];

const TEXTS: [(Tag, VR); 24] = [
    (tags::PATIENT_NAME, VR::PN),
    (tags::PATIENT_ID, VR::LO),
    (tags::PATIENT_ADDRESS, VR::LO),
    (tags::PATIENT_COMMENTS, VR::LT),
    (tags::PATIENT_BIRTH_NAME, VR::PN),
    (tags::OTHER_PATIENT_NAMES, VR::PN),
    (tags::ETHNIC_GROUPS, VR::SH),
    (tags::ACCESSION_NUMBER, VR::SH),
    (tags::INSTITUTION_NAME, VR::LO),
    (tags::INSTITUTION_ADDRESS, VR::ST),
    (tags::INSTITUTIONAL_DEPARTMENT_NAME, VR::LO),
    (tags::STATION_NAME, VR::SH),
    (tags::REFERRING_PHYSICIAN_NAME, VR::PN),
    (tags::PERFORMING_PHYSICIAN_NAME, VR::PN),
    (tags::OPERATORS_NAME, VR::PN),
    (tags::STUDY_ID, VR::SH),
    (tags::STUDY_DESCRIPTION, VR::LO),
    (tags::SERIES_DESCRIPTION, VR::LO),
    (tags::PROTOCOL_NAME, VR::LO),
    (tags::IMAGE_COMMENTS, VR::LT),
    (tags::DEVICE_SERIAL_NUMBER, VR::LO),
    (tags::MANUFACTURER, VR::LO),
    (tags::CONVOLUTION_KERNEL, VR::SH),
    (tags::SOFTWARE_VERSIONS, VR::LO),
];

fn text(tag: Tag, vr: VR, value: impl Into<String>) -> DataElement<InMemDicomObject> {
    DataElement::new(tag, vr, PrimitiveValue::from(value.into()))
}

fn decimals(tag: Tag, values: &[f64]) -> DataElement<InMemDicomObject> {
    let texts = values.iter().map(|v| format!("{v:.6}"));
    text(tag, VR::DS, texts.collect::<Vec<_>>().join("\\"))
}

fn identity() -> InMemDicomObject {
    let mut object = InMemDicomObject::new_empty();
    for (n, (tag, vr)) in TEXTS.into_iter().enumerate() {
        object.put(text(tag, vr, format!("{WORD}{n}")));
    }
    for tag in [tags::PATIENT_BIRTH_DATE, tags::STUDY_DATE] {
        object.put(text(tag, VR::DA, DATES[0]));
    }
    for tag in [
        tags::SERIES_DATE,
        tags::ACQUISITION_DATE,
        tags::CONTENT_DATE,
    ] {
        object.put(text(tag, VR::DA, DATES[2]));
    }
    for tag in [
        tags::STUDY_TIME,
        tags::PATIENT_BIRTH_TIME,
        tags::CONTENT_TIME,
    ] {
        object.put(text(tag, VR::TM, DATES[3]));
    }
    let uid = |n: usize| format!("{UID_ROOT}.{n}");
    for (n, tag) in [
        tags::STUDY_INSTANCE_UID,
        tags::SERIES_INSTANCE_UID,
        tags::FRAME_OF_REFERENCE_UID,
    ]
    .into_iter()
    .enumerate()
    {
        object.put(text(tag, VR::UI, uid(n)));
    }
    // A private block, and an order in a sequence.
    object.put(text(Tag(0x0009, 0x0010), VR::LO, format!("{WORD} CREATOR")));
    object.put(text(Tag(0x0009, 0x1001), VR::LO, format!("{WORD} private")));
    let mut item = InMemDicomObject::new_empty();
    item.put(text(
        tags::REQUESTED_PROCEDURE_DESCRIPTION,
        VR::LO,
        format!("{WORD} order"),
    ));
    item.put(text(tags::REFERENCED_SOP_INSTANCE_UID, VR::UI, uid(7)));
    let items = DataSetSequence::from(vec![item]);
    object.put(DataElement::new(
        tags::REQUEST_ATTRIBUTES_SEQUENCE,
        VR::SQ,
        items,
    ));
    object
}

/// Writes the phantom on its table into `folder`, one file per slice.
pub fn write(folder: &Path) {
    let volume = LowerLeg::p01().voxelise(3.0, TableTop::Present).unwrap();
    let grid = volume.grid();
    let [nx, ny, nz] = grid.size();
    let spacing = grid.spacing_mm();
    let (origin, axes) = (grid.origin_mm(), grid.direction());
    let plain = identity();
    for k in 0..nz {
        let position = origin + axes.column(2) * spacing.z * k as f64;
        let cosines = axes.fixed_columns::<2>(0).into_owned();
        let mut object = plain.clone();
        object.put(text(
            tags::SOP_INSTANCE_UID,
            VR::UI,
            format!("{UID_ROOT}.9.{k}"),
        ));
        object.put(text(tags::SOP_CLASS_UID, VR::UI, uids::CT_IMAGE_STORAGE));
        object.put(text(tags::MODALITY, VR::CS, "CT"));
        object.put(text(tags::IMAGE_TYPE, VR::CS, "ORIGINAL\\PRIMARY\\AXIAL"));
        object.put(text(tags::PATIENT_POSITION, VR::CS, "FFS"));
        object.put(text(tags::SERIES_NUMBER, VR::IS, "3"));
        object.put(text(
            tags::PHOTOMETRIC_INTERPRETATION,
            VR::CS,
            "MONOCHROME2",
        ));
        object.put(decimals(
            tags::IMAGE_POSITION_PATIENT,
            position.coords.as_slice(),
        ));
        object.put(decimals(
            tags::IMAGE_ORIENTATION_PATIENT,
            cosines.as_slice(),
        ));
        object.put(decimals(tags::PIXEL_SPACING, &[spacing.y, spacing.x]));
        object.put(decimals(tags::SLICE_THICKNESS, &[spacing.z]));
        object.put(decimals(tags::RESCALE_SLOPE, &[1.0]));
        object.put(decimals(tags::RESCALE_INTERCEPT, &[0.0]));
        for (tag, number) in [
            (tags::SAMPLES_PER_PIXEL, 1),
            (tags::ROWS, ny),
            (tags::COLUMNS, nx),
            (tags::BITS_ALLOCATED, 16),
            (tags::BITS_STORED, 16),
            (tags::HIGH_BIT, 15),
            (tags::PIXEL_REPRESENTATION, 1),
        ] {
            object.put(DataElement::new(
                tag,
                VR::US,
                PrimitiveValue::from(number as u16),
            ));
        }
        let slice = (0..nx * ny).map(|n| volume.at([n % nx, n / nx, k]).round() as i16);
        let stored = PrimitiveValue::U16(slice.map(i16::cast_unsigned).collect());
        object.put(DataElement::new(tags::PIXEL_DATA, VR::OW, stored));
        let meta = FileMetaTableBuilder::new()
            .transfer_syntax(uids::EXPLICIT_VR_LITTLE_ENDIAN)
            .media_storage_sop_class_uid(uids::CT_IMAGE_STORAGE)
            .media_storage_sop_instance_uid(format!("{UID_ROOT}.9.{k}"));
        let file = object.with_meta(meta).unwrap();
        file.write_to_file(folder.join(format!("{WORD}{k:03}.dcm")))
            .unwrap();
    }
}
