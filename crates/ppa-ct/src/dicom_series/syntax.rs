//! Transfer syntaxes: their names, and which of them ppa reads.

use std::path::Path;

use super::codec::Codec;
use super::element::Encoding;
use crate::error::ReadError;

/// How the elements of a file with this transfer syntax are written.
///
/// # Errors
/// For encodings that are not known: their elements may be written in any way.
pub(super) fn encoding(path: &Path, uid: &str) -> Result<Encoding, ReadError> {
    match uid {
        "1.2.840.10008.1.2" => Ok(Encoding::ImplicitLittle),
        "1.2.840.10008.1.2.2" => Ok(Encoding::ExplicitBig),
        // All others are explicit and little-endian (PS3.5, annex A).
        _ if name(uid).is_some() => Ok(Encoding::ExplicitLittle),
        _ => Err(unsupported(path, uid, "ppa does not know this encoding")),
    }
}

/// The decoder for compressed pixels.
pub(super) fn codec(path: &Path, uid: &str) -> Result<Codec, ReadError> {
    match uid.strip_prefix("1.2.840.10008.1.2.") {
        Some("5") => Ok(Codec::Rle),
        Some("4.50" | "4.51" | "4.57" | "4.70") => Ok(Codec::Jpeg),
        Some("4.80" | "4.81") => Ok(Codec::JpegLs),
        Some("4.90" | "4.91") => Ok(Codec::Jpeg2000),
        Some("4.53" | "4.55") => Err(unsupported(
            path,
            uid,
            "the standard has retired it and no maintained decoder reads it; convert it first",
        )),
        _ => Err(unsupported(path, uid, "ppa has no decoder for it")),
    }
}

/// Error for pixels that cannot be unpacked.
pub(super) fn unsupported(
    path: &Path,
    uid: &str,
    source: impl Into<Box<dyn std::error::Error + Send + Sync>>,
) -> ReadError {
    ReadError::TransferSyntax {
        path: path.to_owned(),
        uid: uid.to_owned(),
        name: name(uid).unwrap_or("an encoding unknown to ppa"),
        source: source.into(),
    }
}

/// Names of the encodings that CT archives use, retired ones included (DICOM PS3.6, table A-1).
fn name(uid: &str) -> Option<&'static str> {
    Some(match uid {
        "1.2.840.10008.1.2" => "implicit VR little endian",
        "1.2.840.10008.1.2.1" => "explicit VR little endian",
        "1.2.840.10008.1.2.1.99" => "deflated explicit VR little endian",
        "1.2.840.10008.1.2.2" => "explicit VR big endian",
        "1.2.840.10008.1.2.4.50" => "JPEG baseline, process 1",
        "1.2.840.10008.1.2.4.51" => "JPEG extended, processes 2 and 4",
        "1.2.840.10008.1.2.4.53" => "JPEG spectral selection, processes 6 and 8, retired",
        "1.2.840.10008.1.2.4.55" => "JPEG full progression, processes 10 and 12, retired",
        "1.2.840.10008.1.2.4.57" => "JPEG lossless, process 14",
        "1.2.840.10008.1.2.4.70" => "JPEG lossless, process 14, first-order prediction",
        "1.2.840.10008.1.2.4.80" => "JPEG-LS lossless",
        "1.2.840.10008.1.2.4.81" => "JPEG-LS near-lossless",
        "1.2.840.10008.1.2.4.90" => "JPEG 2000 lossless",
        "1.2.840.10008.1.2.4.91" => "JPEG 2000",
        "1.2.840.10008.1.2.4.110" => "JPEG XL lossless",
        "1.2.840.10008.1.2.4.111" => "JPEG XL JPEG recompression",
        "1.2.840.10008.1.2.4.112" => "JPEG XL",
        "1.2.840.10008.1.2.4.201" => "high-throughput JPEG 2000 lossless",
        "1.2.840.10008.1.2.4.202" => "high-throughput JPEG 2000 lossless, RPCL",
        "1.2.840.10008.1.2.4.203" => "high-throughput JPEG 2000",
        "1.2.840.10008.1.2.5" => "RLE lossless",
        _ => return None,
    })
}
