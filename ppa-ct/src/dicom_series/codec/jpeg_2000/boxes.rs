//! The codestream inside a JP2 file, which some writers embed in place of a bare codestream (ISO/IEC 15444-1, annex I).

use super::super::CodecError;

/// Start of the signature box (section I.5.1).
const SIGNATURE: [u8; 12] = *b"\0\0\0\x0cjP  \x0d\x0a\x87\x0a";

/// Returns a bare codestream unchanged, or that of a JP2 file; palettes are refused, since their samples are not values.
pub(super) fn codestream(packed: &[u8]) -> Result<&[u8], CodecError> {
    if !packed.starts_with(&SIGNATURE) {
        return Ok(packed);
    }
    let damaged = || CodecError::Damaged("its JP2 file has no codestream".to_owned());
    let mut found = None;
    let mut rest = packed;
    while found.is_none() && !rest.is_empty() {
        let (kind, body) = next(&mut rest).ok_or_else(damaged)?;
        match &kind {
            b"jp2h" => expect_no_palette(body).ok_or_else(damaged)??,
            b"jp2c" => found = Some(body),
            _ => {}
        }
    }
    found.ok_or_else(damaged)
}

fn expect_no_palette(mut header: &[u8]) -> Option<Result<(), CodecError>> {
    while !header.is_empty() {
        if &next(&mut header)?.0 == b"pclr" {
            return Some(Err(CodecError::Unexpected {
                found: "a palette".to_owned(),
                expected: "grey samples".to_owned(),
            }));
        }
    }
    Some(Ok(()))
}

/// Reads kind and body of the next box (section I.4).
fn next<'a>(rest: &mut &'a [u8]) -> Option<([u8; 4], &'a [u8])> {
    let (length, tail) = rest.split_first_chunk::<4>()?;
    let (kind, tail) = tail.split_first_chunk::<4>()?;
    let (body, tail) = match u32::from_be_bytes(*length) {
        // The box extends to the end.
        0 => (tail, &[][..]),
        1 => {
            let (length, tail) = tail.split_first_chunk::<8>()?;
            let length = u64::from_be_bytes(*length).checked_sub(16)?;
            tail.split_at_checked(usize::try_from(length).ok()?)?
        }
        length => tail.split_at_checked(length.checked_sub(8)? as usize)?,
    };
    *rest = tail;
    Some((*kind, body))
}
