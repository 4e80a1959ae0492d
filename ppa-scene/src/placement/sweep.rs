//! The range of rotation angles of a dataset.

use serde::{Deserialize, Serialize};

/// Medial rotations from `from_deg` to `to_deg`, both included.
///
/// The default is the paper's: 0 to 90 degrees in steps of half a degree.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Sweep {
    /// First angle, degrees.
    pub from_deg: f64,
    /// Last angle, degrees.
    pub to_deg: f64,
    /// Step between angles, degrees.
    pub step_deg: f64,
}

impl Default for Sweep {
    fn default() -> Self {
        Self {
            from_deg: 0.0,
            to_deg: 90.0,
            step_deg: 0.5,
        }
    }
}

/// One pose of a sweep.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct PoseAngle {
    /// Number of half degrees: the number in the published file names.
    pub step: u32,
    /// Medial rotation, degrees: `step / 2`.
    pub angle_deg: f64,
}

impl PoseAngle {
    /// The angle in radians.
    pub fn angle_rad(&self) -> f64 {
        self.angle_deg.to_radians()
    }
}

/// Why a range of rotations cannot be used.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum SweepError {
    /// Published file names count half degrees from 0.
    #[error("{name} is {found} degrees, expected a multiple of 0.5 between 0 and 180")]
    NotHalfDegrees {
        /// Field of [`Sweep`].
        name: &'static str,
        /// Its value.
        found: f64,
    },
    /// The step is 0.
    #[error("step_deg is 0, expected at least 0.5 degrees")]
    NoStep,
    /// The range runs backwards.
    #[error("the range runs from {from_deg} to {to_deg} degrees, expected from <= to")]
    Backwards {
        /// First angle.
        from_deg: f64,
        /// Last angle.
        to_deg: f64,
    },
}

impl Sweep {
    /// The poses in rising order; the last one is `to_deg` or the last step before it.
    ///
    /// # Errors
    /// [`SweepError`] when an angle is not a whole number of half degrees in 0..=180, the step
    /// is 0, or the range is empty.
    pub fn poses(&self) -> Result<Vec<PoseAngle>, SweepError> {
        let from = half_degrees("from_deg", self.from_deg)?;
        let to = half_degrees("to_deg", self.to_deg)?;
        let step = half_degrees("step_deg", self.step_deg)?;
        if step == 0 {
            return Err(SweepError::NoStep);
        }
        if to < from {
            return Err(SweepError::Backwards {
                from_deg: self.from_deg,
                to_deg: self.to_deg,
            });
        }
        Ok((from..=to)
            .step_by(step as usize)
            .map(|step| PoseAngle {
                step,
                angle_deg: f64::from(step) / 2.0,
            })
            .collect())
    }
}

fn half_degrees(name: &'static str, degrees: f64) -> Result<u32, SweepError> {
    let halves = degrees * 2.0;
    if (0.0..=360.0).contains(&halves) && halves.fract() == 0.0 {
        Ok(halves as u32)
    } else {
        Err(SweepError::NotHalfDegrees {
            name,
            found: degrees,
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_paper_has_181_poses() {
        let poses = Sweep::default().poses().unwrap();
        assert_eq!(poses.len(), 181);
        assert_eq!(
            poses[1],
            PoseAngle {
                step: 1,
                angle_deg: 0.5
            }
        );
        assert_eq!(
            poses[180],
            PoseAngle {
                step: 180,
                angle_deg: 90.0
            }
        );
    }

    #[test]
    fn bad_ranges_are_refused() {
        let sweep = |from_deg, to_deg, step_deg| {
            Sweep {
                from_deg,
                to_deg,
                step_deg,
            }
            .poses()
        };
        assert!(matches!(sweep(0.0, 10.0, 0.0), Err(SweepError::NoStep)));
        assert!(matches!(
            sweep(9.0, 3.0, 1.0),
            Err(SweepError::Backwards { .. })
        ));
        for bad in [0.25, -1.0, f64::NAN, 1e9] {
            assert!(matches!(
                sweep(bad, 90.0, 1.0),
                Err(SweepError::NotHalfDegrees { .. })
            ));
        }
        assert_eq!(sweep(0.0, 10.0, 4.5).unwrap().len(), 3);
    }
}
