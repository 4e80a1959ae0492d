//! Checks of a plan before anything is made.

use nalgebra::Isometry3;
use ppa_core::Side;
use ppa_core::text::error_chain;
use ppa_xray::{AnalogSettings, Projection, Spectrum};

use super::Plan;

/// Largest offset of a body shape that is still a limb, mm.
const MOST_OFFSET_MM: f64 = 100.0;

/// Number of bumps of a body shape: without any it would be `orig`; more would cover the skin.
const BUMPS: std::ops::RangeInclusive<usize> = 1..=100;

impl Plan {
    /// Checks whether a dataset can be made from the plan; the error says what is wrong.
    pub(crate) fn check(&self) -> Result<(), String> {
        if self.cases.is_empty() {
            return Err("no [[case]]: a plan needs at least one limb".to_owned());
        }
        self.check_settings()
    }

    /// Checks all but the limbs.
    ///
    /// # Errors
    /// The key at fault, what was found there and what was expected.
    pub fn check_settings(&self) -> Result<(), String> {
        if self.shapes.variants.is_empty() {
            return Err("shapes.variants is empty: at least \"orig\" is needed".to_owned());
        }
        let mut shapes = self.shapes.variants.clone();
        shapes.sort_unstable();
        shapes.dedup();
        if shapes.len() != self.shapes.variants.len() {
            return Err("shapes.variants lists a shape twice".to_owned());
        }
        for (name, value) in [
            ("shapes.offset_mm", self.shapes.offset_mm),
            ("depth.roi_mm", self.depth.roi_mm),
            ("xray.half_length_mm", self.xray.half_length_mm),
            ("xray.max_voxel_mm", self.xray.max_voxel_mm),
        ] {
            if !(value.is_finite() && value > 0.0) {
                return Err(format!("{name} is {value}, expected a length above 0 mm"));
            }
        }
        for (name, share) in [
            ("depth.max_cut_share", self.depth.max_cut_share),
            ("xray.max_cut_share", self.xray.max_cut_share),
        ] {
            if !(0.0..=1.0).contains(&share) {
                return Err(format!("{name} is {share}, expected a share from 0 to 1"));
            }
        }
        if self.depth.rig.is_some() && self.depth.cameras.is_some() {
            return Err("depth.rig and depth.cameras are both given".to_owned());
        }
        if let Some(cameras) = &self.depth.cameras {
            cameras
                .check()
                .map_err(|error| format!("depth.cameras: {}", error_chain(&error)))?;
        }
        let offset_mm = self.shapes.offset_mm;
        if offset_mm > MOST_OFFSET_MM {
            return Err(format!(
                "shapes.offset_mm is {offset_mm}, expected at most {MOST_OFFSET_MM} mm"
            ));
        }
        if let Some(bumps) = self.shapes.bumps.iter().find(|n| !BUMPS.contains(n)) {
            return Err(format!(
                "shapes.bumps holds {bumps}, expected {} to {} bumps",
                BUMPS.start(),
                BUMPS.end()
            ));
        }
        if self.xray.engine.seed != 0 {
            return Err("xray.engine.seed is given, but the plan's seed is used".to_owned());
        }
        if let Some(load) = &self.xray.tube_load {
            load.check()
                .map_err(|error| format!("xray.tube_load: {error}"))?;
            if self.xray.analog.is_some() {
                return Err("xray.tube_load cannot be combined with xray.analog, whose histories are followed one by one".to_owned());
            }
        }
        self.check_room_and_exposure()?;
        if let Some(place) = &self.xray.marker {
            for side in Side::ALL {
                let marker = place.of(side).check(&self.xray.detector);
                marker.map_err(|error| format!("xray.marker: {error} (for {side} limbs)"))?;
            }
        }
        if let Some(analog) = &self.xray.analog {
            if analog.seed != 0 {
                return Err("xray.analog.seed is given, but the plan's seed is used".to_owned());
            }
            let most = AnalogSettings::MOST_HISTORIES;
            if !(1..=most).contains(&analog.histories) {
                return Err(format!(
                    "xray.analog.histories is {}, expected 1 to {most}",
                    analog.histories
                ));
            }
        }
        if self.xray.calibration_file.is_some() {
            return Err(
                "xray.calibration_file is used only when a plan is read from a file".to_owned(),
            );
        }
        if self.room.ply.is_none() && self.room.room_from_device.is_some() {
            return Err(
                "room.room_from_device is given without room.ply: the built-in room defines its own"
                    .to_owned(),
            );
        }
        self.soft_tissue
            .check()
            .map_err(|error| format!("soft_tissue: {error}"))?;
        self.positioning
            .check()
            .map_err(|error| format!("positioning.{error}"))?;
        if let Some(sensor) = &self.depth.sensor {
            sensor
                .check()
                .map_err(|error| format!("depth.sensor: {error}"))?;
        }
        self.rotation
            .poses()
            .map_err(|error| format!("rotation: {error}"))?;
        Ok(())
    }

    /// Checks room, beam and image as far as possible without a limb.
    fn check_room_and_exposure(&self) -> Result<(), String> {
        let (room, xray) = (&self.room.parametric, &self.xray);
        // A recorded room has furniture of its own.
        if self.room.ply.is_none() {
            room.check()
                .map_err(|error| format!("room.parametric: {error}"))?;
        }
        let (detector, distance_mm) = (xray.detector, room.source_detector_mm);
        Projection::new(Isometry3::identity(), distance_mm, detector)
            .with_source(xray.source)
            .with_receptor(xray.receptor.clone())
            .validate()
            .map_err(|error| format!("xray: {error}"))?;
        xray.receptor
            .check(&detector)
            .map_err(|error| format!("xray.receptor: {}", error_chain(&error)))?;
        xray.engine
            .check(&detector)
            .map_err(|error| format!("xray.engine: {}", error_chain(&error)))?;
        let beam = xray.tube().and_then(|tube| Spectrum::tungsten(&tube));
        beam.map_err(|error| format!("xray: {}", error_chain(&error)))?;
        xray.presentation
            .validate()
            .map_err(|error| format!("xray.presentation: {error}"))
    }
}
