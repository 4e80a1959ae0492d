//! The built-in x-ray room from a few lengths.

use nalgebra::{Point3, Vector3};
use serde::{Deserialize, Serialize};

use crate::room::error::RoomError;
use crate::room::parts::Parts;

/// Lengths of the built-in x-ray room, mm.
///
/// Room frame: z up, y along the table towards the patient's head, origin where the central beam
/// meets the table top. Sizes are those of a common bucky room: a floating table top 80 cm above
/// the floor, a 43 cm detector below it, 110 cm focus-detector distance.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct RoomSpec {
    /// Length of the table top along y.
    pub table_length_mm: f64,
    /// Width of the table top along x.
    pub table_width_mm: f64,
    /// Thickness of the table top.
    pub table_thickness_mm: f64,
    /// Height of the table top above the floor.
    pub table_height_mm: f64,
    /// Length of the table beyond the central beam on the patient's foot side.
    pub table_foot_mm: f64,
    /// Distance of the detector from the source.
    pub source_detector_mm: f64,
    /// Distance of the detector below the table top.
    pub table_detector_mm: f64,
    /// Side of the square detector.
    pub detector_side_mm: f64,
    /// Distance of the tube column from the central beam, towards −x.
    pub column_distance_mm: f64,
    /// Distance of the wall behind the column from the central beam, towards −x.
    pub back_wall_mm: f64,
    /// Distance of the wall at the head end from the central beam, towards +y.
    pub head_wall_mm: f64,
    /// Height of the walls, from floor to ceiling.
    pub wall_height_mm: f64,
    /// Spacing of the points of the cloud.
    pub point_spacing_mm: f64,
}

impl Default for RoomSpec {
    fn default() -> Self {
        Self {
            table_length_mm: 2200.0,
            table_width_mm: 800.0,
            table_thickness_mm: 30.0,
            table_height_mm: 800.0,
            table_foot_mm: 450.0,
            source_detector_mm: 1100.0,
            table_detector_mm: 60.0,
            detector_side_mm: 430.0,
            column_distance_mm: 900.0,
            back_wall_mm: 1600.0,
            head_wall_mm: 2600.0,
            wall_height_mm: 2700.0,
            point_spacing_mm: 12.0,
        }
    }
}

/// Half the width of the tube housing and of the parts attached to it, mm.
const HOUSING_RADIUS_MM: f64 = 90.0;
/// Depth of the tube column, mm.
const COLUMN_MM: f64 = 200.0;
/// Length of the table's pedestal, mm.
const PEDESTAL_MM: f64 = 500.0;
/// Floor beyond the foot end of the table, mm.
const FOOT_SPACE_MM: f64 = 1000.0;

impl RoomSpec {
    /// Checks that lengths are in range and furniture does not overlap.
    ///
    /// # Errors
    /// [`RoomError`] naming the length at fault.
    pub fn check(&self) -> Result<(), RoomError> {
        let lengths = [
            ("table_length_mm", self.table_length_mm),
            ("table_width_mm", self.table_width_mm),
            ("table_thickness_mm", self.table_thickness_mm),
            ("table_height_mm", self.table_height_mm),
            ("table_foot_mm", self.table_foot_mm),
            ("source_detector_mm", self.source_detector_mm),
            ("table_detector_mm", self.table_detector_mm),
            ("detector_side_mm", self.detector_side_mm),
            ("column_distance_mm", self.column_distance_mm),
            ("back_wall_mm", self.back_wall_mm),
            ("head_wall_mm", self.head_wall_mm),
            ("wall_height_mm", self.wall_height_mm),
        ];
        for (name, found) in lengths {
            if !(found > 0.0 && found < 1e5) {
                return Err(RoomError::Length {
                    name,
                    found,
                    expected: "a length between 0 and 100 m",
                });
            }
        }
        let relations = [
            (
                "point_spacing_mm",
                self.point_spacing_mm,
                (1.0..=30.0).contains(&self.point_spacing_mm),
                "1 to 30 mm",
            ),
            (
                "table_foot_mm",
                self.table_foot_mm,
                self.table_foot_mm < self.table_length_mm,
                "less than the table's length",
            ),
            (
                "table_detector_mm",
                self.table_detector_mm,
                self.table_detector_mm > self.table_thickness_mm,
                "more than the table's thickness",
            ),
            (
                "table_height_mm",
                self.table_height_mm,
                self.table_height_mm > self.table_detector_mm + 100.0,
                "room for the detector between table and floor",
            ),
            (
                "source_detector_mm",
                self.source_detector_mm,
                self.source_detector_mm > self.table_detector_mm + 400.0,
                "at least 400 mm of air between source and table",
            ),
            (
                "column_distance_mm",
                self.column_distance_mm,
                self.column_distance_mm > 2.0 * HOUSING_RADIUS_MM,
                "a column clear of the tube housing",
            ),
            (
                "column_distance_mm",
                self.column_distance_mm,
                2.0 * self.column_distance_mm > self.table_width_mm.max(self.detector_side_mm),
                "a column clear of the table and the detector",
            ),
            (
                "back_wall_mm",
                self.back_wall_mm,
                self.back_wall_mm >= self.column_distance_mm + COLUMN_MM,
                "a wall behind the 200 mm deep column",
            ),
            (
                "table_length_mm",
                self.table_length_mm,
                self.head_end_mm() >= 0.5 * self.detector_side_mm + PEDESTAL_MM,
                "room for the 500 mm long pedestal between the detector and the head end",
            ),
            (
                "detector_side_mm",
                self.detector_side_mm,
                0.5 * self.detector_side_mm < self.table_foot_mm + FOOT_SPACE_MM,
                "a detector that ends before the wall 1 m beyond the foot end",
            ),
            (
                "head_wall_mm",
                self.head_wall_mm,
                self.head_wall_mm >= self.head_end_mm(),
                "a wall beyond the head end of the table",
            ),
            (
                "wall_height_mm",
                self.wall_height_mm,
                self.wall_height_mm >= self.table_height_mm + self.source_mm() + HOUSING_RADIUS_MM,
                "a ceiling above the tube housing",
            ),
        ];
        match relations.into_iter().find(|(.., holds, _)| !holds) {
            Some((name, found, _, expected)) => Err(RoomError::Length {
                name,
                found,
                expected,
            }),
            None => Ok(()),
        }
    }

    /// Height of the source above the table top.
    pub(crate) fn source_mm(&self) -> f64 {
        self.source_detector_mm - self.table_detector_mm
    }

    /// Distance of the table's head end from the central beam.
    fn head_end_mm(&self) -> f64 {
        self.table_length_mm - self.table_foot_mm
    }

    pub(crate) fn parts(&self, source_z: f64) -> Parts {
        let floor = -self.table_height_mm;
        let (half_table, half_detector) = (self.table_width_mm / 2.0, self.detector_side_mm / 2.0);
        let head_end = self.head_end_mm();
        let foot_wall = -self.table_foot_mm - FOOT_SPACE_MM;
        let front = half_table + 1200.0;
        let r = HOUSING_RADIUS_MM;
        let mut parts = Parts::default();
        let mut cuboid = |low: [f64; 3], high: [f64; 3]| parts.cuboid(low.into(), high.into());
        cuboid(
            [-half_table, -self.table_foot_mm, -self.table_thickness_mm],
            [half_table, head_end, 0.0],
        );
        let detector_top = -self.table_detector_mm;
        cuboid(
            [-half_detector, -half_detector, detector_top - 20.0],
            [half_detector, half_detector, detector_top],
        );
        // The pedestal stands next to the detector's travel, towards the head end.
        let pedestal_y = 0.5 * (half_detector + head_end);
        cuboid(
            [-0.5 * half_table, pedestal_y - 0.5 * PEDESTAL_MM, floor],
            [
                0.5 * half_table,
                pedestal_y + 0.5 * PEDESTAL_MM,
                -self.table_thickness_mm,
            ],
        );
        // Collimator under the focal spot; short enough to stay out of the cameras' view.
        cuboid([-r, -r, source_z - 120.0], [r, r, source_z - 40.0]);
        let column = -self.column_distance_mm;
        cuboid(
            [column, -60.0, source_z - 30.0],
            [-r, 60.0, source_z + 60.0],
        );
        cuboid(
            [column - COLUMN_MM, -120.0, floor],
            [column, 120.0, floor + self.wall_height_mm],
        );
        parts.cylinder(Point3::new(0.0, -230.0, source_z), Vector3::y() * 460.0, r);

        let (back, head) = (-self.back_wall_mm, self.head_wall_mm);
        let (depth, length) = (front - back, head - foot_wall);
        let up = Vector3::z() * self.wall_height_mm;
        let (x, y) = (Vector3::x() * depth, Vector3::y() * length);
        parts.rectangle(Point3::new(back, foot_wall, floor), x, y);
        parts.rectangle(Point3::new(back, foot_wall, floor), y, up);
        parts.rectangle(Point3::new(back, head, floor), x, up);
        parts
    }
}
