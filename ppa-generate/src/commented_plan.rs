//! A plan with every key and its meaning, as a template.

use std::path::Path;

use ppa_dataset::files::write_whole;

use crate::case::{Case, CaseError};
use crate::plan::{Plan, PlanCase, PlanError};
use crate::plan_comments::{CALIBRATION, HEADER, KEYS, OFF, OFF_TABLES, TABLES};
use crate::toml_file::{relative_to, to_toml};

impl Plan {
    /// Creates a plan with default settings for case files. Cases of one scan are limbs of one patient; patients are numbered from 0.
    ///
    /// # Errors
    /// [`CaseError`] for a case that cannot be read.
    pub fn of_cases<'a>(files: impl IntoIterator<Item = &'a Path>) -> Result<Self, CaseError> {
        let mut scans: Vec<String> = Vec::new();
        let mut cases = Vec::new();
        for file in files {
            let scan = Case::read(file)?.source.volume_sha256;
            let known = scans.iter().position(|known| *known == scan);
            let patient = known.unwrap_or_else(|| {
                scans.push(scan);
                scans.len() - 1
            });
            cases.push(PlanCase {
                file: file.to_owned(),
                patient: patient as u32,
            });
        }
        Ok(Self::new(cases))
    }

    /// Writes the plan with a comment on every key and with optional settings commented out, whole or not at all. Relative paths are
    /// rewritten to start at the plan file's folder.
    ///
    /// # Errors
    /// [`PlanError::File`], also for a path that is not UTF-8, which TOML cannot hold.
    pub fn write_commented(&self, path: &Path) -> Result<(), PlanError> {
        Ok(write_whole(path, self.commented_text(path)?.as_bytes())?)
    }

    /// The text that [`Plan::write_commented`] writes to the file `path`.
    ///
    /// # Errors
    /// [`PlanError::File`] for a path that is not UTF-8, which TOML cannot hold.
    pub fn commented_text(&self, path: &Path) -> Result<String, PlanError> {
        let mut plan = self.clone();
        let folder = path.parent().unwrap_or(Path::new(""));
        for file in plan.files_mut() {
            *file = relative_to(file, folder)?;
        }
        Ok(commented(&to_toml(&plan, path)?))
    }

    /// Settings that are off by default: key and an example value in TOML.
    pub fn optional_settings() -> impl Iterator<Item = (String, &'static str)> {
        let below = |table: &str, line: &'static str| {
            let (key, value) = line.strip_prefix('#')?.split_once(" = ")?;
            let dot = if table.is_empty() { "" } else { "." };
            let value = value.split("    # ").next().unwrap_or(value);
            Some((format!("{table}{dot}{key}"), value))
        };
        let off = OFF
            .iter()
            .flat_map(move |(table, lines)| lines.iter().map(move |line| (*table, *line)));
        let mut table = "";
        let tables = OFF_TABLES.lines().map(move |line| {
            if let Some(name) = line.strip_prefix("#[") {
                table = name.trim_end_matches(']');
            }
            (table, line)
        });
        off.chain(tables)
            .filter_map(move |(table, line)| below(table, line))
    }
}

/// A plan as TOML with comments.
fn commented(toml: &str) -> String {
    let given: toml::Table = toml.parse().expect("what was just written");
    let mut text = HEADER.to_owned();
    let mut table = String::new();
    let mut is_calibration = false;
    for line in toml.lines() {
        if line.starts_with('[') {
            text.truncate(text.trim_end().len());
            text.push('\n');
            off(&mut text, &table, &given);
            text.push('\n');
            let began = is_calibration;
            table = line.trim_matches(['[', ']']).to_owned();
            is_calibration = table.starts_with("xray.calibration");
            if is_calibration && !began {
                text.push_str(CALIBRATION);
            }
            let meaning = TABLES.iter().find(|(name, _)| *name == line);
            if let Some((_, meaning)) = meaning.filter(|(_, meaning)| !meaning.is_empty()) {
                text.push_str(&format!("# {meaning}\n"));
            }
        }
        let key = line.split(" = ").next().unwrap_or_default();
        let means = KEYS
            .iter()
            .find(|(of, name, _)| *of == table && *name == key);
        let comment = means.map_or(String::new(), |(.., meaning)| format!("    # {meaning}"));
        let switched_off = if is_calibration && !line.is_empty() {
            "#"
        } else {
            ""
        };
        text.push_str(&format!("{switched_off}{line}{comment}\n"));
    }
    text.truncate(text.trim_end().len());
    text.push('\n');
    off(&mut text, &table, &given);
    text + OFF_TABLES
}

/// Adds the settings of a table that are off; `given` holds those that are on.
fn off(text: &mut String, table: &str, given: &toml::Table) {
    let mut keys = Some(given);
    for name in table.split('.').filter(|name| !name.is_empty()) {
        keys = keys.and_then(|keys| keys.get(name)?.as_table());
    }
    let is_given = |line: &str| {
        let key = line.trim_start_matches('#').split(" = ").next();
        keys.is_some_and(|keys| key.is_some_and(|key| keys.contains_key(key)))
    };
    let lines = OFF.iter().filter(|(of, _)| *of == table);
    for line in lines
        .flat_map(|(_, lines)| *lines)
        .filter(|line| !is_given(line))
    {
        text.push_str(line);
        text.push('\n');
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::technique::Technique;

    fn plan() -> Plan {
        Plan::new(vec![PlanCase {
            file: "leg.case.toml".into(),
            patient: 0,
        }])
    }

    fn text() -> String {
        commented(&to_toml(&plan(), Path::new("plan.toml")).unwrap())
    }

    /// The settings that are off, switched on.
    fn switched_on(text: &str) -> String {
        let on = |line: &str| match line.strip_prefix('#') {
            Some(setting) if !setting.starts_with(' ') => format!("{setting}\n"),
            _ => format!("{line}\n"),
        };
        text.lines().map(on).collect()
    }

    #[test]
    fn a_commented_plan_reads_as_the_defaults() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("plan.toml");
        let expected = Plan::new(vec![PlanCase {
            file: folder.path().join("leg.case.toml"),
            patient: 0,
        }]);
        expected.write_commented(&path).unwrap();
        assert_eq!(Plan::read(&path).unwrap(), expected);
    }

    #[test]
    fn settings_that_are_off_are_valid_once_switched_on() {
        let text = switched_on(&text());
        let read: Plan = toml::from_str(&text).unwrap_or_else(|e| panic!("{e}\n{text}"));
        assert!(read.room_file.is_some() && read.room.table.is_some());
        assert!(read.depth.sensor.is_some() && read.xray.receptor.grid.is_some());
        assert_eq!(read.xray.calibration, plan().xray.calibration);
    }

    #[test]
    fn each_optional_setting_is_named_with_a_value() {
        let settings: Vec<_> = Plan::optional_settings().collect();
        let value = |key: &str| settings.iter().find(|(k, _)| k == key).map(|(_, v)| *v);
        assert_eq!(value("room_file"), Some("\"room.toml\""));
        let grid = "{ ratio = 8, lines_per_cm = 40, focus_mm = 1100 }";
        assert_eq!(value("xray.receptor.grid"), Some(grid));
        assert_eq!(
            value("depth.sensor.mixed"),
            Some("{ modulation_mhz = 200 }")
        );
        assert_eq!(value("room.table.iterations"), Some("1000"));
        for (key, value) in settings {
            assert!(
                format!("x = {value}").parse::<toml::Table>().is_ok(),
                "{key}"
            );
        }
    }

    /// Otherwise a setting that is switched on would be defined twice.
    #[test]
    fn settings_of_a_technique_are_not_among_those_off() {
        for (_, technique) in Technique::ALL {
            let mut plan = plan();
            technique.apply(&mut plan.xray);
            let text = commented(&to_toml(&plan, Path::new("plan.toml")).unwrap());
            let read: Plan = toml::from_str(&text).unwrap_or_else(|e| panic!("{e}\n{text}"));
            assert_eq!(read.xray, plan.xray);
            for key in [
                "#tube_load",
                "#marker",
                "#heel_effect",
                "#blades_mm",
                "#blur",
            ] {
                assert!(!text.contains(key), "{key}\n{text}");
            }
            assert!(text.contains("#grid"));
        }
    }

    /// Serde lists the expected keys when it meets an unknown one.
    #[test]
    fn every_key_of_a_plan_stands_in_it() {
        let text = switched_on(&text());
        let mut tables: Vec<&str> = text
            .lines()
            .filter(|line| line.starts_with('[') && !line.starts_with("[["))
            .map(|line| line.trim_matches(['[', ']']))
            .filter(|table| !table.starts_with("xray.calibration"))
            .collect();
        assert!(tables.len() >= 13, "{tables:?}");
        tables.push("");
        // Written out in a room file.
        let elsewhere = ["depth.cameras"];
        for table in tables {
            let header = format!("[{table}]\n");
            let odd = if table.is_empty() {
                format!("no_such_key = 1\n{text}")
            } else {
                text.replacen(&header, &format!("{header}no_such_key = 1\n"), 1)
            };
            let error = toml::from_str::<Plan>(&odd).unwrap_err().to_string();
            let (_, expected) = error
                .split_once("expected")
                .unwrap_or_else(|| panic!("{error}"));
            let keys: Vec<&str> = expected.split('`').skip(1).step_by(2).collect();
            assert!(!keys.is_empty(), "{error}");
            for key in keys {
                let path = if table.is_empty() {
                    key.to_owned()
                } else {
                    format!("{table}.{key}")
                };
                let begin = if table.is_empty() {
                    0
                } else {
                    text.find(&header).unwrap() + header.len()
                };
                let end = text[begin..]
                    .find("\n[")
                    .map_or(text.len(), |at| begin + at);
                let here = text[begin..end]
                    .lines()
                    .any(|line| line.starts_with(&format!("{key} = ")));
                let as_table =
                    text.contains(&format!("[{path}]")) || text.contains(&format!("[{path}."));
                assert!(
                    here || as_table || elsewhere.contains(&&*path),
                    "{path} is missing"
                );
            }
        }
    }
}
