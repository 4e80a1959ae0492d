//! Choice of the shafts that give the axis of a knee.

/// The shafts through which the axis of a knee runs.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum KneeAxis {
    /// The tibia's, along the leg's long axis.
    Tibia,
    /// The femur's, which leans from the long axis by about 6 degrees.
    Femur,
    /// Through tibia and femur: too little of either shaft is seen.
    Both,
}

impl KneeAxis {
    /// Derived from the joint region and the far region, mm proximal of the joint level.
    pub(crate) fn of([near, far]: [[f64; 2]; 2]) -> Self {
        match (near[1] <= 0.0, far[1] <= 0.0) {
            (true, true) => Self::Tibia,
            (false, false) => Self::Femur,
            _ => Self::Both,
        }
    }
}
