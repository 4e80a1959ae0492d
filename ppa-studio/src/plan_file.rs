//! The file of the plan: the original, and the changes saved next to it.

use std::path::{Component, Path, PathBuf};

use ppa_dataset::files::{FileError, read_text, write_whole};
use ppa_generate::{Plan, PlanCase, SceneSetupError};
use toml_edit::{DocumentMut, Item, Value};

use crate::error::StudioError;
use crate::plan_cameras::{has_cameras, within_cameras, write_out};
use crate::plan_form::{FieldKind, kind_of, table_instead_of};
use crate::plan_limbs::LimbChange;
use crate::toml_value::put;

/// A plan file, the file for its changes, which are saved as they are made, and the undo history.
pub(crate) struct PlanFile {
    original: PathBuf,
    edited: PathBuf,
    /// Text of the edited file as last read or saved by this program; `None` if there is none.
    known: Option<String>,
    /// Earlier texts, for undo; `later` has those for redo.
    earlier: Vec<String>,
    later: Vec<String>,
}

impl PlanFile {
    /// Returns the files of a plan. Changes of `plan.toml` go to `plan.edited.toml`.
    pub fn new(original: PathBuf) -> Self {
        let edited = original.with_extension("edited.toml");
        let known = std::fs::read_to_string(&edited).ok();
        Self {
            original,
            edited,
            known,
            earlier: Vec::new(),
            later: Vec::new(),
        }
    }

    pub fn original(&self) -> &Path {
        &self.original
    }

    /// Returns the file that holds the displayed plan.
    pub fn current(&self) -> &Path {
        if self.has_edits() {
            &self.edited
        } else {
            &self.original
        }
    }

    /// Whether changes are saved next to the original.
    pub fn has_edits(&self) -> bool {
        self.known.is_some()
    }

    /// Returns the folder of the plan and its datasets.
    pub fn folder(&self) -> &Path {
        let parent = self.original.parent();
        parent
            .filter(|folder| !folder.as_os_str().is_empty())
            .unwrap_or(Path::new("."))
    }

    /// Returns the text of the plan; if there is no file, that of a default plan for a case.
    pub fn text(
        &self,
        case: impl FnOnce() -> Result<PathBuf, StudioError>,
    ) -> Result<String, StudioError> {
        if let Some(text) = &self.known {
            return Ok(text.clone());
        }
        if self.original.exists() {
            return Ok(read_text(&self.original)?);
        }
        let plan = Plan::new(vec![PlanCase {
            file: case()?,
            patient: 0,
        }]);
        Ok(plan.commented_text(&self.original)?)
    }

    /// Returns the text with a key set to a value or removed, and the plan that it holds.
    ///
    /// The file name of a rig or of a table of materials replaces the one written in the plan. A value of a camera
    /// writes out the rig in use, unless the plan already has it.
    pub fn changed(
        &self,
        text: &str,
        key: &str,
        value: Option<&str>,
    ) -> Result<(String, Plan), StudioError> {
        let kind = kind_of(key);
        let kind = kind.ok_or_else(|| StudioError::Invalid(format!("the form has no {key}")))?;
        let mut document: DocumentMut = text.parse()?;
        let value = match value {
            Some(value) => Some(self.value(kind, key, value)?),
            None => None,
        };
        let no_table = || StudioError::Invalid(format!("{key} is not in a table of the file"));
        if let Some(table) = table_instead_of(key) {
            put(document.as_table_mut(), table, None).ok_or_else(no_table)?;
        }
        if within_cameras(key).is_some() && !has_cameras(&document) {
            if value.is_none() {
                return self.read(&document);
            }
            let rig = self.plan(text)?.depth.cameras();
            let rig = rig.map_err(SceneSetupError::from)?;
            write_out(&mut document, &rig).ok_or_else(no_table)?;
        }
        put(document.as_table_mut(), key, value).ok_or_else(no_table)?;
        self.read(&document)
    }

    /// Returns the text with changed limbs, and the plan that it holds.
    pub fn with_limbs(
        &self,
        text: &str,
        change: &LimbChange,
    ) -> Result<(String, Plan), StudioError> {
        let mut document: DocumentMut = text.parse()?;
        let limbs = document.get_mut("case");
        let limbs = limbs.and_then(Item::as_array_of_tables_mut);
        let limbs = limbs.ok_or_else(|| {
            let message = "the limbs of this plan are not [[case]] tables: edit them in the file";
            StudioError::Invalid(message.to_owned())
        })?;
        change.apply(limbs, &self.plan(text)?, self.folder())?;
        self.read(&document)
    }

    fn read(&self, document: &DocumentMut) -> Result<(String, Plan), StudioError> {
        let text = document.to_string();
        let plan = self.plan(&text)?;
        Ok((text, plan))
    }

    /// Parses the plan from a text of the file.
    pub fn plan(&self, text: &str) -> Result<Plan, StudioError> {
        Ok(Plan::of_text(text, self.current())?)
    }

    /// Saves a changed text next to the original, and keeps the text `before` for undo.
    ///
    /// # Errors
    /// [`StudioError::ChangedElsewhere`] if the file has changed since it was last saved.
    pub fn change(&mut self, before: String, text: String) -> Result<(), StudioError> {
        self.save_edits(text)?;
        self.earlier.push(before);
        self.later.clear();
        Ok(())
    }

    /// Saves the text before the last change; `None` if there is no change to undo. `now` is kept for redo.
    ///
    /// # Errors
    /// The same as [`Self::change`].
    pub fn undo(&mut self, now: String) -> Result<Option<String>, StudioError> {
        let Some(text) = self.earlier.last().cloned() else {
            return Ok(None);
        };
        self.save_edits(text)?;
        self.later.push(now);
        Ok(self.earlier.pop())
    }

    /// Saves the text that was last undone; `None` if there is none. `now` is kept for undo.
    ///
    /// # Errors
    /// The same as [`Self::change`].
    pub fn redo(&mut self, now: String) -> Result<Option<String>, StudioError> {
        let Some(text) = self.later.last().cloned() else {
            return Ok(None);
        };
        self.save_edits(text)?;
        self.earlier.push(now);
        Ok(self.later.pop())
    }

    /// Whether undo and redo are possible, in this order.
    pub fn can_step(&self) -> [bool; 2] {
        [!self.earlier.is_empty(), !self.later.is_empty()]
    }

    fn save_edits(&mut self, text: String) -> Result<(), StudioError> {
        if std::fs::read_to_string(&self.edited).ok() != self.known {
            return Err(StudioError::ChangedElsewhere(self.edited.clone()));
        }
        write_whole(&self.edited, text.as_bytes())?;
        self.known = Some(text);
        Ok(())
    }

    /// Overwrites the original with a text, at the user's request, and removes the changes next to it.
    pub fn save(&mut self, text: &str) -> Result<(), StudioError> {
        write_whole(&self.original, text.as_bytes())?;
        if self.has_edits() && std::fs::read_to_string(&self.edited).ok() == self.known {
            // The original holds all changes now; a file that cannot be removed is shown as changes again.
            let _ = std::fs::remove_file(&self.edited);
        }
        self.known = None;
        Ok(())
    }

    /// Converts the typed content of a field to a TOML value.
    fn value(&self, kind: FieldKind, key: &str, typed: &str) -> Result<Value, StudioError> {
        match kind {
            FieldKind::Text | FieldKind::Name => Ok(typed.into()),
            FieldKind::Path | FieldKind::File => {
                self.is_below_folder(Path::new(typed))?;
                Ok(typed.into())
            }
            FieldKind::Names => Ok(typed.split_whitespace().collect()),
            FieldKind::Heading | FieldKind::Number | FieldKind::Rows | FieldKind::Toml => {
                let value = typed.trim().parse();
                value.map_err(|_| {
                    StudioError::Invalid(format!("{key} is {typed}, which is not a TOML value"))
                })
            }
        }
    }

    /// Refuses files that are not below the folder of the plan.
    fn is_below_folder(&self, path: &Path) -> Result<(), StudioError> {
        let folder = self.folder();
        let downwards = path
            .components()
            .all(|part| matches!(part, Component::Normal(_)));
        let target = folder.join(path);
        let real = |path: &Path| {
            let real = path.canonicalize();
            real.map_err(FileError::at("find", path))
        };
        // Links may lead out of the folder.
        if downwards && real(&target)?.starts_with(real(folder)?) {
            return Ok(());
        }
        Err(StudioError::Invalid(format!(
            "{} is not below the folder of the plan; edit the plan file to use other files",
            path.display()
        )))
    }
}

#[cfg(test)]
mod tests {
    use ppa_depth::RigSpec;
    use ppa_xray::HuCalibration;

    use super::*;

    const TEXT: &str = "\
# A plan.
version = 1
seed = 1    # of the house

[[case]]
file = \"leg.case.toml\"
patient = 0

[rotation]
step_deg = 5.0    # coarse
to_deg = 20.0
";

    fn file(folder: &Path) -> PlanFile {
        PlanFile::new(folder.join("plan.toml"))
    }

    fn changed(key: &str, value: Option<&str>) -> Result<(String, Plan), StudioError> {
        let folder = tempfile::tempdir().unwrap();
        file(folder.path()).changed(TEXT, key, value)
    }

    #[test]
    fn a_changed_key_keeps_comments_and_other_keys() {
        let (text, plan) = changed("rotation.step_deg", Some("2.5")).unwrap();
        assert_eq!(text, TEXT.replace("5.0 ", "2.5 "));
        assert_eq!(plan.rotation.step_deg, 2.5);
        let (text, plan) = changed(
            "xray.receptor.grid",
            Some("{ ratio = 8, lines_per_cm = 40 }"),
        )
        .unwrap();
        assert!(plan.xray.receptor.grid.is_some());
        assert!(text.starts_with(TEXT), "{text}");
        assert!(
            text.ends_with("\n[xray.receptor]\ngrid = { ratio = 8, lines_per_cm = 40 }\n"),
            "{text}"
        );
        let (text, plan) = changed("rotation.to_deg", None).unwrap();
        assert_eq!(
            (text, plan.rotation.to_deg),
            (TEXT.replace("to_deg = 20.0\n", ""), 90.0)
        );
        let (_, plan) = changed("shapes.variants", Some("orig big")).unwrap();
        assert_eq!(plan.shapes.variants.len(), 2);
    }

    #[test]
    fn a_value_of_a_camera_writes_out_the_rig_in_use() {
        let folder = tempfile::tempdir().unwrap();
        let mut rig = RigSpec::default();
        rig.right.camera.cx = 300.25;
        let text = serde_json::to_string(&rig).unwrap();
        std::fs::write(folder.path().join("rig.json"), text).unwrap();
        let file = file(folder.path());
        let set = |text: &str, key: &str, value| file.changed(text, key, value).unwrap();
        let (with_file, _) = set(TEXT, "depth.rig", Some("rig.json"));
        let key = "depth.cameras.left.camera.fx";
        let (written, plan) = set(&with_file, key, Some("480.0"));
        rig.left.camera.fx = 480.0;
        assert_eq!(plan.depth.cameras, Some(rig.clone()));
        assert_eq!(plan.depth.rig, None);
        assert!(written.starts_with(TEXT), "{written}");
        // A second value is added to the first; a file name, or none, replaces both.
        let (written, plan) = set(&written, "depth.cameras.left.camera.k2", None);
        rig.left.camera.k2 = 0.0;
        assert_eq!(plan.depth.cameras, Some(rig));
        let refused = file.changed(&written, key, None).unwrap_err();
        let refused = ppa_core::text::error_chain(&refused);
        assert!(refused.contains("missing field `fx`"), "{refused}");
        for (value, name) in [(Some("rig.json"), Some("rig.json")), (None, None)] {
            let (text, plan) = set(&written, "depth.rig", value);
            assert_eq!(plan.depth.cameras, None);
            assert_eq!(plan.depth.rig, name.map(|name| folder.path().join(name)));
            assert!(!text.contains("cameras"), "{text}");
        }
        // Removing an absent key writes nothing.
        assert_eq!(set(TEXT, "depth.cameras.left.camera.k2", None).0, TEXT);
    }

    #[test]
    fn a_table_of_materials_takes_the_place_of_one_that_is_written() {
        let folder = tempfile::tempdir().unwrap();
        let air = "[[SEGMENT]]\nname = \"all\"\nmaterial = \"water\"\ndensity = [[0, 1.0]]\n";
        let table = air.replace("SEGMENT", "segment");
        std::fs::write(folder.path().join("water.toml"), &table).unwrap();
        let written = air.replace("SEGMENT", "xray.calibration.segment");
        let written = format!("{TEXT}{written}");
        let file = file(folder.path());
        let set = |value| file.changed(&written, "xray.calibration_file", value);
        let (text, plan) = set(Some("water.toml")).unwrap();
        let expected = HuCalibration::parse(&table).unwrap();
        assert_eq!(plan.xray.calibration, expected);
        let line = "\n[xray]\ncalibration_file = \"water.toml\"\n";
        assert_eq!(text, format!("{TEXT}{line}"));
        let (text, plan) = set(None).unwrap();
        assert_eq!(text, TEXT);
        assert_eq!(plan.xray.calibration, HuCalibration::default());
    }

    #[test]
    fn values_that_the_plan_refuses_are_named() {
        let refused = |key: &str, value: &str| {
            let error = changed(key, Some(value)).unwrap_err();
            ppa_core::text::error_chain(&error)
        };
        assert!(refused("rotation.step_deg", "0.3").contains("step_deg"));
        assert!(refused("depth.roi_mm", "-3").contains("depth.roi_mm is -3"));
        assert!(refused("depth.roi_mm", "wide").contains("not a TOML value"));
        assert!(refused("shapes.variants", "").contains("shapes.variants is empty"));
        assert!(refused("case.file", "x").contains("the form has no case.file"));
    }

    #[test]
    fn files_outside_the_folder_of_the_plan_are_refused() {
        let folder = tempfile::tempdir().unwrap();
        let outside = tempfile::NamedTempFile::new().unwrap();
        let inside = folder.path().join("rig.json");
        std::fs::write(&inside, "{}").unwrap();
        let file = file(folder.path());
        let set = |path: &str| file.changed(TEXT, "depth.rig", Some(path));
        assert!(set("rig.json").is_ok());
        for path in [
            outside.path().to_str().unwrap(),
            "../rig.json",
            "/etc/passwd",
            ".",
        ] {
            assert!(set(path).is_err(), "{path}");
        }
        #[cfg(unix)]
        {
            std::os::unix::fs::symlink(outside.path(), folder.path().join("link.json")).unwrap();
            assert!(
                set("link.json")
                    .unwrap_err()
                    .to_string()
                    .contains("not below")
            );
        }
    }
}
