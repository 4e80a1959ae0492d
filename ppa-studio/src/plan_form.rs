//! The form of a plan: a field for each setting, with its default, as declared by the types of the plan.

use ppa_depth::RigSpec;
use ppa_generate::Plan;
use serde::Serialize;
use toml::{Table, Value};

use crate::error::StudioError;
use crate::plan_cameras::{CAMERAS, rig_value, rig_without, rows, within_cameras};
use crate::plan_files::{FilesBeside, Offered};
use crate::plan_keys::{PlanKey, plan_keys};

/// Keys of files chosen from those next to the plan, each with the table that the plan may hold instead.
const CHOSEN_FILES: [(&str, &str); 2] = [
    ("depth.rig", CAMERAS),
    ("xray.calibration_file", "xray.calibration"),
];

/// Kind of a field.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub(crate) enum FieldKind {
    /// A table, whose keys follow.
    Heading,
    Number,
    /// Text without quotes.
    Text,
    /// A file below the folder of the plan.
    Path,
    /// One of the files in the folder of the plan.
    File,
    /// One of the listed names.
    Name,
    /// Several of the listed names.
    Names,
    /// A matrix, as TOML with one line per row.
    Rows,
    /// Any other value, as TOML.
    Toml,
}

/// A field of the form.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub(crate) struct Field {
    pub key: String,
    pub kind: FieldKind,
    pub meaning: String,
    /// Names or files to choose from, with their meanings.
    pub names: Vec<(String, String)>,
    /// Value in the file; `None` if the key is absent.
    pub value: Option<String>,
    /// Value that applies if the key is absent.
    pub default: Option<String>,
    /// Example value for a setting that is off by default.
    pub example: Option<&'static str>,
    /// Whether the plan requires the key.
    pub required: bool,
    /// Table that the plan holds instead of this file name.
    pub instead: Option<&'static str>,
    /// Files that are not offered because they cannot be read, with the reason.
    pub unreadable: Vec<(String, String)>,
}

/// Returns the fields of a plan file with this text. `cameras` are those of the plan, if readable; `files` are next to it.
pub(crate) fn fields(
    text: &str,
    cameras: Option<&RigSpec>,
    files: &FilesBeside,
) -> Result<Vec<Field>, StudioError> {
    let table: Table = text.parse().map_err(StudioError::Toml)?;
    let given = Value::Table(table);
    let has_cameras = at(&given, CAMERAS).is_some();
    let defaults = Value::try_from(Plan::new(Vec::new())).expect("defaults are TOML values");
    let types = rig_value(&RigSpec::default());
    let cameras = cameras.map(rig_value);
    let examples: Vec<_> = Plan::optional_settings().collect();
    let mut fields: Vec<Field> = Vec::new();
    for key in plan_keys().filter(is_editable) {
        if let Some(above) = fields.last_mut().filter(|above| is_below(&key, above)) {
            let name = key.key[above.key.len() + 1..].trim_end_matches("[]");
            above.meaning += &format!(" {name}: {}", key.meaning);
            continue;
        }
        let name = key.key.trim_end_matches("[]");
        let camera_key = within_cameras(name);
        let left_out = camera_key.and_then(rig_without);
        let kind = match camera_key {
            Some(camera_key) => kind(&key, at(&types, camera_key)),
            None if name == CAMERAS => FieldKind::Heading,
            None => kind(&key, at(&defaults, name)),
        };
        // If the plan does not write out its cameras, the rig gives the values.
        let default = match camera_key {
            Some(camera_key) if has_cameras => left_out.as_ref().and_then(|l| at(l, camera_key)),
            Some(camera_key) => cameras.as_ref().and_then(|c| at(c, camera_key)),
            None => at(&defaults, name),
        };
        let instead = CHOSEN_FILES.into_iter().find(|(file, _)| *file == name);
        let instead = instead.filter(|(_, table)| at(&given, table).is_some());
        let shown = |value| shown(kind, value);
        let example = examples.iter().find(|(of, _)| of == name);
        fields.push(Field {
            key: name.to_owned(),
            kind,
            meaning: key.meaning.to_owned(),
            names: names(&key, files),
            value: at(&given, name).map(shown),
            default: default.map(shown),
            example: example.map(|(_, value)| *value),
            required: has_cameras && camera_key.is_some() && left_out.is_none(),
            instead: instead.map(|(_, table)| table),
            unreadable: offered(&key, files).map_or(Vec::new(), |files| files.unreadable.clone()),
        });
    }
    Ok(fields)
}

/// Returns the table that a plan may hold instead of a chosen file's name.
pub(crate) fn table_instead_of(key: &str) -> Option<&'static str> {
    let found = CHOSEN_FILES.into_iter().find(|(file, _)| *file == key);
    found.map(|(_, table)| table)
}

/// Returns the kind of a key's field; `None` if the form has no such field.
pub(crate) fn kind_of(key: &str) -> Option<FieldKind> {
    let fields = fields("", None, &FilesBeside::default());
    let fields = fields.expect("an empty text is TOML");
    let field = fields.into_iter().find(|field| field.key == key)?;
    (field.kind != FieldKind::Heading).then_some(field.kind)
}

/// Whether a key has a field. Limbs are listed separately, and tables of materials have their own files.
fn is_editable(key: &PlanKey) -> bool {
    let within = |table: &str| {
        let rest = key.key.strip_prefix(table);
        rest.is_some_and(|rest| rest.is_empty() || rest.starts_with(['.', '[']))
    };
    let elsewhere = ["version", "case", "xray.calibration"];
    !elsewhere.into_iter().any(within)
}

/// Whether a key belongs to a field that holds its entire table.
fn is_below(key: &PlanKey, field: &Field) -> bool {
    let rest = key.key.strip_prefix(&field.key);
    field.kind == FieldKind::Toml && rest.is_some_and(|rest| rest.starts_with(['.', '[']))
}

fn names(key: &PlanKey, files: &FilesBeside) -> Vec<(String, String)> {
    let names = key.names.iter();
    let names = names.map(|(name, meaning)| ((*name).to_owned(), (*meaning).to_owned()));
    offered(key, files).map_or_else(|| names.collect(), |files| files.readable.clone())
}

/// Returns the files to choose from; `None` for a key of another kind.
fn offered<'a>(key: &PlanKey, files: &'a FilesBeside) -> Option<&'a Offered> {
    match key.key {
        "depth.rig" => Some(&files.rigs),
        "xray.calibration_file" => Some(&files.tables),
        _ => None,
    }
}

fn kind(key: &PlanKey, default: Option<&Value>) -> FieldKind {
    let is_name = |value: &Value| {
        let name = value.as_str();
        name.is_some_and(|name| key.names.iter().any(|(known, _)| *known == name))
    };
    match key.kind {
        "table" if default.is_some_and(Value::is_table) => FieldKind::Heading,
        "number" | "integer" => FieldKind::Number,
        "text" => FieldKind::Text,
        "path" if table_instead_of(key.key).is_some() => FieldKind::File,
        "path" => FieldKind::Path,
        "4 rows of 4 numbers" => FieldKind::Rows,
        "one of the names" if default.is_some_and(is_name) => FieldKind::Name,
        "list of one of the names" => FieldKind::Names,
        _ => FieldKind::Toml,
    }
}

fn at<'a>(value: &'a Value, key: &str) -> Option<&'a Value> {
    key.split('.')
        .try_fold(value, |value, name| value.get(name))
}

fn shown(kind: FieldKind, value: &Value) -> String {
    match (kind, value) {
        (FieldKind::Heading, _) => String::new(),
        (
            FieldKind::Text | FieldKind::Path | FieldKind::File | FieldKind::Name,
            Value::String(text),
        ) => text.clone(),
        (FieldKind::Rows, value) => rows(value),
        (FieldKind::Names, Value::Array(names)) => {
            let names: Vec<&str> = names.iter().filter_map(Value::as_str).collect();
            names.join(" ")
        }
        (_, value) => value.to_string(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn fields_have_defaults_of_the_types_and_values_of_the_file() {
        let text = "version = 1\n[rotation]\nstep_deg = 5\n[xray]\ntube_load = { mas = 4 }\n";
        let fields = fields(text, None, &FilesBeside::default()).unwrap();
        let field = |key: &str| fields.iter().find(|field| field.key == key).unwrap();
        let step = field("rotation.step_deg");
        assert_eq!(
            (step.kind, step.value.as_deref()),
            (FieldKind::Number, Some("5"))
        );
        assert_eq!(step.default.as_deref(), Some("0.5"));
        assert_eq!(field("rotation.to_deg").value, None);
        assert_eq!(field("depth.cut_faces").kind, FieldKind::Name);
        let shapes = field("shapes.variants");
        assert_eq!(
            shapes.default.as_deref(),
            Some("orig big small bumps_a bumps_b")
        );
        assert_eq!(
            field("xray.tube_load").value.as_deref(),
            Some("{ mas = 4 }")
        );
        let grid = field("xray.receptor.grid");
        assert_eq!((grid.kind, &grid.default), (FieldKind::Toml, &None));
        assert!(
            grid.meaning.contains("lines_per_cm: Strips"),
            "{}",
            grid.meaning
        );
        assert!(
            grid.example
                .is_some_and(|example| example.contains("ratio = 8"))
        );
        for absent in ["case.file", "xray.calibration", "xray.receptor.grid.ratio"] {
            assert!(fields.iter().all(|field| field.key != absent));
        }
    }

    #[test]
    fn fields_of_cameras_have_the_rig_that_holds_or_is_written() {
        let mut rig = RigSpec::default();
        rig.left.camera.fx = 612.5;
        let files = FilesBeside::default();
        let held = fields("", Some(&rig), &files).unwrap();
        let field = |fields: &[Field], key: &str| {
            let field = fields.iter().find(|field| field.key == key);
            field.unwrap_or_else(|| panic!("no {key}")).clone()
        };
        let focal = field(&held, "depth.cameras.left.camera.fx");
        assert_eq!(
            (focal.kind, focal.default.as_deref(), focal.required),
            (FieldKind::Number, Some("612.5"), false)
        );
        let model = field(&held, "depth.cameras.right.camera.model");
        assert_eq!((model.kind, model.names.len()), (FieldKind::Name, 3));
        let pose = field(&held, "depth.cameras.left.device_from_camera");
        assert_eq!(pose.kind, FieldKind::Rows);
        assert_eq!(pose.default.unwrap().lines().count(), 4);
        assert_eq!(field(&held, "depth.cameras.left").kind, FieldKind::Heading);

        let text = "[depth.cameras.left.camera]\nfx = 600\nk1 = 0.2\n";
        let written = fields(text, Some(&rig), &files).unwrap();
        let focal = field(&written, "depth.cameras.left.camera.fx");
        assert_eq!(
            (focal.value.as_deref(), focal.default, focal.required),
            (Some("600"), None, true)
        );
        let k1 = field(&written, "depth.cameras.left.camera.k1");
        assert_eq!((k1.default.as_deref(), k1.required), (Some("0.0"), false));
        assert_eq!(field(&written, "depth.rig").instead, Some(CAMERAS));
        assert_eq!(field(&held, "depth.rig").instead, None);
    }
}
