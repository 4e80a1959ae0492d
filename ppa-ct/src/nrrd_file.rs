//! NRRD files: a text header, then raw or gzipped voxels in the same file or a separate one.
//!
//! Fields as in the "Definition of NRRD File Format" (teem.sourceforge.net/nrrd/format.html).

mod header;
mod space;
mod write;

use std::path::Path;

use crate::acquisition::Acquisition;
use crate::error::ReadError;
use crate::scan::Scan;
use crate::scan_file::{self, Packing, ScanFile};
use header::{Header, Skip};
use space::Place;
pub use write::write;

/// Reads `.nrrd`, or `.nhdr` with its data file.
pub(crate) fn read(path: &Path) -> Result<Scan, ReadError> {
    let mut file = ScanFile::open(path)?;
    let header = Header::read(&mut file)?;
    let size = header.size().map_err(|p| file.header(p))?;
    let stored = header.stored().map_err(|p| file.header(p))?;
    let packing = header.packing().map_err(|p| file.header(p))?;
    let byte_skip = header.byte_skip().map_err(|p| file.header(p))?;
    let line_skip = header.line_skip().map_err(|p| file.header(p))?;
    let place = Place::of(&header).map_err(|p| file.header(p))?;
    let grid = file.grid(size, place.ct_from_voxel)?;

    let mut data = match header.data_file().map_err(|p| file.header(p))? {
        Some(name) => file.open_beside(name)?,
        None => file,
    };
    for _ in 0..line_skip {
        if !data.line()?.ends_with('\n') {
            return Err(data.header("fewer lines than `line skip` specifies"));
        }
    }
    // Lines are skipped in the file, bytes in its unpacked contents.
    let mut data = data.unpacked(packing);
    match byte_skip {
        Skip::Bytes(count) => data.skip(count)?,
        Skip::AllButVoxels if packing == Packing::Raw => {
            data.skip_to_last(stored.bytes_of(size).unwrap_or(u64::MAX))?;
        }
        Skip::AllButVoxels => {
            return Err(
                data.header("`byte skip` of -1 with compressed voxels; expected uncompressed ones")
            );
        }
    }
    let hu = data.voxels(&stored, size)?;
    let warning = place.doubt.as_deref().map(scan_file::no_orientation);
    let acquisition = Acquisition {
        representable_hu: stored.representable_hu(),
        identifiers: header.free_text(),
        ..Acquisition::default()
    };
    scan_file::scan(path, grid, hu, None, acquisition, warning)
}
