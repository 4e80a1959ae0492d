//! Reading and writing NIfTI-1.
//!
//! Header fields as defined in `nifti1.h` of the NIfTI-1 standard. World axes there are RAS
//! (x right, y anterior) and here LPS, so x and y are flipped on conversion.

mod affine;
mod write;

use std::collections::BTreeSet;
use std::io::Cursor;
use std::path::Path;

use nifti::{Endianness, NiftiHeader};

use crate::acquisition::Acquisition;
use crate::error::ReadError;
use crate::scan::Scan;
use crate::scan_file::{self, Packing, ScanFile};
use crate::stored::{Number, Stored};
pub use write::write;

/// Length of a NIfTI-1 header.
const HEADER_BYTES: usize = 348;

/// Reads a single-file NIfTI-1 volume, gzipped or not.
pub(crate) fn read(path: &Path) -> Result<Scan, ReadError> {
    let mut file = ScanFile::open(path)?;
    if file.next_is(&[0x1f, 0x8b])? {
        file = file.unpacked(Packing::Gzip);
    }
    let header = read_header(&mut file)?;
    let size = size(&header).map_err(|p| file.header(p))?;
    let (ct_from_voxel, oriented) = affine::ct_from_voxel(&header).map_err(|p| file.header(p))?;
    // Checked before the voxels are read: a singular affine is refused without decompression.
    let grid = file.grid(size, ct_from_voxel)?;
    let stored = stored(&header).map_err(|p| file.header(p))?;
    let gap = gap(&header).map_err(|p| file.header(p))?;
    // Header extensions: comments, DICOM elements, or any data of other programs.
    let extended = file.skip_filled(gap)?;
    let hu = file.voxels(&stored, size)?;
    let warning = (!oriented).then(|| {
        scan_file::no_orientation(
            "neither sform nor qform is set: axes are assumed to run to the right, \
             anterior and superior, so left and right may be swapped",
        )
    });
    let acquisition = Acquisition {
        representable_hu: stored.representable_hu(),
        identifiers: free_text(&header)
            .into_iter()
            .chain(extended.then_some("header extensions"))
            .collect(),
        ..Acquisition::default()
    };
    scan_file::scan(path, grid, hu, None, acquisition, warning)
}

/// Names of the header's free-text fields that are not empty.
fn free_text(header: &NiftiHeader) -> BTreeSet<&'static str> {
    let fields: [(&'static str, &[u8]); 4] = [
        ("descrip", &header.descrip),
        ("aux_file", &header.aux_file),
        ("db_name", &header.db_name),
        ("intent_name", &header.intent_name),
    ];
    let filled = |text: &[u8]| text.iter().any(|c| !matches!(c, 0 | b' '));
    let named = fields.into_iter().filter(|(_, text)| filled(text));
    named.map(|(name, _)| name).collect()
}

fn read_header(file: &mut ScanFile) -> Result<NiftiHeader, ReadError> {
    let bytes = file.bytes(HEADER_BYTES)?;
    if bytes.len() < HEADER_BYTES {
        return Err(file.header(format!(
            "{} bytes, expected at least the {HEADER_BYTES} bytes of a NIfTI-1 header",
            bytes.len()
        )));
    }
    let length = [bytes[0], bytes[1], bytes[2], bytes[3]];
    if [i32::from_le_bytes(length), i32::from_be_bytes(length)].contains(&540) {
        return Err(file.header("a NIfTI-2 file; expected NIfTI-1"));
    }
    let header = NiftiHeader::from_reader(Cursor::new(bytes))
        .map_err(|_| file.header("no NIfTI-1 header (magic `n+1`) found"))?;
    if &header.magic != b"n+1\0" {
        return Err(file.header(
            "a NIfTI header whose voxels are in a separate file; expected both in one file (magic `n+1`)",
        ));
    }
    Ok(header)
}

/// Voxels along i, j, k of a volume with three axes (further ones of length 1 are harmless).
fn size(header: &NiftiHeader) -> Result<[usize; 3], String> {
    let axes = usize::from(header.dim[0]);
    let dim = &header.dim[1..];
    let three = (3..=7).contains(&axes) && dim[3..axes].iter().all(|&n| n == 1);
    // The field is signed: values above i16::MAX are negative numbers.
    let positive = dim[..3].iter().all(|&n| (1..=i16::MAX as u16).contains(&n));
    if three && positive {
        return Ok([0, 1, 2].map(|axis| usize::from(dim[axis])));
    }
    Err(format!(
        "dimensions {}, expected a volume with three axes",
        ppa_core::text::numbers(dim[..axes.min(7)].iter().copied())
    ))
}

/// Storage format of the voxels (`datatype` codes of `nifti1.h`).
fn stored(header: &NiftiHeader) -> Result<Stored, String> {
    let number = match header.datatype {
        2 => Number::U8,
        4 => Number::I16,
        8 => Number::I32,
        16 => Number::F32,
        64 => Number::F64,
        256 => Number::I8,
        512 => Number::U16,
        768 => Number::U32,
        1024 => Number::I64,
        1280 => Number::U64,
        code => {
            return Err(format!(
                "voxels of datatype code {code}, expected integers or floating-point numbers"
            ));
        }
    };
    let [slope, intercept] = scaling(header)?;
    Ok(Stored {
        number,
        big_endian: header.endianness == Endianness::Big,
        slope,
        intercept,
    })
}

/// Slope and intercept from stored numbers to HU; a slope of 0, or NaN as some programs write it, means none.
fn scaling(header: &NiftiHeader) -> Result<[f64; 2], String> {
    let [slope, intercept] = [header.scl_slope, header.scl_inter].map(f64::from);
    if slope == 0.0 || slope.is_nan() {
        return Ok([1.0, 0.0]);
    }
    if slope.is_finite() && intercept.is_finite() {
        return Ok([slope, intercept]);
    }
    Err(format!(
        "scl_slope {slope} and scl_inter {intercept}, expected finite numbers, or a slope of 0 or NaN for no scaling"
    ))
}

/// Bytes between header and voxels, which extensions fill.
fn gap(header: &NiftiHeader) -> Result<u64, String> {
    let offset = header.vox_offset;
    if !(HEADER_BYTES as f32..=1e9).contains(&offset) {
        return Err(format!(
            "voxels at byte {offset}, expected them after the header"
        ));
    }
    Ok(offset as u64 - HEADER_BYTES as u64)
}
