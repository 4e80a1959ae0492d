//! Cameras that are written out in a plan.

use ppa_depth::RigSpec;
use toml::Value;
use toml_edit::{DocumentMut, Item, Table};

use crate::toml_value::{implicit, put};

/// The table of the plan that holds them.
pub(crate) const CAMERAS: &str = "depth.cameras";

/// A rig as the plan holds it.
pub(crate) fn rig_value(rig: &RigSpec) -> Value {
    Value::try_from(rig).expect("names and numbers are TOML")
}

/// The key within the table of cameras; `None` for other keys of a plan.
pub(crate) fn within_cameras(key: &str) -> Option<&str> {
    key.strip_prefix(CAMERAS)?.strip_prefix('.')
}

/// A rig in which a key of the table was left out, as the types read it; `None` where they require the key.
pub(crate) fn rig_without(key: &str) -> Option<Value> {
    let mut rig = rig_value(&RigSpec::default());
    let (tables, last) = key.rsplit_once('.').unwrap_or(("", key));
    let mut tables = tables.split('.').filter(|name| !name.is_empty());
    let table = tables.try_fold(&mut rig, |table, name| table.get_mut(name));
    table?.as_table_mut()?.remove(last);
    let rig: RigSpec = rig.try_into().ok()?;
    Some(rig_value(&rig))
}

/// Whether the table is in the file.
pub(crate) fn has_cameras(document: &DocumentMut) -> bool {
    let depth = document.get("depth").and_then(Item::as_table_like);
    depth.is_some_and(|depth| depth.contains_key("cameras"))
}

/// Puts a rig into the plan in place of the name of its file; `None` where `depth` is no table.
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
            // Figures of a mask are short.
            Value::Table(values) if key != "mask" => Item::Table(table_of(values)),
            value => Item::Value(rows(value).parse().expect("what was just written")),
        };
        table.insert(key, item);
    }
    table
}

/// A value as TOML, with the rows of a matrix below each other.
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
