//! Agreement of the stated side with the anatomy.

use ppa_dataset::findings::{Finding, FindingCode, Severity};
use ppa_scene::{Fibula, Landmarks};

use super::at;

pub(super) fn finding(landmarks: &Landmarks, fibula: Option<&Fibula>) -> Option<Finding> {
    let fibula = fibula?;
    let shown = fibula.side()?;
    if shown == landmarks.side {
        return None;
    }
    Some(at(
        fibula.centre_mm,
        FindingCode::SideMismatch,
        Severity::Severe,
        fibula.sine,
        format!(
            "tibia and fibula lie as in a {} leg, but the case is of the {} side: medial rotation would rotate this leg laterally \
             (sine of the angle from the tibia to the fibula {:.2}, negative in a right leg)",
            shown, landmarks.side, fibula.sine,
        ),
    ))
}
