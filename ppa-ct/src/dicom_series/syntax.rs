//! Names of transfer syntaxes, and which are supported.

use std::path::Path;

use super::codec::Codec;
use super::element::Encoding;
use crate::error::ReadError;

/// Encoding of the elements of a file with this transfer syntax.
///
/// # Errors
/// For unknown encodings: their elements may be written in any way.
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
        _ if name(uid).is_some_and(|name| name.ends_with("retired")) => Err(unsupported(
            path,
            uid,
            "the standard has retired it and no maintained decoder reads it; convert it first",
        )),
        _ => Err(unsupported(path, uid, "ppa has no decoder for it")),
    }
}

/// Error for pixels that cannot be decoded.
pub(super) fn unsupported(
    path: &Path,
    uid: &str,
    source: impl Into<Box<dyn std::error::Error + Send + Sync>>,
) -> ReadError {
    ReadError::TransferSyntax {
        path: path.to_owned(),
        uid: shown(uid).to_owned(),
        name: name(uid).unwrap_or("an encoding unknown to ppa"),
        source: source.into(),
    }
}

/// A UID that messages may repeat: the field may contain any text, and roots other than DICOM's name an institution.
fn shown(uid: &str) -> &str {
    let digits = |c: char| c.is_ascii_digit() || c == '.';
    match uid.starts_with("1.2.840.10008.") && uid.len() <= 64 && uid.chars().all(digits) {
        true => uid,
        false => "not a standard UID",
    }
}

/// Names of the encodings that CT archives use, retired ones included (DICOM PS3.6, table A-1).
fn name(uid: &str) -> Option<&'static str> {
    Some(match uid {
        "1.2.840.10008.1.2" => "implicit VR little endian",
        "1.2.840.10008.1.2.1" => "explicit VR little endian",
        "1.2.840.10008.1.2.1.99" => "deflated explicit VR little endian",
        // Also retired, but supported.
        "1.2.840.10008.1.2.2" => "explicit VR big endian",
        "1.2.840.10008.1.2.4.50" => "JPEG baseline, process 1",
        "1.2.840.10008.1.2.4.51" => "JPEG extended, processes 2 and 4",
        "1.2.840.10008.1.2.4.52" => "JPEG extended, processes 3 and 5, retired",
        "1.2.840.10008.1.2.4.53" => "JPEG spectral selection, processes 6 and 8, retired",
        "1.2.840.10008.1.2.4.54" => "JPEG spectral selection, processes 7 and 9, retired",
        "1.2.840.10008.1.2.4.55" => "JPEG full progression, processes 10 and 12, retired",
        "1.2.840.10008.1.2.4.56" => "JPEG full progression, processes 11 and 13, retired",
        "1.2.840.10008.1.2.4.57" => "JPEG lossless, process 14",
        "1.2.840.10008.1.2.4.58" => "JPEG lossless, process 15, retired",
        "1.2.840.10008.1.2.4.59" => "JPEG extended hierarchical, processes 16 and 18, retired",
        "1.2.840.10008.1.2.4.60" => "JPEG extended hierarchical, processes 17 and 19, retired",
        "1.2.840.10008.1.2.4.61" => {
            "JPEG spectral selection hierarchical, processes 20 and 22, retired"
        }
        "1.2.840.10008.1.2.4.62" => {
            "JPEG spectral selection hierarchical, processes 21 and 23, retired"
        }
        "1.2.840.10008.1.2.4.63" => {
            "JPEG full progression hierarchical, processes 24 and 26, retired"
        }
        "1.2.840.10008.1.2.4.64" => {
            "JPEG full progression hierarchical, processes 25 and 27, retired"
        }
        "1.2.840.10008.1.2.4.65" => "JPEG lossless hierarchical, process 28, retired",
        "1.2.840.10008.1.2.4.66" => "JPEG lossless hierarchical, process 29, retired",
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

#[cfg(test)]
mod tests {
    use super::*;

    fn refusal(uid: &str) -> String {
        codec(Path::new("slice"), uid).unwrap_err().to_string()
    }

    #[test]
    fn retired_encodings_are_refused_by_name() {
        let retired = [52, 53, 54, 55, 56].into_iter().chain(58..=66);
        for n in retired {
            let uid = format!("1.2.840.10008.1.2.4.{n}");
            let text = refusal(&uid);
            assert!(text.contains("JPEG") && text.contains("retired"), "{text}");
            assert!(text.contains(&uid), "{text}");
            assert_eq!(
                encoding(Path::new("slice"), &uid).unwrap(),
                Encoding::ExplicitLittle
            );
        }
    }

    #[test]
    fn what_stands_in_the_place_of_a_uid_is_not_repeated() {
        for text in ["Doe^John", "1.2.840.10008.Doe", "1.3.6.1.4.1.5962.1950"] {
            let error = encoding(Path::new("slice"), text).unwrap_err().to_string();
            assert!(!error.contains(text) && !error.contains("Doe"), "{error}");
        }
        assert!(refusal("1.2.840.10008.1.2.4.999").contains("1.2.840.10008.1.2.4.999"));
    }
}
