//! The lines of an NRRD header.

use std::collections::{BTreeSet, HashMap};

use crate::error::ReadError;
use crate::scan_file::{Packing, ScanFile};
use crate::stored::{Number, Stored};

/// Supported fields of the format, without their blanks.
const USED: &[&str] = &[
    "type",
    "dimension",
    "sizes",
    "encoding",
    "endian",
    "datafile",
    "lineskip",
    "byteskip",
    "space",
    "spacedimension",
    "spaceunits",
    "spaceorigin",
    "spacedirections",
    "spacings",
    "units",
    "kinds",
];

/// Fields that change neither the value nor the position of a voxel.
///
/// `centers` belongs here: `space origin` is the centre of the first sample in any case.
const IRRELEVANT: &[&str] = &[
    "number",
    "blocksize",
    "min",
    "max",
    "oldmin",
    "oldmax",
    "sampleunits",
    "thicknesses",
    "axismins",
    "axismaxs",
    "centers",
    "centerings",
    "labels",
    "measurementframe",
];

/// Comments that teem, ITK and others write into every header.
const COMMON_COMMENTS: &[&str] = &[
    "",
    "Complete NRRD file format specification at:",
    "http://teem.sourceforge.net/nrrd/format.html",
];

/// Longest header read, lines.
const MOST_LINES: usize = 10_000;

/// A header's fields by name (lower case, no blanks).
pub(super) struct Header {
    fields: HashMap<&'static str, String>,
    free_text: BTreeSet<&'static str>,
}

/// What to skip before the voxels.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Skip {
    Bytes(u64),
    /// Everything before the voxels, which are at the end.
    AllButVoxels,
}

impl Header {
    /// Reads up to the empty line before the voxels, or to the end of a detached header.
    pub(super) fn read(file: &mut ScanFile) -> Result<Self, ReadError> {
        let magic = file.line()?;
        if !(1..=5).any(|version| magic.trim_end() == format!("NRRD000{version}")) {
            return Err(file.header("no NRRD header (magic `NRRD0001` to `NRRD0005`) found"));
        }
        let mut header = Self {
            fields: HashMap::new(),
            free_text: BTreeSet::new(),
        };
        for number in 2..MOST_LINES {
            let line = file.line()?;
            if line.trim_end_matches(['\r', '\n']).is_empty() {
                let detached = header.fields.contains_key("datafile");
                if line.is_empty() && !detached {
                    return Err(file.header("the header does not end with an empty line"));
                }
                return Ok(header);
            }
            if !line.ends_with('\n') {
                return Err(file.header("the header ends in the middle of a line"));
            }
            header
                .take(line.trim())
                .map_err(|problem| file.header(format!("line {number} of the header {problem}")))?;
        }
        Err(file.header(format!("the header does not end within {MOST_LINES} lines")))
    }

    /// Parses one line. Messages do not repeat its words: they may be about a person.
    fn take(&mut self, line: &str) -> Result<(), &'static str> {
        if let Some(comment) = line.strip_prefix('#') {
            if !COMMON_COMMENTS.contains(&comment.trim()) {
                self.free_text.insert("comments");
            }
            return Ok(());
        }
        let Some((field, value)) = line.split_once(':') else {
            return Err("is neither a field nor a comment");
        };
        if value.starts_with('=') {
            self.free_text.insert("key/value pairs");
            return Ok(());
        }
        let name = field.replace(' ', "").to_ascii_lowercase();
        if name == "content" {
            self.free_text.insert("content");
            return Ok(());
        }
        if IRRELEVANT.contains(&name.as_str()) {
            return Ok(());
        }
        let Some(name) = USED.iter().find(|known| **known == name) else {
            return Err("is not a field of the format");
        };
        match self.fields.insert(name, value.trim().to_owned()) {
            None => Ok(()),
            Some(_) => Err("repeats a field"),
        }
    }

    /// Value of a field, by its name without blanks.
    pub(super) fn get(&self, name: &str) -> Option<&str> {
        self.fields.get(name).map(String::as_str)
    }

    /// Names of the fields with text chosen by the writer.
    pub(super) fn free_text(&self) -> BTreeSet<&'static str> {
        self.free_text.clone()
    }

    fn need(&self, name: &str) -> Result<&str, String> {
        self.get(name)
            .ok_or_else(|| format!("the header lacks `{name}`"))
    }

    pub(super) fn size(&self) -> Result<[usize; 3], String> {
        let dimension = self.need("dimension")?;
        let sizes = self.need("sizes")?;
        let wrong = || format!("dimension {dimension} with sizes {sizes}, expected three axes");
        let numbers = sizes
            .split_whitespace()
            .map(|n| n.parse::<usize>().ok().filter(|&n| n > 0))
            .collect::<Option<Vec<_>>>()
            .ok_or_else(wrong)?;
        let kinds = self.get("kinds").unwrap_or("");
        let spatial = |kind: &str| ["domain", "space", "none", "???"].contains(&kind);
        if !kinds.to_ascii_lowercase().split_whitespace().all(spatial) {
            return Err(format!(
                "axes of kinds {kinds}, expected three spatial axes"
            ));
        }
        match (dimension, <[usize; 3]>::try_from(numbers)) {
            ("3", Ok(size)) => Ok(size),
            _ => Err(wrong()),
        }
    }

    pub(super) fn stored(&self) -> Result<Stored, String> {
        let number = number(self.need("type")?)?;
        let big_endian = match self.get("endian").map(str::to_ascii_lowercase).as_deref() {
            Some("little") => false,
            Some("big") => true,
            None if number.bytes() == 1 => false,
            None => return Err("the header lacks `endian`".to_owned()),
            Some(other) => return Err(format!("endian {other}, expected little or big")),
        };
        Ok(Stored {
            number,
            big_endian,
            slope: 1.0,
            intercept: 0.0,
        })
    }

    pub(super) fn packing(&self) -> Result<Packing, String> {
        match self.need("encoding")?.to_ascii_lowercase().as_str() {
            "raw" => Ok(Packing::Raw),
            "gzip" | "gz" => Ok(Packing::Gzip),
            other => Err(format!("encoding {other}, expected raw or gzip")),
        }
    }

    pub(super) fn line_skip(&self) -> Result<u64, String> {
        let text = self.get("lineskip").unwrap_or("0");
        text.parse()
            .map_err(|_| format!("line skip {text}, expected a number of lines"))
    }

    pub(super) fn byte_skip(&self) -> Result<Skip, String> {
        match self.get("byteskip").unwrap_or("0") {
            "-1" => Ok(Skip::AllButVoxels),
            text => text
                .parse()
                .map(Skip::Bytes)
                .map_err(|_| format!("byte skip {text}, expected a number of bytes, or -1")),
        }
    }

    /// Name of the single file with the voxels, if they are not in this one.
    pub(super) fn data_file(&self) -> Result<Option<&str>, String> {
        match self.get("datafile") {
            Some(list) if list == "LIST" || list.starts_with("LIST ") => {
                Err("voxels in a LIST of data files; expected one data file".to_owned())
            }
            Some(pattern) if pattern.contains('%') => {
                Err("voxels in a numbered series of data files; expected one data file".to_owned())
            }
            name => Ok(name),
        }
    }
}

fn number(name: &str) -> Result<Number, String> {
    let words = name.to_ascii_lowercase();
    let words = words.split_whitespace().collect::<Vec<_>>().join(" ");
    Ok(match words.as_str() {
        "signed char" | "int8" | "int8_t" => Number::I8,
        "uchar" | "unsigned char" | "uint8" | "uint8_t" => Number::U8,
        "short" | "short int" | "signed short" | "signed short int" | "int16" | "int16_t" => {
            Number::I16
        }
        "ushort" | "unsigned short" | "unsigned short int" | "uint16" | "uint16_t" => Number::U16,
        "int" | "signed int" | "int32" | "int32_t" => Number::I32,
        "uint" | "unsigned int" | "uint32" | "uint32_t" => Number::U32,
        "longlong"
        | "long long"
        | "long long int"
        | "signed long long"
        | "signed long long int"
        | "int64"
        | "int64_t" => Number::I64,
        "ulonglong" | "unsigned long long" | "unsigned long long int" | "uint64" | "uint64_t" => {
            Number::U64
        }
        "float" => Number::F32,
        "double" => Number::F64,
        _ => {
            return Err(format!(
                "voxels of type {name}, expected integers or floating-point numbers"
            ));
        }
    })
}
