//! Transfer syntaxes: their names, and the error that gives them.

use std::path::Path;

use crate::error::ReadError;

/// Error for pixels that cannot be unpacked.
pub(super) fn unsupported(
    path: &Path,
    uid: &str,
    source: impl Into<Box<dyn std::error::Error + Send + Sync>>,
) -> ReadError {
    let uid = uid.trim_end_matches(['\0', ' ']);
    ReadError::TransferSyntax {
        path: path.to_owned(),
        uid: uid.to_owned(),
        name: name(uid),
        source: source.into(),
    }
}

/// Names of the encodings that CT archives use, retired ones included (DICOM PS3.6, table A-1).
fn name(uid: &str) -> &'static str {
    match uid {
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
        _ => "an encoding unknown to ppa",
    }
}
