//! Writing MetaImage.

use std::fs;
use std::io::{self, Seek, Write};
use std::path::{Path, PathBuf};

use flate2::write::ZlibEncoder;
use flate2::{Compression, CrcWriter};
use ppa_core::whole_file;

use super::header::{Data, Header, is_data_file};
use crate::error::WriteError;
use crate::scan_file::ScanFile;
use crate::stored::write_exact;
use crate::volume::Volume;

/// Writes a volume as `.mha`, or as `.mhd` with its voxels in a `.zraw` next to it.
///
/// Voxels are deflated; integers that fit are stored as int16, anything else as float32. The affine
/// may be sheared. A file is written completely or not at all, and its bytes depend only on the volume and
/// the file name. The data file of `leg.mhd` is called `leg.<checksum of the voxels>.zraw`: an earlier pair of that name, if any, stays
/// readable until the new header replaces its own, and then its data file is removed.
///
/// # Errors
/// [`WriteError`] for another extension, a name that the header cannot hold, and failures of the file system.
pub fn write(path: &Path, volume: &Volume) -> Result<(), WriteError> {
    let extension = path.extension().unwrap_or_default();
    if extension.eq_ignore_ascii_case("mha") {
        whole_file::write_with(path, |out| {
            // The header states the packed length, which is known last: it is overwritten by one that is not longer.
            out.write_all(header(volume, 0, "LOCAL").as_bytes())?;
            let packed = write_packed(out, volume)?;
            out.rewind()?;
            out.write_all(header(volume, packed, "LOCAL").as_bytes())
        })
        .map_err(io_at(path))
    } else if extension.eq_ignore_ascii_case("mhd") {
        write_pair(path, volume)
    } else {
        Err(WriteError::Extension {
            path: path.to_owned(),
            expected: "a name ending in .mha or .mhd",
        })
    }
}

fn io_at(path: &Path) -> impl FnOnce(io::Error) -> WriteError {
    let path = path.to_owned();
    move |source| WriteError::Io { path, source }
}

fn write_pair(path: &Path, volume: &Volume) -> Result<(), WriteError> {
    let stem = path.file_stem().and_then(|stem| stem.to_str());
    let name = |stem| Ok(format!("{stem}.{:08x}.zraw", checksum(volume)?));
    let name = stem.map(name).transpose().map_err(io_at(path))?;
    let name = name.filter(|name| is_data_file(name));
    let Some(name) = name else {
        return Err(WriteError::Name {
            path: path.to_owned(),
            expected: "in Unicode without a leading blank, LIST at its start, %, backslashes or control characters, \
                       which the header of a .mhd file cannot hold",
        });
    };
    let data = path.with_file_name(&name);
    let before = data_file_before(path);
    let mut packed = 0;
    whole_file::write_with(&data, |out| {
        packed = write_packed(out, volume)?;
        Ok(())
    })
    .map_err(io_at(&data))?;
    let header = header(volume, packed, &name);
    let written = whole_file::write(path, header.as_bytes());
    // Voxels without a header are useless; a failure to remove them matters less than the result of the write.
    let unused = match &written {
        Ok(()) => before.filter(|before| *before != data),
        Err(_) => Some(data).filter(|data| before.as_ref() != Some(data)),
    };
    if let Some(unused) = unused {
        let _ = fs::remove_file(unused);
    }
    written.map_err(io_at(path))
}

/// Data file of the pair that has this header, if its name has our form: others may be shared.
fn data_file_before(path: &Path) -> Option<PathBuf> {
    let header = Header::read(&mut ScanFile::open(path).ok()?).ok()?;
    let Ok(Data::Beside(name)) = header.data() else {
        return None;
    };
    let stem = path.file_stem()?.to_str()?;
    let sum = name
        .strip_prefix(stem)?
        .strip_prefix('.')?
        .strip_suffix(".zraw")?;
    let ours = sum.len() == 8 && sum.chars().all(|c| c.is_ascii_hexdigit());
    ours.then(|| path.with_file_name(name))
}

/// CRC-32 of the voxels as they are written.
fn checksum(volume: &Volume) -> io::Result<u32> {
    let mut sum = CrcWriter::new(io::sink());
    write_exact(&mut sum, volume.values())?;
    Ok(sum.crc().sum())
}

/// Writes the deflated voxels and returns their length in bytes.
fn write_packed(out: &mut dyn Write, volume: &Volume) -> io::Result<u64> {
    // CT noise hardly compresses: higher levels take longer and save a few percent.
    let mut zlib = ZlibEncoder::new(out, Compression::fast());
    write_exact(&mut zlib, volume.values())?;
    zlib.try_finish()?;
    Ok(zlib.total_out())
}

/// Makes a header whose length does not depend on the number of packed bytes.
fn header(volume: &Volume, packed_bytes: u64, data: &str) -> String {
    let grid = volume.grid();
    let kind = if volume.values().fit_i16() {
        "MET_SHORT"
    } else {
        "MET_FLOAT"
    };
    // Rust prints the shortest decimals that parse to the same number.
    let list = |numbers: &[f64]| {
        numbers
            .iter()
            .map(f64::to_string)
            .collect::<Vec<_>>()
            .join(" ")
    };
    let [nx, ny, nz] = grid.size();
    format!(
        "ObjectType = Image\nNDims = 3\nBinaryData = True\nBinaryDataByteOrderMSB = False\n\
         CompressedData = True\nCompressedDataSize = {packed_bytes:<20}\nTransformMatrix = {}\nOffset = {}\n\
         CenterOfRotation = 0 0 0\nElementSpacing = {}\nDimSize = {nx} {ny} {nz}\nElementType = {kind}\n\
         ElementDataFile = {data}\n",
        list(grid.direction().as_slice()),
        list(grid.origin_mm().coords.as_slice()),
        list(grid.spacing_mm().as_slice()),
    )
}
