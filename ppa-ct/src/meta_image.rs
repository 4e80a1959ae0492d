//! Reading and writing MetaImage: a text header, then raw or deflated voxels, in the same file (`.mha`) or in one next to it (`.mhd`).
//!
//! Keys are interpreted as in the MetaIO documentation and in ITK, where the format comes from:
//! the world is LPS, `TransformMatrix` lists the directions of the axes i, j, k one after the other,
//! `CenterOfRotation` and `AnatomicalOrientation` are ignored.

mod header;
mod write;

use std::path::Path;

use crate::acquisition::Acquisition;
use crate::error::ReadError;
use crate::scan::{Scan, Warning, WarningCode};
use crate::scan_file::{self, Packing, ScanFile};
use header::{Data, Header};
pub use write::write;

/// Reads `.mha`, or `.mhd` with its data file; modalities other than CT only if `force`d.
pub(crate) fn read(path: &Path, force: bool) -> Result<Scan, ReadError> {
    let mut file = ScanFile::open(path)?;
    let header = Header::read(&mut file)?;
    let modality = header.modality().map_err(|p| file.header(p))?;
    let other = modality.filter(|modality| *modality != "CT");
    if let (Some(modality), false) = (other, force) {
        return Err(ReadError::NotCt {
            modality: modality.to_owned(),
            path: path.to_owned(),
        });
    }
    let size = header.size().map_err(|p| file.header(p))?;
    let stored = header.stored().map_err(|p| file.header(p))?;
    let packed = header.packed().map_err(|p| file.header(p))?;
    let (ct_from_voxel, oriented) = header.ct_from_voxel().map_err(|p| file.header(p))?;
    let grid = file.grid(size, ct_from_voxel)?;
    let header_size = header.header_size().map_err(|p| file.header(p))?;

    let mut data = match header.data().map_err(|p| file.header(p))? {
        Data::Here => file,
        Data::Beside(name) => {
            let mut data = file.open_beside(name)?;
            match header_size {
                Some(count) => data.skip(count)?,
                None if packed => {
                    return Err(data.header(
                        "HeaderSize -1 with compressed voxels; expected uncompressed ones",
                    ));
                }
                None => data.skip_to_last(stored.bytes_of(size).unwrap_or(u64::MAX))?,
            }
            data
        }
    };
    // MetaIO accepts both wrappers of a deflate stream.
    let packing = match packed {
        false => Packing::Raw,
        true if data.next_is(&[0x1f, 0x8b])? => Packing::Gzip,
        true => Packing::Zlib,
    };
    let hu = data.unpacked(packing).voxels(&stored, size)?;
    let warnings = [
        other.map(|modality| Warning {
            code: WarningCode::NotCt,
            text: format!("modality {modality} is read as if it were CT"),
        }),
        (!oriented).then(|| {
            scan_file::no_orientation(
                "the header lacks TransformMatrix or Offset: axes are assumed to run to the left, \
                 posterior and superior from the origin, so left and right may be swapped",
            )
        }),
    ];
    let acquisition = Acquisition {
        representable_hu: stored.representable_hu(),
        identifiers: header.free_text(),
        ..Acquisition::default()
    };
    let modality = modality.map(str::to_owned);
    scan_file::scan(
        path,
        grid,
        hu,
        modality,
        acquisition,
        warnings.into_iter().flatten(),
    )
}
