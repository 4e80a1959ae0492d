//! Cameras written out in a plan.

use ppa_depth::RigSpec;
use toml::Value;
use toml_edit::{DocumentMut, Item, Table};

use crate::toml_value::{implicit, put};

/// Table of the cameras in a plan.
pub(crate) const CAMERAS: &str = "depth.cameras";

/// Returns a rig as a value of the plan.
pub(crate) fn rig_value(rig: &RigSpec) -> Value {
    Value::try_from(rig).expect("names and numbers are TOML")
}

/// Returns the key within the table of cameras; `None` for other keys of a plan.
pub(crate) fn within_cameras(key: &str) -> Option<&str> {
    key.strip_prefix(CAMERAS)?.strip_prefix('.')
}

/// Returns the default rig as it is read without a key of the table; `None` if the key is required.
pub(crate) fn rig_without(key: &str) -> Option<Value> {
    let mut rig = rig_value(&RigSpec::default());
    let (tables, last) = key.rsplit_once('.').unwrap_or(("", key));
    let mut tables = tables.split('.').filter(|name| !name.is_empty());
    let table = tables.try_fold(&mut rig, |table, name| table.get_mut(name));
    table?.as_table_mut()?.remove(last);
    let rig: RigSpec = rig.try_into().ok()?;
    Some(rig_value(&rig))
}

/// Whether the file has the table of cameras.
pub(crate) fn has_cameras(document: &DocumentMut) -> bool {
    let depth = document.get("depth").and_then(Item::as_table_like);
    depth.is_some_and(|depth| depth.contains_key("cameras"))
}

/// Writes a rig into the plan and removes the name of its file; `None` if `depth` is not a table.
pub(crate) fn write_out(document: &mut DocumentMut, rig: &RigSpec) -> Option<()> {
    put(document.as_table_mut(), "depth.rig", None)?;
    let depth = document.entry("depth").or_insert(Item::Table(implicit()));
    let rig = rig_value(rig);
    let cameras = table_of(rig.as_table()?);
    depth
        .as_table_like_mut()?
        .insert("cameras", Item::Table(cameras));
    Some(())
}

fn table_of(values: &toml::Table) -> Table {
    let mut table = implicit();
    for (key, value) in values {
        let item = match value {
            // The numbers of a mask fit on one line.
            Value::Table(values) if key != "mask" => Item::Table(table_of(values)),
            value => Item::Value(rows(value).parse().expect("what was just written")),
        };
        table.insert(key, item);
    }
    table
}

/// Formats a value as TOML, with one line per row of a matrix.
pub(crate) fn rows(value: &Value) -> String {
    match value.as_array() {
        Some(rows) if rows.iter().all(Value::is_array) && !rows.is_empty() => {
            let rows: Vec<String> = rows.iter().map(Value::to_string).collect();
            format!("[{}]", rows.join(",\n "))
        }
        _ => value.to_string(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn keys_that_the_types_require_cannot_be_left_out() {
        for required in ["left", "left.camera.fx", "right.device_from_camera"] {
            assert_eq!(rig_without(required), None, "{required}");
        }
        let at = |key: &str| {
            let rig = rig_without(key).unwrap();
            let mut names = key.split('.');
            names.try_fold(&rig, |value, name| value.get(name)).cloned()
        };
        assert_eq!(at("left.camera.k1"), Some(Value::Float(0.0)));
        assert_eq!(at("right.camera.metric_radius"), None);
        assert_eq!(at("right.camera.mask"), None);
    }

    #[test]
    fn a_rig_that_is_written_out_is_read_as_the_same() {
        let mut document: DocumentMut = "[depth]\nrig = \"rig.json\"\n".parse().unwrap();
        write_out(&mut document, &RigSpec::default()).unwrap();
        assert!(has_cameras(&document));
        let text = document.to_string();
        assert!(text.contains("\n[depth.cameras.left.camera]\n"), "{text}");
        let table: toml::Table = text.parse().unwrap();
        assert_eq!(table["depth"].get("rig"), None);
        let cameras = table["depth"]["cameras"].clone();
        assert_eq!(cameras.try_into::<RigSpec>().unwrap(), RigSpec::default());
    }
}
