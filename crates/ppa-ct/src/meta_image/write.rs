//! Writing MetaImage.

use std::io::{self, Seek, Write};
use std::path::Path;

use flate2::Compression;
use flate2::write::ZlibEncoder;

use crate::error::WriteError;
use crate::stored::write_exact;
use crate::volume::Volume;
use crate::whole_file::write_whole;

/// Writes a volume as `.mha`, or as `.mhd` with its voxels in a `.zraw` beside it.
///
/// Voxels are deflated; whole numbers that fit are stored as int16, anything else as float32. The
/// affine may be sheared. Each file appears whole or not at all, the `.mhd` last, and their bytes
/// depend on the volume and the file name only.
///
/// # Errors
/// [`WriteError`] for another extension and a file system that refuses.
pub fn write(path: &Path, volume: &Volume) -> Result<(), WriteError> {
    let extension = path.extension().unwrap_or_default();
    let io = |path: &Path| {
        let path = path.to_owned();
        move |source| WriteError::Io { path, source }
    };
    // The data file's name goes into the header, which is text.
    let data = path.with_extension("zraw");
    let data_name = data.file_name().and_then(|name| name.to_str());
    match data_name {
        _ if extension.eq_ignore_ascii_case("mha") => write_whole(path, |out| {
            // The header tells the packed length, which is known last: it is written again, no longer.
            out.write_all(header(volume, 0, "LOCAL").as_bytes())?;
            let packed = write_packed(out, volume)?;
            out.rewind()?;
            out.write_all(header(volume, packed, "LOCAL").as_bytes())
        })
        .map_err(io(path)),
        Some(name) if extension.eq_ignore_ascii_case("mhd") => {
            let mut packed = 0;
            write_whole(&data, |out| {
                packed = write_packed(out, volume)?;
                Ok(())
            })
            .map_err(io(&data))?;
            let header = header(volume, packed, name);
            write_whole(path, |out| out.write_all(header.as_bytes())).map_err(|source| {
                // Voxels without a header are of no use; the first failure is the one to report.
                let _ = std::fs::remove_file(&data);
                io(path)(source)
            })
        }
        _ => Err(WriteError::Extension {
            path: path.to_owned(),
            expected: "a name ending in .mha or .mhd",
        }),
    }
}

/// Writes the deflated voxels and tells how many bytes they are.
fn write_packed(out: &mut dyn Write, volume: &Volume) -> io::Result<u64> {
    // CT noise hardly compresses: higher levels cost time and save a few percent.
    let mut zlib = ZlibEncoder::new(out, Compression::fast());
    write_exact(&mut zlib, volume.values())?;
    zlib.try_finish()?;
    Ok(zlib.total_out())
}

/// As long for any number of packed bytes.
fn header(volume: &Volume, packed_bytes: u64, data: &str) -> String {
    let grid = volume.grid();
    let kind = if volume.values().fit_i16() {
        "MET_SHORT"
    } else {
        "MET_FLOAT"
    };
    // Rust prints the shortest decimals that come back as the same number.
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
