//! Replacement of values in a TOML file that keeps its comments.

use toml_edit::{Item, Table, TableLike, Value};

/// Sets the value of a dotted key, or removes the key; keeps comments. `None` if a part of the path is not a table.
pub(crate) fn put(table: &mut dyn TableLike, key: &str, value: Option<Value>) -> Option<()> {
    if let Some((first, rest)) = key.split_once('.') {
        if !table.contains_key(first) {
            if value.is_none() {
                return Some(());
            }
            table.insert(first, Item::Table(implicit()));
        }
        return put(table.get_mut(first)?.as_table_like_mut()?, rest, value);
    }
    match (value, table.get_mut(key)) {
        (None, _) => {
            table.remove(key);
        }
        (Some(mut value), Some(Item::Value(old))) => {
            *value.decor_mut() = old.decor().clone();
            *old = value;
        }
        (Some(value), _) => {
            table.insert(key, Item::Value(value));
        }
    }
    Some(())
}

/// Returns a table that has no header line while it holds only other tables.
pub(crate) fn implicit() -> Table {
    let mut table = Table::new();
    table.set_implicit(true);
    table
}
