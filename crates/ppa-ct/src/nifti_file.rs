//! NIfTI-1 in and out.
//!
//! Header fields as defined in `nifti1.h` of the NIfTI-1 standard. World axes there are RAS
//! (x right, y anterior); ours are LPS, so both are flipped on the way.

mod affine;
mod values;
mod write;

use std::collections::BTreeSet;
use std::fs::File;
use std::io::{BufRead, BufReader, Cursor, Read};
use std::path::Path;

use flate2::bufread::MultiGzDecoder;
use nifti::NiftiHeader;

use crate::acquisition::Acquisition;
use crate::error::ReadError;
use crate::grid::Grid;
use crate::scan::{Scan, Warning, WarningCode, hu_plausibility};
use crate::volume::{Volume, VolumeError};
use values::Stored;
pub use write::write;

/// Length of a NIfTI-1 header.
const HEADER_BYTES: usize = 348;

/// Reads a single-file NIfTI-1 volume, gzipped or not.
pub(crate) fn read(path: &Path) -> Result<Scan, ReadError> {
    let context = Context { path };
    let mut file = BufReader::new(File::open(path).map_err(|e| context.io(e))?);
    let gzipped = file
        .fill_buf()
        .map_err(|e| context.io(e))?
        .starts_with(&[0x1f, 0x8b]);
    if gzipped {
        read_stream(&context, MultiGzDecoder::new(file))
    } else {
        read_stream(&context, file)
    }
}

/// The file an error has to name.
struct Context<'a> {
    path: &'a Path,
}

impl Context<'_> {
    fn io(&self, source: std::io::Error) -> ReadError {
        ReadError::Io {
            path: self.path.to_owned(),
            source,
        }
    }

    fn problem(&self, problem: impl Into<String>) -> ReadError {
        ReadError::Nifti {
            path: self.path.to_owned(),
            problem: problem.into(),
        }
    }
}

fn read_stream(context: &Context, mut stream: impl Read) -> Result<Scan, ReadError> {
    let header = read_header(context, &mut stream)?;
    let size = size(context, &header)?;
    let (ct_from_voxel, oriented) =
        affine::ct_from_voxel(&header).map_err(|p| context.problem(p))?;
    let unusable = |source| ReadError::Volume {
        path: context.path.to_owned(),
        source,
    };
    // Checked before the voxels are read: a singular affine needs no decompression.
    let grid = Grid::new(size, ct_from_voxel).map_err(|e| unusable(VolumeError::from(e)))?;

    let stored = Stored::of(&header).map_err(|p| context.problem(p))?;
    let bytes = read_voxels(context, &header, stored.bytes_for(size), stream)?;
    let volume = Volume::new(grid, stored.to_hu(&bytes)).map_err(unusable)?;

    let mut warnings = Vec::new();
    if !oriented {
        warnings.push(Warning {
            code: WarningCode::NiftiNoOrientation,
            text: "neither sform nor qform is set: axes are assumed to run to the right, \
                   anterior and superior, so left and right may be swapped"
                .to_owned(),
        });
    }
    warnings.extend(hu_plausibility(&volume));
    Ok(Scan {
        volume,
        modality: None,
        series: Vec::new(),
        acquisition: Acquisition {
            representable_hu: stored.representable_hu(),
            identifiers: free_text(&header),
            ..Acquisition::default()
        },
        warnings,
    })
}

/// Names of the header's free-text fields that hold something.
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

fn read_header(context: &Context, stream: &mut impl Read) -> Result<NiftiHeader, ReadError> {
    let mut bytes = Vec::with_capacity(HEADER_BYTES);
    stream
        .take(HEADER_BYTES as u64)
        .read_to_end(&mut bytes)
        .map_err(|e| context.io(e))?;
    if bytes.len() < HEADER_BYTES {
        return Err(context.problem(format!(
            "{} bytes, too short for the {HEADER_BYTES} of a NIfTI-1 header",
            bytes.len()
        )));
    }
    let length = [bytes[0], bytes[1], bytes[2], bytes[3]];
    if [i32::from_le_bytes(length), i32::from_be_bytes(length)].contains(&540) {
        return Err(context.problem("a NIfTI-2 file; expected NIfTI-1"));
    }
    let header = NiftiHeader::from_reader(Cursor::new(bytes))
        .map_err(|_| context.problem("no NIfTI-1 header (magic `n+1`) found"))?;
    if &header.magic != b"n+1\0" {
        return Err(context.problem(
            "a NIfTI header whose voxels lie in another file; expected both in one (magic `n+1`)",
        ));
    }
    Ok(header)
}

/// Voxels along i, j, k of a volume with three axes (further ones of length 1 are harmless).
fn size(context: &Context, header: &NiftiHeader) -> Result<[usize; 3], ReadError> {
    let axes = usize::from(header.dim[0]);
    let dim = &header.dim[1..];
    let three = (3..=7).contains(&axes) && dim[3..axes].iter().all(|&n| n == 1);
    // The field is signed: above i16::MAX it is a negative number.
    let positive = dim[..3].iter().all(|&n| (1..=i16::MAX as u16).contains(&n));
    if three && positive {
        return Ok([0, 1, 2].map(|axis| usize::from(dim[axis])));
    }
    Err(context.problem(format!(
        "dimensions {:?}, expected a volume with three axes",
        &dim[..axes.min(7)]
    )))
}

/// The voxel bytes; never more memory than the file really holds, whatever its header claims.
fn read_voxels(
    context: &Context,
    header: &NiftiHeader,
    expected: u64,
    mut stream: impl Read,
) -> Result<Vec<u8>, ReadError> {
    let offset = header.vox_offset;
    if !(HEADER_BYTES as f32..=1e9).contains(&offset) {
        return Err(context.problem(format!(
            "voxels at byte {offset}, expected them behind the header"
        )));
    }
    let gap = offset as u64 - HEADER_BYTES as u64;
    let mut bytes = Vec::new();
    std::io::copy(&mut (&mut stream).take(gap), &mut std::io::sink())
        .and_then(|_| (&mut stream).take(expected).read_to_end(&mut bytes))
        // To the very end: only there does gzip compare its checksum.
        .and_then(|_| std::io::copy(&mut stream, &mut std::io::sink()))
        .map_err(|e| context.io(e))?;
    if bytes.len() as u64 != expected {
        return Err(ReadError::PixelCount {
            path: context.path.to_owned(),
            found: bytes.len() as u64,
            expected,
        });
    }
    Ok(bytes)
}
