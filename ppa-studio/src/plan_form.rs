//! The form of a plan: a field for each setting, with its default, as the types of the plan declare them.

use ppa_generate::Plan;
use serde::Serialize;
use toml::{Table, Value};

use crate::error::StudioError;
use crate::plan_keys::{PlanKey, plan_keys};

/// What a field holds.
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
    /// One of the names.
    Name,
    /// Several of the names.
    Names,
    /// Any other value, as TOML.
    Toml,
}

/// A field of the form.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub(crate) struct Field {
    pub key: String,
    pub kind: FieldKind,
    pub meaning: String,
    pub names: Vec<(&'static str, &'static str)>,
    /// What the file holds; `None` where the key is left out.
    pub value: Option<String>,
    /// What holds where the key is left out.
    pub default: Option<String>,
    /// A value of a setting that is off by default.
    pub example: Option<&'static str>,
}

/// The fields of a plan file with this text.
pub(crate) fn fields(text: &str) -> Result<Vec<Field>, StudioError> {
    let table: Table = text.parse().map_err(StudioError::Toml)?;
    let given = Value::Table(table);
    let defaults = Value::try_from(Plan::new(Vec::new())).expect("defaults are TOML values");
    let examples: Vec<_> = Plan::optional_settings().collect();
    let mut fields: Vec<Field> = Vec::new();
    for key in plan_keys().filter(is_editable) {
        if let Some(above) = fields.last_mut().filter(|above| is_below(&key, above)) {
            let name = key.key[above.key.len() + 1..].trim_end_matches("[]");
            above.meaning += &format!(" {name}: {}", key.meaning);
            continue;
        }
        let name = key.key.trim_end_matches("[]");
        let default = at(&defaults, name);
        let kind = kind(&key, default);
        let shown = |value| shown(kind, value);
        let example = examples.iter().find(|(of, _)| of == name);
        fields.push(Field {
            key: name.to_owned(),
            kind,
            meaning: key.meaning.to_owned(),
            names: key.names,
            value: at(&given, name).map(shown),
            default: default.map(shown),
            example: example.map(|(_, value)| *value),
        });
    }
    Ok(fields)
}

/// The kind of the field of a key; `None` where the form has none.
pub(crate) fn kind_of(key: &str) -> Option<FieldKind> {
    let fields = fields("").expect("an empty text is TOML");
    let field = fields.into_iter().find(|field| field.key == key)?;
    (field.kind != FieldKind::Heading).then_some(field.kind)
}

/// The form has no fields for limbs, which are listed apart, cameras and tables of materials, which have files of their own.
fn is_editable(key: &PlanKey) -> bool {
    let within = |table: &str| {
        let rest = key.key.strip_prefix(table);
        rest.is_some_and(|rest| rest.is_empty() || rest.starts_with(['.', '[']))
    };
    let elsewhere = ["version", "case", "depth.cameras", "xray.calibration"];
    !elsewhere.into_iter().any(within)
}

/// Whether a key belongs to a field that holds its whole table.
fn is_below(key: &PlanKey, field: &Field) -> bool {
    let rest = key.key.strip_prefix(&field.key);
    field.kind == FieldKind::Toml && rest.is_some_and(|rest| rest.starts_with(['.', '[']))
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
        "path" => FieldKind::Path,
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
        (FieldKind::Text | FieldKind::Path | FieldKind::Name, Value::String(text)) => text.clone(),
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
        let fields = fields(text).unwrap();
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
}
