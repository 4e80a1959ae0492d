//! Writing NIfTI-1.

use std::io::Write;
use std::path::Path;

use flate2::Compression;
use flate2::write::GzEncoder;
use nifti::NiftiHeader;
use ppa_core::whole_file;

use super::affine::set_affine;
use crate::error::WriteError;
use crate::stored::write_exact;
use crate::volume::Volume;

/// Voxels follow the header and the four bytes that declare no extension.
const VOXELS_AT: f32 = 352.0;

/// Writes a volume as NIfTI-1: `.nii`, or `.nii.gz` compressed.
///
/// Integers that fit are stored as int16, anything else as float32. The affine is stored in the sform, and also in the qform unless it is
/// sheared; both hold it as f32. The file is written completely
/// or not at all, and its bytes depend only on the volume.
///
/// # Errors
/// [`WriteError`] for another extension, more than 32767 voxels along an axis, and failures of
/// the file system.
pub fn write(path: &Path, volume: &Volume) -> Result<(), WriteError> {
    let name = path.file_name().unwrap_or_default().to_string_lossy();
    let name = name.to_ascii_lowercase();
    let compress = name.ends_with(".nii.gz");
    if !compress && !name.ends_with(".nii") {
        return Err(WriteError::Extension {
            path: path.to_owned(),
            expected: "a name ending in .nii or .nii.gz",
        });
    }
    let size = volume.grid().size();
    let most = i16::MAX as usize;
    if size.iter().any(|&n| n > most) {
        return Err(WriteError::TooLarge {
            size,
            format: "NIfTI-1",
            most,
        });
    }
    whole_file::write_with(path, |out| {
        if compress {
            // CT noise hardly compresses: higher levels take longer and save a few percent.
            let mut gzip = GzEncoder::new(out, Compression::fast());
            write_stream(&mut gzip, volume)?;
            gzip.finish().map(|_| ())
        } else {
            write_stream(out, volume)
        }
    })
    .map_err(|source| WriteError::Io {
        path: path.to_owned(),
        source,
    })
}

fn write_stream(out: &mut dyn Write, volume: &Volume) -> std::io::Result<()> {
    out.write_all(&header_bytes(&header(volume)))?;
    write_exact(out, volume.values())
}

fn header(volume: &Volume) -> NiftiHeader {
    let [nx, ny, nz] = volume.grid().size().map(|n| n as u16);
    let (datatype, bitpix) = if volume.values().fit_i16() {
        (4, 16)
    } else {
        (16, 32)
    };
    let mut header = NiftiHeader {
        dim: [3, nx, ny, nz, 1, 1, 1, 1],
        datatype,
        bitpix,
        vox_offset: VOXELS_AT,
        scl_slope: 1.0,
        xyzt_units: 2, // mm
        magic: *b"n+1\0",
        ..NiftiHeader::default()
    };
    set_affine(&mut header, volume.grid().ct_from_voxel());
    header
}

/// The non-zero fields, little-endian at their offsets in `nifti1.h`.
fn header_bytes(header: &NiftiHeader) -> [u8; VOXELS_AT as usize] {
    let mut bytes = [0; VOXELS_AT as usize];
    let mut put = |at: usize, field: &[u8]| bytes[at..at + field.len()].copy_from_slice(field);
    put(0, &header.sizeof_hdr.to_le_bytes());
    put(38, b"r"); // "regular", which old readers look for
    for (n, v) in header.dim.iter().enumerate() {
        put(40 + 2 * n, &v.to_le_bytes());
    }
    put(70, &header.datatype.to_le_bytes());
    put(72, &header.bitpix.to_le_bytes());
    for (n, v) in header.pixdim.iter().enumerate() {
        put(76 + 4 * n, &v.to_le_bytes());
    }
    put(108, &header.vox_offset.to_le_bytes());
    put(112, &header.scl_slope.to_le_bytes());
    put(116, &header.scl_inter.to_le_bytes());
    put(123, &[header.xyzt_units]);
    put(252, &header.qform_code.to_le_bytes());
    put(254, &header.sform_code.to_le_bytes());
    let turn = [
        header.quatern_b,
        header.quatern_c,
        header.quatern_d,
        header.quatern_x,
        header.quatern_y,
        header.quatern_z,
    ];
    let rows = [header.srow_x, header.srow_y, header.srow_z].concat();
    for (n, v) in turn.into_iter().chain(rows).enumerate() {
        put(256 + 4 * n, &v.to_le_bytes());
    }
    put(344, &header.magic);
    bytes
}
