//! The attributes of one frame, wherever its object stores them.

use std::path::Path;

use dicom_core::Tag;
use dicom_dictionary_std::tags;

use super::element::{DataSet, Fault};
use super::file::{damaged, text};
use crate::error::ReadError;

/// The data set of a file and, for multi-frame objects, the groups that apply to one frame.
pub(super) struct Attributes<'a> {
    pub path: &'a Path,
    pub data_set: &'a DataSet<'a>,
    /// Per-frame, then shared functional groups; empty for plain objects.
    pub groups: Vec<&'a Groups<'a>>,
    /// Real-world value mappings of the object itself.
    pub mappings: &'a [DataSet<'a>],
}

/// Functional groups of one frame, or those shared by all frames (PS3.3, section C.7.6.16).
///
/// Their sequences are parsed once, not for each frame and attribute.
pub(super) struct Groups<'a>(Vec<(Tag, Vec<DataSet<'a>>)>);

impl<'a> Groups<'a> {
    pub fn of(item: &DataSet<'a>) -> Result<Self, Fault> {
        let sequences = [
            tags::PLANE_POSITION_SEQUENCE,
            tags::PLANE_ORIENTATION_SEQUENCE,
            tags::PIXEL_MEASURES_SEQUENCE,
            tags::PIXEL_VALUE_TRANSFORMATION_SEQUENCE,
            tags::REAL_WORLD_VALUE_MAPPING_SEQUENCE,
        ];
        let sequences = sequences.map(|tag| Ok((tag, item.items(tag)?)));
        sequences.into_iter().collect::<Result<_, _>>().map(Self)
    }

    fn items(&self, sequence: Tag) -> &[DataSet<'a>] {
        let found = self.0.iter().find(|(tag, _)| *tag == sequence);
        found.map_or(&[], |(_, items)| items)
    }
}

impl<'a> Attributes<'a> {
    /// The attributes of an object without functional groups.
    pub fn of(path: &'a Path, data_set: &'a DataSet<'a>) -> Self {
        Self {
            path,
            data_set,
            groups: Vec::new(),
            mappings: &[],
        }
    }

    fn value(&self, tag: Tag) -> Option<&'a [u8]> {
        let grouped = group_of(tag).and_then(|sequence| {
            let first = |group: &&'a Groups<'a>| group.items(sequence).first()?.get(tag);
            self.groups.iter().find_map(first)
        });
        grouped.or_else(|| self.data_set.get(tag))
    }

    /// Returns an attribute as text without padding; `None` when it is absent or empty.
    pub fn text(&self, tag: Tag) -> Option<String> {
        self.value(tag).map(text).filter(|text| !text.is_empty())
    }

    /// Returns a 16-bit number that all frames share.
    pub fn word(&self, tag: Tag) -> Option<u16> {
        let bytes = self.data_set.get(tag)?.first_chunk::<2>()?;
        Some(self.data_set.encoding().u16(*bytes))
    }

    /// Returns a required 16-bit number.
    pub fn needed_word(&self, tag: Tag, name: &'static str) -> Result<u16, ReadError> {
        self.word(tag).ok_or_else(|| self.missing(name))
    }

    /// Returns required numbers written as text.
    pub fn numbers<const N: usize>(
        &self,
        tag: Tag,
        name: &'static str,
    ) -> Result<[f64; N], ReadError> {
        let text = self.text(tag).ok_or_else(|| self.missing(name))?;
        let values = text.split('\\').map(|part| part.trim().parse::<f64>().ok());
        let values = values.collect::<Option<Vec<_>>>();
        values
            .and_then(|values| <[f64; N]>::try_from(values).ok())
            .filter(|values| values.iter().all(|v| v.is_finite()))
            .ok_or_else(|| {
                // Text that is not numeric may be anything, even a name.
                let numeric = |c: char| c.is_ascii_digit() || "+-.eE\\ ".contains(c);
                let found = match text.chars().all(numeric) {
                    true => text,
                    false => "text".to_owned(),
                };
                self.bad(
                    name,
                    found,
                    "as many finite numbers as the standard specifies",
                )
            })
    }

    /// Returns a number written as text; `None` when it is absent or empty.
    pub fn optional(&self, tag: Tag, name: &'static str) -> Result<Option<f64>, ReadError> {
        match self.text(tag) {
            None => Ok(None),
            Some(_) => self.numbers::<1>(tag, name).map(|[value]| Some(value)),
        }
    }

    /// Returns the code of the unit of the frame's real-world values.
    pub fn real_world_unit(&self) -> Result<Option<String>, ReadError> {
        let fault = |f| damaged(self.path, f);
        let sequence = tags::REAL_WORLD_VALUE_MAPPING_SEQUENCE;
        let grouped = self.groups.iter().flat_map(|group| group.items(sequence));
        for mapping in grouped.chain(self.mappings) {
            let units = mapping.items(tags::MEASUREMENT_UNITS_CODE_SEQUENCE);
            let units = units.map_err(fault)?;
            if let Some(code) = units.first().and_then(|unit| unit.get(tags::CODE_VALUE)) {
                return Ok(Some(text(code)));
            }
        }
        Ok(None)
    }

    pub fn missing(&self, tag: &'static str) -> ReadError {
        ReadError::MissingTag {
            path: self.path.to_owned(),
            tag,
        }
    }

    pub fn bad(&self, tag: &'static str, found: String, expected: &'static str) -> ReadError {
        ReadError::BadTag {
            path: self.path.to_owned(),
            tag,
            found,
            expected,
        }
    }
}

/// Returns the functional group that holds an attribute in multi-frame objects.
fn group_of(tag: Tag) -> Option<Tag> {
    match tag {
        tags::IMAGE_POSITION_PATIENT => Some(tags::PLANE_POSITION_SEQUENCE),
        tags::IMAGE_ORIENTATION_PATIENT => Some(tags::PLANE_ORIENTATION_SEQUENCE),
        tags::PIXEL_SPACING | tags::SLICE_THICKNESS => Some(tags::PIXEL_MEASURES_SEQUENCE),
        tags::RESCALE_SLOPE | tags::RESCALE_INTERCEPT | tags::RESCALE_TYPE => {
            Some(tags::PIXEL_VALUE_TRANSFORMATION_SEQUENCE)
        }
        _ => None,
    }
}
