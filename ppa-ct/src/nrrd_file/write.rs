//! Writing NRRD.

use std::io::Write;
use std::path::Path;

use flate2::Compression;
use flate2::write::GzEncoder;
use ppa_core::whole_file;

use crate::error::WriteError;
use crate::stored::write_exact;
use crate::volume::Volume;

/// Writes a volume as `.nrrd`: one file, gzipped voxels, axes in LPS.
///
/// Integers that fit are stored as int16, anything else as float32. The affine, sheared or
/// not, is restored exactly on reading. The file is written completely or not at all, and its bytes
/// depend only on the volume.
///
/// # Errors
/// [`WriteError`] for another extension and failures of the file system.
pub fn write(path: &Path, volume: &Volume) -> Result<(), WriteError> {
    if !path
        .extension()
        .is_some_and(|e| e.eq_ignore_ascii_case("nrrd"))
    {
        return Err(WriteError::Extension {
            path: path.to_owned(),
            expected: "a name ending in .nrrd",
        });
    }
    whole_file::write_with(path, |out| {
        out.write_all(header(volume).as_bytes())?;
        // CT noise hardly compresses: higher levels take longer and save a few percent.
        let mut gzip = GzEncoder::new(out, Compression::fast());
        write_exact(&mut gzip, volume.values())?;
        gzip.finish().map(|_| ())
    })
    .map_err(|source| WriteError::Io {
        path: path.to_owned(),
        source,
    })
}

fn header(volume: &Volume) -> String {
    let [nx, ny, nz] = volume.grid().size();
    let kind = if volume.values().fit_i16() {
        "int16"
    } else {
        "float"
    };
    // Rust prints the shortest decimals that parse to the same number.
    let affine = volume.grid().ct_from_voxel().matrix();
    let vector = |column: usize| {
        let [x, y, z] = [0, 1, 2].map(|row| affine[(row, column)]);
        format!("({x},{y},{z})")
    };
    let [i, j, k, origin] = [0, 1, 2, 3].map(vector);
    format!(
        "NRRD0004\ntype: {kind}\ndimension: 3\nspace: left-posterior-superior\n\
         sizes: {nx} {ny} {nz}\nspace directions: {i} {j} {k}\n\
         kinds: domain domain domain\nendian: little\nencoding: gzip\n\
         space units: \"mm\" \"mm\" \"mm\"\nspace origin: {origin}\n\n"
    )
}
