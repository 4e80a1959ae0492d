//! New values in a TOML file, keeping its comments and order.

use toml_edit::{DocumentMut, Item, TableLike, TomlError};

/// Returns `text` with the keys and values of `keys`; keys that stay keep their comments.
pub(crate) fn with_keys(text: &str, keys: &str) -> Result<String, TomlError> {
    let mut edited: DocumentMut = text.parse()?;
    let keys: DocumentMut = keys.parse()?;
    put(edited.as_table_mut(), keys.as_table());
    Ok(edited.to_string())
}

fn put(table: &mut dyn TableLike, keys: &dyn TableLike) {
    let gone: Vec<String> = table
        .iter()
        .filter(|(key, _)| !keys.contains_key(key))
        .map(|(key, _)| key.to_owned())
        .collect();
    for key in gone {
        table.remove(&key);
    }
    for (key, new) in keys.iter() {
        match table.get_mut(key) {
            None => {
                table.insert(key, new.clone());
            }
            Some(old) => replace(old, new),
        }
    }
}

fn replace(old: &mut Item, new: &Item) {
    if let (Item::Table(old), Item::Table(new)) = (&mut *old, new) {
        return put(old, new);
    }
    if old.to_string().trim() == new.to_string().trim() {
        return;
    }
    let mut value = new.clone();
    if let (Some(value), Some(old)) = (value.as_value_mut(), old.as_value()) {
        *value.decor_mut() = old.decor().clone();
    }
    *old = value;
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn comments_and_order_stay_where_values_change() {
        let text = "\
# A leg.
side = \"r\" # seen

[b] # second
x = 1 # one
y = 2
# of a
[a]
z = [1, 2]
";
        let keys = "side = \"l\"\n[a]\nz = [1, 3]\nw = 4\n[b]\nx = 1\n";
        let edited = with_keys(text, keys).unwrap();
        assert_eq!(
            edited,
            "\
# A leg.
side = \"l\" # seen

[b] # second
x = 1 # one
# of a
[a]
z = [1, 3]
w = 4
"
        );
    }
}
