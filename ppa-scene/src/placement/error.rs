//! Errors of placing a limb on the table.

use nalgebra::Point3;

use crate::room::plane::{first_not_finite, on_one_line};

/// Why a limb cannot be placed.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum PlaceError {
    /// The limb has too few points.
    #[error("the limb has {}, expected at least 3", ppa_core::text::count(*found, "point"))]
    TooFewPoints {
        /// Points given.
        found: usize,
    },
    /// The limb has no width.
    #[error("all {found} points of the limb lie on one line, expected a surface")]
    OneLine {
        /// Points given.
        found: usize,
    },
    /// A coordinate is NaN or infinite.
    #[error("point {index} of the limb is not finite")]
    NotFinite {
        /// Its index.
        index: usize,
    },
    /// The rotation angle is not a number, or more than a full turn; radians.
    #[error("the rotation is {} degrees, expected -360 to 360", .0.to_degrees())]
    Angle(f64),
    /// A depth of soft tissue is out of range.
    #[error("{name} of the soft tissue is {found_mm} mm, expected 0 to 20")]
    SoftTissue {
        /// Field of [`SoftTissue`](crate::SoftTissue).
        name: &'static str,
        /// Its value.
        found_mm: f64,
    },
    /// A tilt or a shift of the beam is out of range.
    #[error("{name} is {found} {unit}, expected -{most} to {most}")]
    Positioning {
        /// Field of [`Positioning`](crate::Positioning).
        name: &'static str,
        /// Its value.
        found: f64,
        /// Largest absolute value.
        most: f64,
        /// Unit of both.
        unit: &'static str,
    },
    /// The anterior direction and the axis do not span a plane.
    #[error("the anterior direction runs along the limb's axis, expected one across it")]
    Axes,
    /// The plane points make no plane under the limb.
    #[error("the plane points do not define a plane under the limb, expected {0}")]
    Plane(&'static str),
    /// The beam runs along the table or away from it.
    #[error("the central beam does not meet the table plane in front of the source")]
    BeamMissesTable,
    /// The limb does not fit between table and source.
    #[error("the joint would lie {height_mm:.1} mm above the table, not below the x-ray source")]
    AboveSource {
        /// Height of the joint.
        height_mm: f64,
    },
    /// No tilt lets both ends rest.
    #[error(
        "tilting the limb by up to 60 degrees does not bring both its ends down to the table: distal \
         end {:.2} mm, proximal end {:.2} mm above the lowest point",
        ppa_core::text::number(*distal_mm), ppa_core::text::number(*proximal_mm)
    )]
    NoRest {
        /// Height of the lowest distal point above the lowest point, untipped.
        distal_mm: f64,
        /// Height of the lowest proximal point above the lowest point, untipped.
        proximal_mm: f64,
    },
}

/// Checks that points can form a limb.
pub(crate) fn check_points(points: &[Point3<f32>]) -> Result<(), PlaceError> {
    if points.len() < 3 {
        return Err(PlaceError::TooFewPoints {
            found: points.len(),
        });
    }
    if let Some(index) = first_not_finite(points) {
        return Err(PlaceError::NotFinite { index });
    }
    if on_one_line(points.iter().map(|p| p.cast())) {
        return Err(PlaceError::OneLine {
            found: points.len(),
        });
    }
    Ok(())
}
