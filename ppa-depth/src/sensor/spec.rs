//! Description of the errors of a Time-of-Flight sensor in files.

use serde::{Deserialize, Serialize};

/// Errors of an amplitude-modulated Time-of-Flight camera. Omitted errors are not simulated.
///
/// Signal S is relative to that of the reference target at normal incidence at 1 m: S = cos θ / (r / 1 m)², θ the angle of incidence,
/// r the range along the ray. [`SensorSpec::default`] is not a device: it follows published limits (see there). Only
/// [`fit_noise`](crate::fit_noise) ties it to one.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct SensorSpec {
    /// Error that changes from frame to frame.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub random: Option<RandomError>,
    /// Constant error of the device.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub systematic: Option<SystematicError>,
    /// Pixels at edges that see several surfaces.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub mixed: Option<MixedPixels>,
    /// Pixels that the device marks invalid.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub invalid: Option<Invalidation>,
    /// Light that returns via another surface.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub multipath: Option<Multipath>,
}

/// Normal error of the range with variance floor² + (at_unit_signal / S)².
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct RandomError {
    /// Standard deviation that remains at any signal, mm.
    pub floor_mm: f64,
    /// Standard deviation at S = 1, mm.
    pub at_unit_signal_mm: f64,
}

/// Standard deviations from which a device's constant errors of the range are drawn.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct SystematicError {
    /// Standard deviation of the offset common to all ranges, mm.
    pub offset_mm: f64,
    /// Standard deviation of the error per metre of range, mm.
    pub per_metre_mm: f64,
    /// Standard deviation of the offset of each pixel, mm.
    pub fixed_pattern_mm: f64,
}

/// Sum of the light of all surfaces in a pixel, each with its phase.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct MixedPixels {
    /// Modulation frequency, MHz.
    pub modulation_mhz: f64,
}

/// Limits beyond which a pixel becomes 0.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Invalidation {
    /// Smallest valid signal S.
    pub min_signal: f64,
    /// Largest valid angle of incidence, degrees.
    pub max_angle_deg: f64,
    /// Smallest valid ratio of the length of the sum of phasors to the sum of their lengths, which is 1 for one surface. Needs `mixed`.
    pub min_contrast: f64,
}

/// One bounce between diffuse surfaces that the camera sees.
///
/// Limits: occlusion between two surfaces that face each other is ignored, so light also passes where the limb would block
/// it; surfaces that the camera does not see, such as the underside of the limb, send nothing.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Multipath {
    /// Share of the light that a surface reflects.
    pub albedo: f64,
    /// Modulation frequency, MHz.
    pub modulation_mhz: f64,
}

/// Reason why the errors of a sensor are invalid.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum SensorError {
    /// A number outside its range.
    #[error("sensor parameter {name} is {found}, expected {expected}")]
    Parameter {
        /// The key.
        name: &'static str,
        /// The value.
        found: f64,
        /// Its range.
        expected: &'static str,
    },
}

impl Default for SensorSpec {
    /// Within the limits that the maker states for the Azure Kinect and Tölgyessy et al. confirm (Sensors 2021, 21, 413,
    /// doi:10.3390/s21020413): a standard deviation of at most 17 mm and an error below 11 mm (+ 0.1 % of the range).
    ///
    /// * Random: 17 mm at the far end of the narrow mode, 3.86 m, scaled to 1 m with the signal: 17 / 3.86² = 1.14 mm.
    /// * Systematic: the limits as two standard deviations of offset and slope.
    /// * Signal: that of the reference target at 3.86 m, 1 / 3.86².
    /// * Modulation at 200 MHz (the sensor goes up to 320 MHz: Bamji et al., ISSCC 2018), least contrast 0.9, largest angle
    ///   85°: our choices. An even mix of surfaces 0.11 m apart is then just rejected.
    ///
    /// Multipath is not included.
    fn default() -> Self {
        Self {
            random: Some(RandomError {
                floor_mm: 0.0,
                at_unit_signal_mm: 1.14,
            }),
            systematic: Some(SystematicError {
                offset_mm: 5.5,
                per_metre_mm: 0.5,
                fixed_pattern_mm: 0.0,
            }),
            mixed: Some(MixedPixels {
                modulation_mhz: 200.0,
            }),
            invalid: Some(Invalidation {
                min_signal: 0.067,
                max_angle_deg: 85.0,
                min_contrast: 0.9,
            }),
            multipath: None,
        }
    }
}

impl SensorSpec {
    /// Checks that all numbers are in range.
    ///
    /// # Errors
    /// [`SensorError`] names the first that is not.
    pub fn check(&self) -> Result<(), SensorError> {
        let error = |name, found, expected| {
            Err(SensorError::Parameter {
                name,
                found,
                expected,
            })
        };
        let mut sizes = Vec::new();
        let mut frequencies = Vec::new();
        if let Some(random) = self.random {
            sizes.push(("random.floor_mm", random.floor_mm));
            sizes.push(("random.at_unit_signal_mm", random.at_unit_signal_mm));
        }
        if let Some(systematic) = self.systematic {
            sizes.push(("systematic.offset_mm", systematic.offset_mm));
            sizes.push(("systematic.per_metre_mm", systematic.per_metre_mm));
            sizes.push(("systematic.fixed_pattern_mm", systematic.fixed_pattern_mm));
        }
        if let Some(mixed) = self.mixed {
            frequencies.push(("mixed.modulation_mhz", mixed.modulation_mhz));
        }
        if let Some(multipath) = self.multipath {
            frequencies.push(("multipath.modulation_mhz", multipath.modulation_mhz));
            if !(0.0..=1.0).contains(&multipath.albedo) {
                return error("multipath.albedo", multipath.albedo, "0 to 1");
            }
        }
        if let Some(invalid) = self.invalid {
            sizes.push(("invalid.min_signal", invalid.min_signal));
            if !(0.0..=90.0).contains(&invalid.max_angle_deg) {
                return error(
                    "invalid.max_angle_deg",
                    invalid.max_angle_deg,
                    "0 to 90 degrees",
                );
            }
            if !(0.0..=1.0).contains(&invalid.min_contrast) {
                return error("invalid.min_contrast", invalid.min_contrast, "0 to 1");
            }
        }
        for (name, found) in sizes {
            if !(found.is_finite() && found >= 0.0) {
                return error(name, found, "0 or a positive number");
            }
        }
        for (name, found) in frequencies {
            if !(1.0..=1000.0).contains(&found) {
                return error(name, found, "1 to 1000 MHz");
            }
        }
        Ok(())
    }
}
