//! JSON objects with a hash of their own text, so that later changes are detected.

use sha2::{Digest, Sha256};

use ppa_dataset::files::hex;

/// Separates an object from its seal. No JSON string holds a line break, so it occurs nowhere else.
const MARK: &str = ",\n\"seal\": \"";

/// Adds a last key `seal` to a JSON object: the SHA-256 of the text before it.
///
/// # Panics
/// When `object` is not the text of a JSON object with at least one key.
pub(crate) fn sealed(object: &str) -> String {
    let head = object.trim_end().strip_suffix('}');
    let head = head.expect("a JSON object ends with a brace").trim_end();
    assert!(head != "{", "an object without keys cannot be sealed");
    format!("{head}{MARK}{}\"}}", hash(head))
}

/// Result of checking the seal of a text.
#[derive(Debug, PartialEq, Eq)]
pub(crate) enum Opened {
    /// The object without its seal, which is valid.
    Sealed(String),
    /// A text without a seal.
    Unsealed,
    /// A seal that does not match the text.
    Broken,
}

/// Compares a text with the seal it carries.
pub(crate) fn opened(text: &str) -> Opened {
    let Some((head, rest)) = text.rsplit_once(MARK) else {
        return Opened::Unsealed;
    };
    match rest.strip_suffix("\"}") {
        Some(seal) if seal == hash(head) => Opened::Sealed(format!("{head}}}")),
        _ => Opened::Broken,
    }
}

fn hash(text: &str) -> String {
    hex(&Sha256::digest(text.as_bytes()))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_object_opens_as_it_was_sealed() {
        for object in ["{\"a\":{}}", "{\n  \"a\": [1],\n  \"b\": \"seal\"\n}"] {
            let text = sealed(object);
            let value = |text: &str| serde_json::from_str::<serde_json::Value>(text).unwrap();
            let Opened::Sealed(opened) = opened(&text) else {
                panic!("{text}");
            };
            assert_eq!(value(&opened), value(object));
            assert_eq!(value(&text)["seal"].as_str().unwrap().len(), 64);
        }
        assert_eq!(opened("{\"a\":1}"), Opened::Unsealed);
    }

    /// With any bit flipped the text is no longer the sealed object: its seal is broken, or it is no JSON, or it has an
    /// unknown key.
    #[test]
    fn no_flipped_bit_leaves_a_sealed_object() {
        let text = sealed("{\"a\":[1,2],\"b\":\"x\"}");
        for bit in 0..8 * text.len() {
            let mut bytes = text.clone().into_bytes();
            bytes[bit / 8] ^= 1 << (bit % 8);
            let Ok(flipped) = String::from_utf8(bytes) else {
                continue;
            };
            match opened(&flipped) {
                Opened::Sealed(_) => panic!("{flipped}"),
                Opened::Broken => {}
                Opened::Unsealed => {
                    let value: Result<serde_json::Value, _> = serde_json::from_str(&flipped);
                    let known = |key: &String| ["a", "b"].contains(&key.as_str());
                    let unknown = |value: serde_json::Value| {
                        value
                            .as_object()
                            .is_none_or(|object| !object.keys().all(known))
                    };
                    assert!(value.is_err() || value.is_ok_and(unknown), "{flipped}");
                }
            }
        }
    }
}
