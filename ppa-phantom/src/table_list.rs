//! Lists of fixed length in the tables of `data/`.

use serde::de::{Deserialize, Deserializer, Error};

/// Deserialises a list of exactly `N` entries, where serde alone would ignore further ones.
///
/// # Errors
/// States the length found and the one expected.
pub(super) fn exactly<'de, D, T, const N: usize>(list: D) -> Result<[T; N], D::Error>
where
    D: Deserializer<'de>,
    T: Deserialize<'de>,
{
    let list = Vec::<T>::deserialize(list)?;
    let found = list.len();
    let expected = format!("{N} entries");
    list.try_into()
        .map_err(|_| D::Error::invalid_length(found, &expected.as_str()))
}
