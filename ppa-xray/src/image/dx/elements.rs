//! Data elements by tag, with the value representation of the DICOM dictionary.

use dicom_core::dictionary::{DataDictionary, DataDictionaryEntry};
use dicom_core::value::DataSetSequence;
use dicom_core::{DataElement, Length, PrimitiveValue, Tag, VR};
use dicom_dictionary_std::{StandardDataDictionary, tags, uids};
use dicom_object::InMemDicomObject;

use crate::image::dx::examination::Code;

/// Builds a data set.
pub(super) struct Elements(InMemDicomObject);

impl Elements {
    pub fn new() -> Self {
        Self(InMemDicomObject::new_empty())
    }

    fn put(&mut self, tag: Tag, value: PrimitiveValue) {
        let vr = StandardDataDictionary
            .by_tag(tag)
            .map_or(VR::UN, |entry| entry.vr().relaxed());
        self.0.put(DataElement::new(tag, vr, value));
    }

    /// Text; several values are separated by backslashes.
    pub fn text(&mut self, tag: Tag, value: &str) {
        self.put(tag, value.into());
    }

    /// No value, for an unknown type 2 attribute.
    pub fn empty(&mut self, tag: Tag) {
        self.put(tag, PrimitiveValue::Empty);
    }

    /// An unsigned 16-bit number.
    pub fn short(&mut self, tag: Tag, value: u16) {
        self.put(tag, value.into());
    }

    /// A signed 16-bit number.
    pub fn signed(&mut self, tag: Tag, value: i16) {
        self.put(tag, value.into());
    }

    /// Decimal strings.
    pub fn decimals(&mut self, tag: Tag, values: &[f64]) {
        let texts: Vec<String> = values.iter().map(|value| decimal(*value)).collect();
        self.text(tag, &texts.join("\\"));
    }

    /// Integer strings, rounded.
    pub fn integers(&mut self, tag: Tag, values: &[f64]) {
        let texts: Vec<String> = values
            .iter()
            .map(|value| format!("{:.0}", value.clamp(-2_147_483_648.0, 2_147_483_647.0)))
            .collect();
        self.text(tag, &texts.join("\\"));
    }

    /// A look-up table as a sequence of one item (PS3.3 C.11.2.1.1): 16-bit grey values of the stored values starting at `first`.
    pub fn voi_lut(&mut self, explanation: &str, first: u16, table: Vec<u16>) {
        let mut item = Self::new();
        // A count of 65 536 is written as 0.
        let descriptor = [table.len() as u16, first, 16];
        item.put(
            tags::LUT_DESCRIPTOR,
            PrimitiveValue::U16(descriptor.as_slice().into()),
        );
        item.text(tags::LUT_EXPLANATION, explanation);
        item.words(tags::LUT_DATA, table);
        self.sequence(tags::VOILUT_SEQUENCE, vec![item.0]);
    }

    /// A sequence of one coded concept.
    pub fn code(&mut self, tag: Tag, code: Code) {
        self.sequence(tag, vec![code_item(code).0]);
    }

    /// A sequence without items.
    pub fn no_items(&mut self, tag: Tag) {
        self.sequence(tag, Vec::new());
    }

    fn sequence(&mut self, tag: Tag, items: Vec<InMemDicomObject>) {
        let sequence = DataSetSequence::new(items, Length::UNDEFINED);
        self.0.put(DataElement::new(tag, VR::SQ, sequence));
    }

    /// 16-bit words, such as pixels, of any number; other representations are limited to 65 534 bytes.
    pub fn words(&mut self, tag: Tag, words: Vec<u16>) {
        self.0.put(DataElement::new(
            tag,
            VR::OW,
            PrimitiveValue::U16(words.into()),
        ));
    }

    /// The encoded data set.
    pub fn bytes(&self) -> Result<Vec<u8>, Box<dyn std::error::Error + Send + Sync>> {
        let mut bytes = Vec::new();
        let syntax = dicom_object::meta::FileMetaTableBuilder::new()
            .transfer_syntax(uids::EXPLICIT_VR_LITTLE_ENDIAN)
            .media_storage_sop_class_uid(uids::DIGITAL_X_RAY_IMAGE_STORAGE_FOR_PROCESSING)
            .media_storage_sop_instance_uid("2.25.0");
        self.0
            .clone()
            .with_meta(syntax)?
            .write_dataset(&mut bytes)?;
        Ok(bytes)
    }

    pub fn into_object(self) -> InMemDicomObject {
        self.0
    }
}

fn code_item(code: Code) -> Elements {
    let mut item = Elements::new();
    item.text(tags::CODE_VALUE, code.value);
    item.text(tags::CODING_SCHEME_DESIGNATOR, code.scheme);
    item.text(tags::CODE_MEANING, code.meaning);
    item
}

/// Formats a number in the 16 characters of a decimal string.
fn decimal(value: f64) -> String {
    let exact = value.to_string();
    if exact.len() <= 16 {
        return exact;
    }
    (0..=9)
        .rev()
        .map(|digits| format!("{value:.digits$e}"))
        .find(|text| text.len() <= 16)
        .unwrap_or(exact)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn decimal_strings_fit_and_say_the_number() {
        for value in [
            0.0,
            0.5,
            -1.0 / 3.0,
            1e-300,
            123_456_789.123_456_79,
            -2e10 / 7.0,
        ] {
            let text = decimal(value);
            assert!(text.len() <= 16, "{text}");
            let back: f64 = text.parse().unwrap();
            assert!((back - value).abs() <= 1e-7 * value.abs(), "{text}");
        }
    }
}
