//! Changes of a plan by the sliders of the page.

use ppa_dataset::BodyShape;
use ppa_depth::{RigError, RigSpec};
use ppa_generate::{Plan, SceneSetupError, Technique};
use ppa_xray::{AntiScatterGrid, TubeLoad};
use serde::{Deserialize, Serialize};

use crate::camera_move::CameraMove;
use crate::error::StudioError;

/// A pose and an exposure. The plan gives the values of absent keys.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub(crate) struct WhatIf {
    /// Medial rotation.
    pub angle_deg: f64,
    /// Depth to which the distal contact sinks in.
    pub distal_mm: Option<f64>,
    /// Depth to which the proximal contact sinks in.
    pub proximal_mm: Option<f64>,
    /// Tilt of the limb; positive if the proximal end is raised.
    pub tilt_deg: Option<f64>,
    /// Offset from the joint to the central beam, across the table.
    pub beam_across_mm: Option<f64>,
    /// Offset from the joint to the central beam, towards the head.
    pub beam_along_mm: Option<f64>,
    /// Body shape seen by the depth cameras; that of the scan if absent.
    pub shape: Option<BodyShape>,
    /// Whether the depth images have the errors of an Azure Kinect.
    pub sensor: bool,
    /// Name of an examination with its usual exposure; the keys below override it.
    pub technique: Option<String>,
    pub kvp: Option<f64>,
    /// Filters, `MATERIAL:mm`.
    pub filters: Option<Vec<String>>,
    pub mas: Option<f64>,
    pub exposure_index: Option<f64>,
    /// Whether there is an anti-scatter grid.
    pub grid: Option<bool>,
    /// Moves of the left and the right camera.
    pub cameras: Option<[CameraMove; 2]>,
}

impl WhatIf {
    /// Returns the plan with these changes.
    pub fn plan(&self, plan: &Plan) -> Result<Plan, StudioError> {
        let mut plan = plan.clone();
        let sinks = &mut plan.soft_tissue;
        sinks.distal_mm = self.distal_mm.unwrap_or(sinks.distal_mm);
        sinks.proximal_mm = self.proximal_mm.unwrap_or(sinks.proximal_mm);
        plan.soft_tissue.check()?;
        let positioning = &mut plan.positioning;
        positioning.tilt_deg = self.tilt_deg.unwrap_or(positioning.tilt_deg);
        let [across_mm, along_mm] = positioning.beam_shift_mm;
        positioning.beam_shift_mm = [
            self.beam_across_mm.unwrap_or(across_mm),
            self.beam_along_mm.unwrap_or(along_mm),
        ];
        positioning.check()?;
        if self.sensor && plan.depth.sensor.is_none() {
            plan.depth.sensor = Some(ppa_depth::SensorSpec::default());
        }
        if let Some(moves) = &self.cameras {
            plan.depth.cameras = Some(moved(plan.depth.cameras(), moves)?);
            plan.depth.rig = None;
        }
        if let Some(name) = &self.technique {
            technique(name)?.apply(&mut plan.xray);
        }
        let xray = &mut plan.xray;
        xray.kvp = self.kvp.unwrap_or(xray.kvp);
        if let Some(filters) = &self.filters {
            xray.filters.clone_from(filters);
        }
        let load = self.mas.map(TubeLoad::Mas);
        let load = load.or(self.exposure_index.map(TubeLoad::ExposureIndex));
        xray.tube_load = load.or(xray.tube_load);
        if let Some(load) = xray.tube_load {
            load.check()?;
        }
        match self.grid {
            Some(true) if xray.receptor.grid.is_none() => xray.receptor.grid = Some(usual_grid()),
            Some(false) => xray.receptor.grid = None,
            _ => {}
        }
        // The page shows images during their computation, which the analog engine does not support.
        xray.analog = None;
        plan.check_settings().map_err(StudioError::Invalid)?;
        Ok(plan)
    }
}

impl WhatIf {
    /// Whether there are changes that no command option can make.
    pub fn needs_plan(&self) -> bool {
        self.distal_mm.is_some()
            || self.proximal_mm.is_some()
            || self.tilt_deg.is_some()
            || self.beam_across_mm.is_some()
            || self.beam_along_mm.is_some()
            || self.grid.is_some()
            || self.filters.as_ref().is_some_and(Vec::is_empty)
            || self.cameras.is_some()
    }
}

/// Returns the rig with its left and right camera moved.
fn moved(rig: Result<RigSpec, RigError>, moves: &[CameraMove; 2]) -> Result<RigSpec, StudioError> {
    let mut rig = rig.map_err(SceneSetupError::from)?;
    let cameras = [("left", &mut rig.left), ("right", &mut rig.right)];
    for ((side, camera), moves) in cameras.into_iter().zip(moves) {
        moves.check()?;
        let applied = moves.apply(camera);
        applied.map_err(|source| SceneSetupError::from(RigError::Pose { side, source }))?;
    }
    Ok(rig)
}

/// Returns a common grid of Bucky tables.
fn usual_grid() -> AntiScatterGrid {
    AntiScatterGrid::new(8.0, 40.0).with_focus_mm(1100.0)
}

fn technique(name: &str) -> Result<Technique, StudioError> {
    let found = Technique::ALL.into_iter().find(|(known, _)| *known == name);
    found.map(|(_, technique)| technique).ok_or_else(|| {
        let names = Technique::ALL.map(|(name, _)| name).join(", ");
        StudioError::Invalid(format!("technique {name} is unknown, expected {names}"))
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn keys_that_are_left_out_are_those_of_the_plan() {
        let mut plan = Plan::new(Vec::new());
        plan.xray.kvp = 66.0;
        plan.soft_tissue.distal_mm = 3.0;
        plan.positioning.beam_shift_mm = [5.0, -8.0];
        assert_eq!(WhatIf::default().plan(&plan).unwrap(), plan);
        let what_if = WhatIf {
            kvp: Some(70.0),
            mas: Some(4.0),
            grid: Some(true),
            beam_along_mm: Some(20.0),
            ..WhatIf::default()
        };
        let changed = what_if.plan(&plan).unwrap();
        assert_eq!(changed.xray.kvp, 70.0);
        assert_eq!(changed.xray.tube_load, Some(TubeLoad::Mas(4.0)));
        assert!(changed.xray.receptor.grid.is_some());
        assert_eq!(changed.soft_tissue, plan.soft_tissue);
        assert_eq!(changed.positioning.beam_shift_mm, [5.0, 20.0]);
    }

    #[test]
    fn values_out_of_range_are_refused_by_name() {
        let plan = Plan::new(Vec::new());
        let refused = |what_if: WhatIf| what_if.plan(&plan).unwrap_err().to_string();
        let sunk = WhatIf {
            distal_mm: Some(99.0),
            ..WhatIf::default()
        };
        assert!(refused(sunk).contains("distal_mm"));
        let tilted = WhatIf {
            tilt_deg: Some(-60.0),
            ..WhatIf::default()
        };
        assert_eq!(
            refused(tilted),
            "tilt_deg is -60 degrees, expected -45 to 45"
        );
        let technique = WhatIf {
            technique: Some("chest".to_owned()),
            ..WhatIf::default()
        };
        assert!(refused(technique).contains("expected ankle, knee"));
    }

    #[test]
    fn the_page_offers_every_technique() {
        let names = Technique::ALL.map(|(name, _)| format!("{name:?}"));
        let list = format!("const TECHNIQUES = [{}];", names.join(", "));
        assert!(include_str!("page/whatif.js").contains(&list), "{list}");
    }
}
