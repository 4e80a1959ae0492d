//! The straight line along the shaft of the largest bone.

use nalgebra::{Point3, Vector3};

use super::sections::LimbSections;
use crate::landmarks::found::Landmarks;

/// The shaft of the largest bone between the regions that give the axis.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Shaft {
    /// Unit direction towards proximal, `ct` frame.
    pub direction: [f64; 3],
    /// Middle of the shaft, `ct` frame, mm.
    pub centre_mm: [f64; 3],
    /// First and last distance proximal of the joint, mm.
    pub range_mm: [f64; 2],
    /// Angle between the axis of rotation and the shaft, degrees.
    pub off_axis_deg: f64,
}

impl Shaft {
    /// The median of the slopes between any two sections at least a third of the shaft apart
    /// (Theil 1950, Sen 1968, doi:10.1080/01621459.1968.10480934) is not misled by single sections in
    /// which two bones are one.
    pub(super) fn of(sections: &LimbSections, landmarks: &Landmarks) -> Option<Self> {
        let shaft = sections.through_shaft();
        let centres: Vec<(f64, Point3<f64>)> = shaft
            .iter()
            .filter_map(|section| Some((section.above_mm, section.bones.first()?.centre)))
            .collect();
        let (first, last) = (centres.first()?, centres.last()?);
        let far_mm = (last.0 - first.0) / 3.0;
        let mut slopes: [Vec<f64>; 3] = Default::default();
        for (i, upper) in centres.iter().enumerate() {
            for lower in &centres[..i] {
                let rise_mm = upper.0 - lower.0;
                if rise_mm >= far_mm {
                    let slope = (upper.1 - lower.1) / rise_mm;
                    (0..3).for_each(|axis| slopes[axis].push(slope[axis]));
                }
            }
        }
        let median = slopes.map(|mut slopes| {
            let middle = slopes.len() / 2;
            *slopes.select_nth_unstable_by(middle, f64::total_cmp).1
        });
        let direction = Vector3::from(median).try_normalize(1e-9)?;
        let axis = Vector3::from(landmarks.axis_direction);
        let sum: Vector3<f64> = centres.iter().map(|(_, centre)| centre.coords).sum();
        Some(Self {
            direction: direction.into(),
            centre_mm: (sum / centres.len() as f64).into(),
            range_mm: [first.0, last.0],
            off_axis_deg: axis
                .cross(&direction)
                .norm()
                .atan2(axis.dot(&direction))
                .to_degrees(),
        })
    }
}
