//! Keys in which two descriptions of a dataset differ.

use std::fmt;

use serde_json::Value;

/// A key of `dataset.json` with two values.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct KeyDifference {
    /// Path of the key, such as `settings.xray.kvp` or `limbs.patient_0_r.choices`.
    pub key: String,
    /// Its value in the dataset as JSON; `None` if the key is missing.
    pub there: Option<String>,
    /// Its value in the run, likewise.
    pub here: Option<String>,
}

impl fmt::Display for KeyDifference {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let value = |value: &Option<String>| value.as_deref().map_or("absent".to_owned(), short);
        let (there, here) = (value(&self.there), value(&self.here));
        write!(
            f,
            "{} is {there} in the dataset and {here} in this run",
            self.key
        )
    }
}

/// A value, which may be a table, shortened to fit into a sentence.
fn short(text: &str) -> String {
    const MOST: usize = 60;
    if text.chars().count() <= MOST {
        return text.to_owned();
    }
    text.chars().take(MOST).chain("...".chars()).collect()
}

/// Returns the keys in which two texts of `dataset.json` differ, settings before values that follow from them.
pub(crate) fn differences(there: &str, here: &str) -> Vec<KeyDifference> {
    let parse = |text| serde_json::from_str(text).unwrap_or(Value::Null);
    let mut found = Vec::new();
    descend(
        String::new(),
        Some(&parse(there)),
        Some(&parse(here)),
        &mut found,
    );
    // Hashes add nothing to the keys that they are made of.
    let is_hash = |key: &str| key == "seal" || (key.starts_with("limbs.") && key.ends_with(".key"));
    found.retain(|difference: &KeyDifference| !is_hash(&difference.key));
    found.sort_by_key(|difference| rank(&difference.key));
    found
}

/// Settings of the plan come first, then its limbs, values that follow from both, and the program.
fn rank(key: &str) -> u8 {
    match key {
        "settings.code" | "settings.generator" | "version" | "units" => 3,
        _ if key.starts_with("settings.") || key.starts_with("rotation") => 0,
        _ if key.starts_with("limbs") => 1,
        _ => 2,
    }
}

fn descend(
    key: String,
    there: Option<&Value>,
    here: Option<&Value>,
    found: &mut Vec<KeyDifference>,
) {
    if there == here {
        return;
    }
    let (Some(first), Some(second)) = (there.and_then(entries), here.and_then(entries)) else {
        let text = |value: Option<&Value>| value.map(Value::to_string);
        found.push(KeyDifference {
            key,
            there: text(there),
            here: text(here),
        });
        return;
    };
    let below = |name: &str| match key.as_str() {
        "" => name.to_owned(),
        key => format!("{key}.{name}"),
    };
    let value_in = |entries: &[(String, &Value)], name: &str| {
        let entry = entries.iter().position(|(other, _)| other == name);
        entry.map(|i| entries[i].1.clone())
    };
    let new = second
        .iter()
        .filter(|(name, _)| value_in(&first, name).is_none());
    for (name, _) in first.iter().chain(new) {
        let (there, here) = (value_in(&first, name), value_in(&second, name));
        descend(below(name), there.as_ref(), here.as_ref(), found);
    }
}

/// The entries of an object, or of the list of limbs by their names; `None` for values without names.
fn entries(value: &Value) -> Option<Vec<(String, &Value)>> {
    match value {
        Value::Object(map) => Some(
            map.iter()
                .map(|(name, value)| (name.clone(), value))
                .collect(),
        ),
        Value::Array(list) if !list.is_empty() => {
            let name = |limb: &Value| {
                let (patient, side) = (limb.get("patient")?, limb.get("side")?.as_str()?);
                Some(format!("patient_{patient}_{side}"))
            };
            list.iter().map(|limb| Some((name(limb)?, limb))).collect()
        }
        _ => None,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn description(kvp: f64, code: u32, patients: &[u32]) -> String {
        let limb =
            |patient: &u32| format!(r#"{{"patient":{patient},"side":"r","key":"{kvp}{code}"}}"#);
        let limbs: Vec<_> = patients.iter().map(limb).collect();
        let limbs = limbs.join(",");
        format!(r#"{{"limbs":[{limbs}],"settings":{{"code":{code},"xray":{{"kvp":{kvp}}}}}}}"#)
    }

    #[test]
    fn the_settings_that_differ_are_named_with_both_values() {
        let one = description(60.0, 1, &[0]);
        assert_eq!(differences(&one, &one), []);
        let between = |a: &str, b: &str| {
            let found = differences(a, b);
            found.iter().map(ToString::to_string).collect::<Vec<_>>()
        };
        let kvp = "settings.xray.kvp is 60 in the dataset and 70 in this run";
        let code = "settings.code is 1 in the dataset and 2 in this run";
        assert_eq!(between(&one, &description(70.0, 2, &[0])), [kvp, code]);
        assert_eq!(between(&one, &description(60.0, 2, &[0])), [code]);
        let grown = between(&one, &description(60.0, 1, &[0, 4]));
        assert_eq!(grown.len(), 1, "{grown:?}");
        assert!(
            grown[0].starts_with("limbs.patient_4_r is absent in the dataset and {"),
            "{grown:?}"
        );
    }
}
