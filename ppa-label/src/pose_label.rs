//! The label of one exposure.

use serde::Serialize;

use super::openness::{Exposure, JointSpace, JointSpaceError, LabelScale};

/// A grade as [`compute_labels`](super::compute_labels) gives it to a radiograph, with the openness it follows from.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct PoseLabel {
    /// 1 (ideal) to 3 (inadequate); diagnostic below 2.5.
    pub label: f64,
    /// Half the range of grades under other tolerances and thresholds.
    pub std: f64,
    /// Medial, superior and lateral gutter.
    pub gutters: [GutterLabel; 3],
}

/// Openness and grade of one gutter in an exposure.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct GutterLabel {
    /// `medial`, `superior` or `lateral`.
    pub name: &'static str,
    /// 0 closed to 1 open.
    pub openness: f64,
    /// Grade of this gutter alone.
    pub grade: f64,
}

impl PoseLabel {
    /// Grades an exposure of a joint space.
    ///
    /// # Errors
    /// The same as [`JointSpace::openness`].
    pub fn new(
        space: &JointSpace,
        exposure: Exposure,
        scale: &LabelScale,
    ) -> Result<Self, JointSpaceError> {
        let openness = space.openness(&[exposure])?[0];
        let computed = scale.grade(&openness, &space.hidden(&exposure));
        let [medial, superior, lateral] = computed.gutters;
        let gutter = |name, openness, grade| GutterLabel {
            name,
            openness,
            grade,
        };
        Ok(Self {
            label: computed.label,
            std: computed.std,
            gutters: [
                gutter("medial", openness.medial[1], medial),
                gutter("superior", openness.superior, superior),
                gutter("lateral", openness.lateral[1], lateral),
            ],
        })
    }
}
