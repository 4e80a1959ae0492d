//! Soft tissue that deforms where a limb rests on the table.

use nalgebra::{Isometry3, Matrix3, Point3, Rotation3, Translation3, UnitQuaternion};
use serde::{Deserialize, Serialize};

use crate::placement::error::PlaceError;
use crate::room::plane::Plane;

/// How deeply the two parts of a limb that rest on the table are indented: heel and calf of a lower leg.
///
/// The default is a rigid skin, as in the paper.
#[derive(Debug, Clone, Copy, Default, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct SoftTissue {
    /// Indentation depth at the distal contact, mm.
    pub distal_mm: f64,
    /// Indentation depth at the proximal contact, mm.
    pub proximal_mm: f64,
}

impl SoftTissue {
    /// The depths, distal first.
    pub(crate) fn depths_mm(&self) -> [f64; 2] {
        [self.distal_mm, self.proximal_mm]
    }

    /// Checks that the depths are in range.
    ///
    /// # Errors
    /// [`PlaceError::SoftTissue`] for a depth that is not 0 to 20 mm.
    pub fn check(&self) -> Result<(), PlaceError> {
        let fields = ["distal_mm", "proximal_mm"]
            .into_iter()
            .zip(self.depths_mm());
        for (name, found_mm) in fields {
            if !(0.0..=20.0).contains(&found_mm) {
                return Err(PlaceError::SoftTissue { name, found_mm });
            }
        }
        Ok(())
    }
}

/// Share of its height that the lowest tissue keeps: the contact becomes 1 / 0.4³, about 16 times,
/// flatter.
const KEPT: f64 = 0.4;

/// Contacts of a tilted limb that lie closer to each other along the table are one, mm.
const ONE_PLACE_MM: f64 = 10.0;

/// Contacts that lie closer to each other along the table determine nothing beyond them, mm.
const NEAR_MM: f64 = 50.0;

/// Deformation of the soft tissue of a limb that was placed a depth s into the table.
///
/// A layer of thickness T = 2 s / (1 − a), a = 0.4, is pressed into its upper T − s. With
/// u = (z + s) / T from 0 at the lowest point to 1 at the top of the layer, heights become
/// ζ(z) = T (a u + (1 − a) u² / 2), which rises everywhere, from 0 to T − s with slope
/// ζ′ = a + (1 − a) u; lengths across the table become (x − x₀) / ζ′ about the line x₀ through
/// both contacts. The tissue swells sideways by as much as it is pressed: the Jacobian is
/// ζ′ · 1/ζ′ = 1, so that no volume is lost, and no two points meet. Above the layer nothing moves.
/// s is linear along the table from one contact to the other and beyond, but not below 0. If a limb is tilted, or its contacts are
/// less than 50 mm apart, a part that is lifted does not sink in, s and x₀ keep their values at the contacts beyond them, and points
/// deeper than s are moved onto the table.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Flattening {
    /// Axes of the table at the distal contact, before it was flattened: x across, y towards the
    /// head, z up; origin on the table.
    room_from_contact: Isometry3<f64>,
    /// Depth of the distal contact, mm.
    depth_mm: f64,
    /// Increase of the depth per mm towards the head.
    depth_per_mm: f64,
    /// Shift of the line through both contacts across the table per mm towards the head.
    across_per_mm: f64,
    /// Distance between the contacts along the table for a tilted limb, or one with near contacts, mm.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    apart_mm: Option<f64>,
}

impl Flattening {
    /// The flattening of a limb with these lowest distal and proximal points.
    pub(crate) fn at(
        [distal, proximal]: [Point3<f64>; 2],
        table: &Plane,
        room_axes: &Matrix3<f64>,
        is_tilted: bool,
    ) -> Self {
        let rotation = Rotation3::from_matrix_unchecked(*room_axes);
        let room_from_contact = Isometry3::from_parts(
            Translation3::from(table.project(&distal)),
            UnitQuaternion::from_rotation_matrix(&rotation),
        );
        let depths = [&distal, &proximal].map(|p| -table.signed_distance(p));
        let apart = room_from_contact.inverse_transform_point(&proximal);
        if is_tilted || apart.y < NEAR_MM {
            let depths = depths.map(|depth| depth.max(0.0));
            // Lowest points next to each other: the entire limb sinks in equally.
            let is_one_place = apart.y < ONE_PLACE_MM;
            let rise = |over: f64| if is_one_place { 0.0 } else { over / apart.y };
            return Self {
                room_from_contact,
                depth_mm: if is_one_place {
                    depths[0].max(depths[1])
                } else {
                    depths[0]
                },
                depth_per_mm: rise(depths[1] - depths[0]),
                across_per_mm: rise(apart.x),
                apart_mm: Some(apart.y.max(0.0)),
            };
        }
        Self {
            room_from_contact,
            depth_mm: depths[0],
            depth_per_mm: (depths[1] - depths[0]) / apart.y,
            across_per_mm: apart.x / apart.y,
            apart_mm: None,
        }
    }

    /// Position of a point of the placed limb after flattening, room frame.
    pub fn flattened(&self, p: &Point3<f64>) -> Point3<f64> {
        let mut at = self.room_from_contact.inverse_transform_point(p);
        let along = self.apart_mm.map_or(at.y, |apart| at.y.clamp(0.0, apart));
        let depth_mm = self.depth_mm + self.depth_per_mm * along;
        let layer_mm = 2.0 * depth_mm / (1.0 - KEPT);
        if self.apart_mm.is_some() && depth_mm <= 0.0 {
            at.z = at.z.max(0.0);
            return self.room_from_contact * at;
        }
        if depth_mm <= 0.0 || at.z >= layer_mm - depth_mm {
            return *p;
        }
        // Both contacts are found to 0.05 mm: other points may lie that much below their line.
        let u = ((at.z + depth_mm) / layer_mm).max(0.0);
        let slope = KEPT + (1.0 - KEPT) * u;
        at.z = layer_mm * u * (KEPT + 0.5 * (1.0 - KEPT) * u);
        let line = self.across_per_mm * along;
        at.x = line + (at.x - line) / slope;
        self.room_from_contact * at
    }
}

#[cfg(test)]
mod tests {
    use nalgebra::Vector3;

    use super::*;

    /// Contacts 6 mm apart along the table and 5 mm across it, as under a convex limb that rests on its middle.
    #[test]
    fn near_contacts_move_nothing_far_from_them() {
        let table = Plane {
            normal: Vector3::z_axis(),
            offset_mm: 0.0,
        };
        let contacts = [Point3::new(0.0, 0.0, -4.0), Point3::new(5.0, 6.0, -3.0)];
        let flattening = Flattening::at(contacts, &table, &Matrix3::identity(), false);
        for y in [-140.0, -74.0, 3.0, 150.0] {
            for x in [-40.0, -3.0, 0.0, 8.0] {
                let moved = flattening.flattened(&Point3::new(x, y, 1.0));
                // Away from the contacts by at most 1 / 0.4.
                let line = if x < 0.0 { 5.0 } else { 0.0 };
                assert!(
                    (moved.x - line).abs() <= (x - line).abs() / KEPT + 1e-9,
                    "{x}, {y}: {moved}"
                );
                assert!((-1e-9..=4.0).contains(&moved.z), "{x}, {y}: {moved}");
            }
        }
    }
}
