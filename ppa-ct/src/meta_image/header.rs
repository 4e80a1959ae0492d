//! The lines of a MetaImage header.

use std::collections::{BTreeSet, HashMap};

use nalgebra::{Affine3, Matrix3, Matrix4, Vector3};

use crate::error::ReadError;
use crate::scan_file::ScanFile;
use crate::stored::{Number, Stored};

/// Longest header read, lines.
const MOST_LINES: usize = 10_000;

/// Keys of the format; ITK adds further ones for whatever else it knows of an image, such as DICOM attributes.
const KEYS: &[&str] = &[
    "ObjectType",
    "ObjectSubType",
    "NDims",
    "BinaryData",
    "BinaryDataByteOrderMSB",
    "ElementByteOrderMSB",
    "CompressedData",
    "CompressedDataSize",
    "CompressionLevel",
    "TransformMatrix",
    "Rotation",
    "Orientation",
    "Offset",
    "Position",
    "Origin",
    "CenterOfRotation",
    "AnatomicalOrientation",
    "DistanceUnits",
    "ElementSpacing",
    "ElementSize",
    "DimSize",
    "HeaderSize",
    "Modality",
    "SequenceID",
    "ElementMin",
    "ElementMax",
    "ElementNumberOfChannels",
    "ElementToIntensityFunctionSlope",
    "ElementToIntensityFunctionOffset",
    "ElementType",
    "ElementDataFile",
    "Color",
    "ID",
    "ParentID",
];

/// A header's values by key.
pub(super) struct Header {
    values: HashMap<String, String>,
}

/// Location of the voxels.
pub(super) enum Data<'a> {
    /// After the header.
    Here,
    /// In a file of this name next to the header.
    Beside(&'a str),
}

impl Header {
    /// Reads up to `ElementDataFile`, which the format requires to be last.
    pub(super) fn read(file: &mut ScanFile) -> Result<Self, ReadError> {
        let mut values = HashMap::new();
        for number in 1..MOST_LINES {
            let line = file.line()?;
            if line.trim().is_empty() && line.ends_with('\n') {
                continue;
            }
            // Messages do not repeat the words of a line: they may be about a person.
            let Some((key, value)) = line.split_once(['=', ':']) else {
                return Err(file.header(if line.is_empty() {
                    "the header ends without ElementDataFile".to_owned()
                } else {
                    format!("line {number} of the header is not a MetaImage `Key = Value` line")
                }));
            };
            let key = key.trim().to_owned();
            let last = key == "ElementDataFile";
            if values.insert(key, value.trim().to_owned()).is_some() {
                return Err(file.header(format!("line {number} of the header repeats a key")));
            }
            if last {
                return Ok(Self { values });
            }
        }
        Err(file.header(format!("the header does not end within {MOST_LINES} lines")))
    }

    /// Names of the fields with text chosen by the writer.
    pub(super) fn free_text(&self) -> BTreeSet<&'static str> {
        let further = self
            .values
            .keys()
            .filter(|key| !KEYS.contains(&key.as_str()));
        further
            .map(|key| match key.as_str() {
                "Comment" => "Comment",
                "Name" => "Name",
                "AcquisitionDate" => "AcquisitionDate",
                _ => "further keys",
            })
            .collect()
    }

    /// Value of the first of these keys that is present.
    fn get(&self, keys: &[&str]) -> Option<&str> {
        keys.iter()
            .find_map(|key| self.values.get(*key))
            .map(String::as_str)
    }

    fn need(&self, key: &str) -> Result<&str, String> {
        self.get(&[key])
            .ok_or_else(|| format!("the header lacks {key}"))
    }

    /// Parses a yes or no.
    fn flag(&self, keys: &[&str], default: bool) -> Result<bool, String> {
        match self.get(keys) {
            None => Ok(default),
            // MetaIO also looks only at the first letter.
            Some(value) if value.starts_with(['T', 't', '1']) => Ok(true),
            Some(value) if value.starts_with(['F', 'f', '0']) => Ok(false),
            Some(value) => Err(format!("{} is {value}, expected True or False", keys[0])),
        }
    }

    fn number(&self, key: &str, default: f64) -> Result<f64, String> {
        self.get(&[key])
            .map_or(Ok(default), |text| Ok(numbers::<1>(key, text)?[0]))
    }

    pub(super) fn size(&self) -> Result<[usize; 3], String> {
        let object = self.get(&["ObjectType"]).unwrap_or("Image");
        if object != "Image" {
            return Err(format!("an object of type {object}, expected an Image"));
        }
        let axes = self.need("NDims")?;
        let text = self.need("DimSize")?;
        let wrong = || format!("NDims {axes} with DimSize {text}, expected three axes");
        let size = text
            .split_whitespace()
            .map(|n| n.parse::<usize>().ok().filter(|&n| n > 0))
            .collect::<Option<Vec<_>>>()
            .ok_or_else(wrong)?;
        match (axes, <[usize; 3]>::try_from(size)) {
            ("3", Ok(size)) => Ok(size),
            _ => Err(wrong()),
        }
    }

    pub(super) fn stored(&self) -> Result<Stored, String> {
        let channels = self.get(&["ElementNumberOfChannels"]).unwrap_or("1");
        if channels != "1" {
            return Err(format!("{channels} channels, expected one"));
        }
        if !self.flag(&["BinaryData"], true)? {
            return Err(
                "voxels written as text (BinaryData = False); expected binary ones".to_owned(),
            );
        }
        let number = match self.need("ElementType")? {
            "MET_CHAR" => Number::I8,
            "MET_UCHAR" => Number::U8,
            "MET_SHORT" => Number::I16,
            "MET_USHORT" => Number::U16,
            // A long has four bytes here on any machine.
            "MET_INT" | "MET_LONG" => Number::I32,
            "MET_UINT" | "MET_ULONG" => Number::U32,
            "MET_LONG_LONG" => Number::I64,
            "MET_ULONG_LONG" => Number::U64,
            "MET_FLOAT" => Number::F32,
            "MET_DOUBLE" => Number::F64,
            other => {
                return Err(format!(
                    "voxels of type {other}, expected integers or floating-point numbers"
                ));
            }
        };
        Ok(Stored {
            number,
            big_endian: self.flag(&["BinaryDataByteOrderMSB", "ElementByteOrderMSB"], false)?,
            slope: self.number("ElementToIntensityFunctionSlope", 1.0)?,
            intercept: self.number("ElementToIntensityFunctionOffset", 0.0)?,
        })
    }

    pub(super) fn packed(&self) -> Result<bool, String> {
        self.flag(&["CompressedData"], false)
    }

    /// Bytes before the voxels in a separate data file; `None` if the voxels are at its end.
    pub(super) fn header_size(&self) -> Result<Option<u64>, String> {
        match self.get(&["HeaderSize"]).unwrap_or("0") {
            "-1" => Ok(None),
            text => text
                .parse()
                .map(Some)
                .map_err(|_| format!("HeaderSize is {text}, expected a number of bytes, or -1")),
        }
    }

    /// Voxel-to-LPS affine, and whether the header states orientation and position.
    pub(super) fn ct_from_voxel(&self) -> Result<(Affine3<f64>, bool), String> {
        let mm = match self.get(&["DistanceUnits"]).unwrap_or("mm") {
            "mm" | "?" => 1.0,
            "um" => 1e-3,
            "cm" => 10.0,
            other => return Err(format!("DistanceUnits is {other}, expected um, mm or cm")),
        };
        let spacing = numbers::<3>("ElementSpacing", self.need("ElementSpacing")?)?;
        if spacing.iter().any(|s| *s <= 0.0) {
            return Err(format!(
                "ElementSpacing is {}, expected positive numbers",
                ppa_core::text::numbers(spacing)
            ));
        }
        let matrix = self.get(&["TransformMatrix", "Rotation", "Orientation"]);
        let axes = match matrix {
            Some(text) => Matrix3::from_column_slice(&numbers::<9>("TransformMatrix", text)?),
            None => Matrix3::identity(),
        };
        let offset = self.get(&["Offset", "Position", "Origin"]);
        let origin = match offset {
            Some(text) => numbers::<3>("Offset", text)?,
            None => [0.0; 3],
        };
        let linear = axes * Matrix3::from_diagonal(&Vector3::from(spacing)) * mm;
        let mut affine: Matrix4<f64> = linear.to_homogeneous();
        affine
            .fixed_view_mut::<3, 1>(0, 3)
            .copy_from(&(Vector3::from(origin) * mm));
        Ok((
            Affine3::from_matrix_unchecked(affine),
            matrix.is_some() && offset.is_some(),
        ))
    }

    /// `CT`, `MR`, `NM` or `US`; `None` if the header does not say.
    pub(super) fn modality(&self) -> Result<Option<&str>, String> {
        let stated = self.get(&["Modality"]).unwrap_or("MET_MOD_UNKNOWN");
        match stated.strip_prefix("MET_MOD_") {
            Some("OTHER" | "UNKNOWN") => Ok(None),
            Some(modality @ ("CT" | "MR" | "NM" | "US")) => Ok(Some(modality)),
            _ => Err("Modality is not a value of the format".to_owned()),
        }
    }

    pub(super) fn data(&self) -> Result<Data<'_>, String> {
        match self.need("ElementDataFile")? {
            "LOCAL" | "Local" | "local" => Ok(Data::Here),
            list if list == "LIST" || list.starts_with("LIST ") => {
                Err("voxels in a LIST of data files; expected one data file".to_owned())
            }
            pattern if pattern.contains('%') => {
                Err("voxels in a numbered series of data files; expected one data file".to_owned())
            }
            name => Ok(Data::Beside(name)),
        }
    }
}

/// Whether readers take this for the name of one data file, and for exactly this name: MetaIO, which ITK reads with, takes
/// anything that begins with LIST for a list, and drops blanks at the ends.
pub(super) fn is_data_file(name: &str) -> bool {
    let special = |c: char| c == '%' || c == '\\' || c.is_control();
    name.trim() == name && !name.starts_with("LIST") && !name.contains(special)
}

/// Parses `N` finite numbers separated by blanks.
fn numbers<const N: usize>(key: &str, text: &str) -> Result<[f64; N], String> {
    let finite = |n: &str| n.parse().ok().filter(|v: &f64| v.is_finite());
    let found = text.split_whitespace().map(finite);
    found
        .collect::<Option<Vec<f64>>>()
        .and_then(|numbers| numbers.try_into().ok())
        .ok_or_else(|| format!("{key} is {text}, expected {N} finite numbers"))
}
