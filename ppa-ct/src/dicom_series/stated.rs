//! Statements of a DICOM header about the acquisition, and the identifying attributes it holds.

use std::collections::BTreeSet;

use dicom_core::dictionary::DataDictionary;
use dicom_core::{Tag, VR};
use dicom_dictionary_std::{StandardDataDictionary, tags};

use super::attributes::Attributes;
use super::element::{DEEPEST, DataSet};
use super::file;
use super::frame::Frame;
use super::header::Image;
use super::stored::StoredFormat;
use crate::acquisition::Acquisition;

/// Reads the facts of one file, whose frames are assumed to be acquired alike.
pub(super) fn stated(top: &Attributes, image: &Image, first: Option<&Frame>) -> Acquisition {
    let text = |tag| top.data_set.get(tag).map(file::text);
    let number = |tag| text(tag)?.parse::<f64>().ok().filter(|v| v.is_finite());
    let rescale = first.and_then(|frame| frame.rescale);
    let mut identifiers = BTreeSet::new();
    collect_identifiers(top.data_set, DEEPEST, &mut identifiers);
    Acquisition {
        slice_thickness_mm: first.and_then(|frame| frame.thickness_mm),
        patient_position: text(tags::PATIENT_POSITION).filter(|p| POSITIONS.contains(&p.as_str())),
        table_height_mm: number(tags::TABLE_HEIGHT),
        representable_hu: Some(representable_hu(
            image.stored,
            rescale.unwrap_or([1.0, 0.0]),
        )),
        lossy: text(tags::LOSSY_IMAGE_COMPRESSION).as_deref() == Some("01"),
        identifiers,
        ..Acquisition::default()
    }
}

/// Defined terms of Patient Position (PS3.3, section C.7.3.1.1.2); anything else could be free text.
const POSITIONS: [&str; 16] = [
    "HFP", "HFS", "HFDR", "HFDL", "FFP", "FFS", "FFDR", "FFDL", "LFP", "LFS", "RFP", "RFS", "AFP",
    "AFS", "AFDR", "AFDL",
];

fn representable_hu(pixel: StoredFormat, [slope, intercept]: [f64; 2]) -> [f64; 2] {
    let span = 2_f64.powi(pixel.bits_stored as i32);
    let lowest = if pixel.signed { -span / 2.0 } else { 0.0 };
    let ends = [lowest, lowest + span - 1.0].map(|stored| slope * stored + intercept);
    [ends[0].min(ends[1]), ends[0].max(ends[1])]
}

/// Text attributes that commonly identify who, where or which examination, after the confidentiality
/// profile of PS3.15, table E.1-1. Names of persons, dates and UIDs are known by their type.
#[expect(deprecated, reason = "retired attributes still stand in old files")]
const TELLING: [Tag; 44] = [
    tags::PATIENT_ID,
    tags::ISSUER_OF_PATIENT_ID,
    tags::OTHER_PATIENT_I_DS,
    tags::PATIENT_BIRTH_TIME,
    tags::PATIENT_ADDRESS,
    tags::PATIENT_TELEPHONE_NUMBERS,
    tags::PATIENT_COMMENTS,
    tags::PATIENT_AGE,
    tags::PATIENT_SEX,
    tags::PATIENT_SIZE,
    tags::PATIENT_WEIGHT,
    tags::ETHNIC_GROUPS,
    tags::OCCUPATION,
    tags::ADDITIONAL_PATIENT_HISTORY,
    tags::MEDICAL_RECORD_LOCATOR,
    tags::MILITARY_RANK,
    tags::BRANCH_OF_SERVICE,
    tags::COUNTRY_OF_RESIDENCE,
    tags::REGION_OF_RESIDENCE,
    tags::ADMISSION_ID,
    tags::ADMITTING_DIAGNOSES_DESCRIPTION,
    tags::ACCESSION_NUMBER,
    tags::STUDY_ID,
    tags::STUDY_DESCRIPTION,
    tags::SERIES_DESCRIPTION,
    tags::PROTOCOL_NAME,
    tags::IMAGE_COMMENTS,
    tags::STUDY_COMMENTS,
    tags::DERIVATION_DESCRIPTION,
    tags::ACQUISITION_COMMENTS,
    tags::INSTITUTION_NAME,
    tags::INSTITUTION_ADDRESS,
    tags::INSTITUTIONAL_DEPARTMENT_NAME,
    tags::STATION_NAME,
    tags::DEVICE_SERIAL_NUMBER,
    tags::REFERRING_PHYSICIAN_ADDRESS,
    tags::REFERRING_PHYSICIAN_TELEPHONE_NUMBERS,
    tags::REQUESTING_SERVICE,
    tags::REQUESTED_PROCEDURE_ID,
    tags::REQUESTED_PROCEDURE_DESCRIPTION,
    tags::REQUESTED_PROCEDURE_COMMENTS,
    tags::SCHEDULED_PROCEDURE_STEP_ID,
    tags::PERFORMED_PROCEDURE_STEP_ID,
    tags::PERFORMED_PROCEDURE_STEP_DESCRIPTION,
];

/// UIDs that denote a kind of object, not an instance.
const KINDS: [Tag; 3] = [
    tags::SOP_CLASS_UID,
    tags::REFERENCED_SOP_CLASS_UID,
    tags::TRANSFER_SYNTAX_UID,
];

fn collect_identifiers(data_set: &DataSet, depth: usize, found: &mut BTreeSet<&'static str>) {
    for element in data_set.elements() {
        let tag = element.tag;
        // Servers write UN for unknown attributes (PS3.5, section 6.2.2).
        let vr = element.vr().filter(|vr| *vr != VR::UN).unwrap_or_else(|| {
            let known = StandardDataDictionary.by_tag(tag);
            known.map_or(VR::UN, |entry| entry.vr.relaxed())
        });
        if vr == VR::SQ && depth > 0 {
            // A damaged sequence that nothing else needs does not stop reading.
            let items = data_set.items_of(element).unwrap_or_default();
            for item in &items {
                collect_identifiers(item, depth - 1, found);
            }
        }
        if vr == VR::SQ || file::text(data_set.value(element)).is_empty() {
            continue;
        }
        if tag.group() % 2 == 1 {
            found.insert("private attributes");
            continue;
        }
        let by_type = match vr {
            VR::PN | VR::DA | VR::DT => true,
            VR::UI => !KINDS.contains(&tag),
            _ => false,
        };
        if by_type || TELLING.contains(&tag) {
            found.insert(name(tag));
        }
    }
}

/// The keyword of an attribute, from the dictionary.
fn name(tag: Tag) -> &'static str {
    StandardDataDictionary
        .by_tag(tag)
        .map_or("an attribute without a name", |entry| entry.alias)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::dicom_series::element::Encoding;

    const SEQUENCE: Tag = tags::REQUEST_ATTRIBUTES_SEQUENCE;

    fn element(tag: Tag, vr: &[u8; 2], value: &[u8]) -> Vec<u8> {
        let start = [tag.0.to_le_bytes(), tag.1.to_le_bytes(), *vr, [0; 2]].concat();
        [&start, &(value.len() as u32).to_le_bytes()[..], value].concat()
    }

    fn sequence(items: &[u8], vr: &[u8; 2]) -> Vec<u8> {
        let length = (items.len() as u32).to_le_bytes();
        let item = [b"\xfe\xff\x00\xe0", &length[..], items].concat();
        element(SEQUENCE, vr, &item)
    }

    fn identifiers(bytes: &[u8]) -> Vec<&'static str> {
        let (set, _) = DataSet::parse(bytes, 0, Encoding::ExplicitLittle, |_| false).unwrap();
        let mut found = BTreeSet::new();
        collect_identifiers(&set, DEEPEST, &mut found);
        found.into_iter().collect()
    }

    /// Every occurrence has its own items: the walk is as long as the file, not 8^16 steps.
    #[test]
    fn a_sequence_that_stands_again_and_again_is_walked_once_each() {
        let mut bytes = element(tags::PATIENT_NAME, b"UN", b"Doe^John");
        for _ in 0..DEEPEST {
            let empty = sequence(&[], b"SQ").repeat(7);
            bytes = [sequence(&bytes, b"SQ"), empty].concat();
        }
        assert_eq!(identifiers(&bytes), ["PatientName"]);
        let second = [
            sequence(&[], b"SQ"),
            sequence(&element(tags::PATIENT_ID, b"UN", b"1"), b"SQ"),
        ];
        assert_eq!(identifiers(&second.concat()), ["PatientID"]);
    }

    /// Elements of unknown representation are recognised by their tags; their items are written implicitly.
    #[test]
    fn unknown_representations_do_not_hide_an_identifier() {
        let implicit = b"\x10\0\x10\0\x08\0\0\0Doe^John";
        assert_eq!(identifiers(&sequence(implicit, b"UN")), ["PatientName"]);
        let date = element(tags::STUDY_DATE, b"UN", b"20200101");
        assert_eq!(identifiers(&date), ["StudyDate"]);
        assert!(identifiers(&element(tags::ROWS, b"UN", b"\0\x02")).is_empty());
    }
}
