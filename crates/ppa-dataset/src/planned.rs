//! `dataset.json` read back: what a dataset is to hold.

use std::path::Path;

use ppa_scene::Sweep;
use ppa_xray::Part;
use serde::Deserialize;

use crate::description::DESCRIPTION_FILE;
use crate::files::{FileError, read_text};
use crate::job::{LimbUnits, PlannedLimb, units_of_part};

/// Which units a dataset is made of, and what they follow from.
pub(crate) struct Planned {
    /// `dataset.json` as it stands.
    pub text: String,
    units: PlannedUnits,
}

#[derive(Deserialize)]
struct PlannedUnits {
    rotation: Sweep,
    limbs: Vec<PlannedLimb>,
}

impl Planned {
    pub fn read(root: &Path) -> Result<Self, FileError> {
        let path = root.join(DESCRIPTION_FILE);
        let text = read_text(&path)?;
        let units: PlannedUnits =
            serde_json::from_str(&text).map_err(|e| FileError::at("parse", &path)(e.into()))?;
        units
            .rotation
            .poses()
            .map_err(|e| FileError::at("use", &path)(std::io::Error::other(e)))?;
        Ok(Self { text, units })
    }

    /// The units of one part, limb by limb.
    pub fn part(&self, part: Part) -> Vec<LimbUnits> {
        let poses = self.units.rotation.poses();
        let poses = poses.expect("the rotation was checked when it was read");
        units_of_part(self.units.limbs.iter().cloned(), &poses, part)
    }
}

/// Where two descriptions differ first, as a path of keys; `None` if they are the same.
pub(crate) fn difference(first: &str, second: &str) -> Option<String> {
    let parse = |text| serde_json::from_str(text).unwrap_or(serde_json::Value::Null);
    (first != second).then(|| differing_key(&parse(first), &parse(second)).unwrap_or_default())
}

fn differing_key(first: &serde_json::Value, second: &serde_json::Value) -> Option<String> {
    let (Some(first), Some(second)) = (first.as_object(), second.as_object()) else {
        return None;
    };
    let keys = first.keys().chain(second.keys());
    let differs = |key: &&String| first.get(*key) != second.get(*key);
    // Keys and the code version change with everything else, so they are named last.
    let (last, mut others): (Vec<_>, Vec<_>) = keys
        .filter(differs)
        .partition(|key| ["limbs", "code"].contains(&key.as_str()));
    others.extend(last);
    let key = others.first()?;
    let below = match (first.get(*key), second.get(*key)) {
        (Some(first), Some(second)) => differing_key(first, second),
        _ => None,
    };
    Some(match below {
        Some(below) => format!("{key}.{below}"),
        None => (*key).clone(),
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_setting_that_differs_is_named() {
        let of = |kvp: f64, code: u32| {
            format!(r#"{{"limbs":[{kvp}],"settings":{{"code":{code},"xray":{{"kvp":{kvp}}}}}}}"#)
        };
        assert_eq!(difference(&of(60.0, 1), &of(60.0, 1)), None);
        let named = |a: &str, b: &str| difference(a, b).unwrap();
        assert_eq!(named(&of(60.0, 1), &of(70.0, 2)), "settings.xray.kvp");
        assert_eq!(named(&of(60.0, 1), &of(60.0, 2)), "settings.code");
    }
}
