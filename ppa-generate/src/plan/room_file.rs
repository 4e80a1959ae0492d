//! `room.toml`: a room with its x-ray device, detector and cameras, for any number of plans.

use std::path::Path;

use ppa_dataset::files::{read_text, write_whole};
use ppa_depth::RigSpec;
use ppa_xray::Detector;
use serde::{Deserialize, Serialize};

use super::{Plan, PlanError, PlanRoom};
use crate::toml_file::{relative_to, to_toml};

/// The fixed objects of an x-ray room; unknown keys are refused.
///
/// Relative paths are resolved against the folder of the file.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct RoomFile {
    /// Format of this file; 1.
    pub version: u32,
    /// The room, the pose of its x-ray device, its source-detector distance and its table.
    #[serde(default)]
    pub room: PlanRoom,
    /// Pixels of the detector; the plan's when absent.
    pub detector: Option<Detector>,
    /// The camera pair; the built-in one when absent.
    pub cameras: Option<RigSpec>,
}

impl RoomFile {
    /// Reads a room file and makes its paths relative to the current folder.
    ///
    /// # Errors
    /// [`PlanError`] naming the file and the line, key or camera at fault.
    pub fn read(path: &Path) -> Result<Self, PlanError> {
        let text = read_text(path)?;
        let invalid = |message| PlanError::Invalid {
            path: path.to_owned(),
            message,
        };
        let mut file: Self = toml::from_str(&text).map_err(|error| {
            let before = error.span().map_or("", |span| &text[..span.start]);
            let line = before.matches('\n').count() + 1;
            invalid(format!("line {line} of the room file: {}", error.message()))
        })?;
        if file.version != 1 {
            return Err(invalid(format!(
                "room file version {}, expected 1",
                file.version
            )));
        }
        if let Some(cameras) = &file.cameras {
            cameras.check().map_err(|error| {
                let cause = std::error::Error::source(&error).map(ToString::to_string);
                invalid(format!("{error}: {}", cause.unwrap_or_default()))
            })?;
        }
        if let Some(ply) = &mut file.room.ply {
            *ply = path.parent().unwrap_or(Path::new("")).join(&*ply);
        }
        Ok(file)
    }

    /// The room of a plan.
    ///
    /// # Errors
    /// [`PlanError`] when its camera rig is a file that cannot be read.
    pub fn of_plan(plan: &Plan) -> Result<Self, PlanError> {
        Ok(Self {
            version: 1,
            room: plan.room.clone(),
            detector: Some(plan.xray.detector),
            cameras: Some(plan.depth.cameras()?),
        })
    }

    /// Writes the file, whole or not at all. A relative path is rewritten to start at its folder.
    ///
    /// # Errors
    /// [`PlanError::File`], also for a path that is not UTF-8, which TOML cannot hold.
    pub fn write(&self, path: &Path) -> Result<(), PlanError> {
        let mut file = self.clone();
        if let Some(ply) = &mut file.room.ply {
            *ply = relative_to(ply, path.parent().unwrap_or(Path::new("")))?;
        }
        Ok(write_whole(path, to_toml(&file, path)?.as_bytes())?)
    }

    /// Puts this room into a plan that does not define one.
    ///
    /// # Errors
    /// Names the key that the plan also gives.
    pub(crate) fn put_into(self, plan: &mut Plan) -> Result<(), String> {
        let fresh = Plan::new(Vec::new());
        let twice = [
            ("room", plan.room != fresh.room),
            (
                "depth.rig or depth.cameras",
                self.cameras.is_some()
                    && (plan.depth.rig.is_some() || plan.depth.cameras.is_some()),
            ),
            (
                "xray.detector",
                self.detector.is_some() && plan.xray.detector != fresh.xray.detector,
            ),
        ];
        if let Some((name, _)) = twice.into_iter().find(|(_, given)| *given) {
            return Err(format!("room_file and {name} are both given"));
        }
        plan.room = self.room;
        plan.depth.cameras = self.cameras.or(plan.depth.cameras.take());
        if let Some(detector) = self.detector {
            plan.xray.detector = detector;
        }
        Ok(())
    }
}

impl Plan {
    /// Creates a plan without limbs in the room of a file.
    ///
    /// # Errors
    /// The same as [`RoomFile::read`].
    pub fn in_room(path: &Path) -> Result<Self, PlanError> {
        let mut plan = Self::new(Vec::new());
        let file = RoomFile::read(path)?;
        file.put_into(&mut plan)
            .map_err(|message| PlanError::Invalid {
                path: path.to_owned(),
                message,
            })?;
        Ok(plan)
    }
}
