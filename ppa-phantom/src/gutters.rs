//! The joint space of the ankle: points half-way between talus and mortise.

use nalgebra::{Point3, Unit, UnitQuaternion, Vector3};

use super::lower_leg::{FIBULA, LowerLeg, TALUS, TIBIA};
use super::sdf::Plane;

/// A point in a gutter.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct GutterPoint {
    /// Midpoint between the bones, `ct`.
    pub middle: Point3<f64>,
    /// Direction from the talus to the other bone.
    pub across: Unit<Vector3<f64>>,
    /// Bony gap along `across`, mm.
    pub width_mm: f64,
}

/// The gutters of an ankle as points about a millimetre apart.
#[derive(Debug, Clone, PartialEq)]
#[non_exhaustive]
pub struct Gutters {
    /// Between talus and medial malleolus.
    pub medial: Vec<GutterPoint>,
    /// Between trochlea and plafond.
    pub superior: Vec<GutterPoint>,
    /// Between talus and lateral malleolus.
    pub lateral: Vec<GutterPoint>,
}

/// Largest width of a joint space; wider gaps are not counted.
const WIDEST_MM: f64 = 6.0;
const STEP_MM: f64 = 1.0;
/// Distance from the middle of a face within which its points are sought.
const REACH_MM: i32 = 25;
/// Largest depth of the talus surface below the plane or cone of a face, mm: the edges of the talus are rounded.
const EDGE_MM: f64 = 0.3;

impl LowerLeg {
    /// Returns the points of the three gutters where they are at most 6 mm wide; widths are exact to 1e-4 mm.
    pub fn gutters(&self) -> Gutters {
        let p = &self.parameters;
        let at_width = Point3::from(self.mortise.point(0.0, 0.0, -8.0 * p.size));
        Gutters {
            medial: self.along_facet(&self.medial_facet(), &at_width, TIBIA),
            superior: self.along_trochlea(),
            lateral: self.along_facet(&self.lateral_facet(), &at_width, FIBULA),
        }
    }

    fn along_facet(&self, facet: &Plane, near: &Point3<f64>, bone: usize) -> Vec<GutterPoint> {
        let normal = facet.normal;
        let middle = near - normal.scale(facet.distance(near));
        let down = Unit::new_normalize(-Vector3::z() + normal.scale(normal.z));
        let forward = normal.cross(&down);
        lattice()
            .filter_map(|[a, b]| self.gutter_at(middle + forward * a + down.scale(b), normal, bone))
            .collect()
    }

    fn along_trochlea(&self) -> Vec<GutterPoint> {
        let p = &self.parameters;
        let axis = self.mortise.axis(p);
        let centre = Point3::from(self.mortise.point(0.0, 0.0, self.mortise.axis_z));
        let up = Unit::new_normalize(Vector3::z() - axis.scale(axis.z));
        let taper = p.axis_inclination_rad.tan();
        lattice()
            .filter_map(|[along, arc]| {
                let turn = UnitQuaternion::from_axis_angle(&axis, arc / p.trochlea_radius_mm);
                let outwards = turn * up;
                let normal = Unit::new_normalize(outwards.into_inner() + axis.scale(taper));
                // Start below the surface of the cone, since a groove runs around it.
                let radius = p.trochlea_radius_mm - along * taper - 2.0 * p.trochlea_groove_mm;
                let below = centre + axis.scale(along) + outwards.scale(radius);
                let talus = -self.skeleton.distance(TALUS, &below);
                let surface = self.march(below, normal, TALUS, -1.0, talus + 3.0)?;
                self.gutter_at(surface, normal, TIBIA)
            })
            .collect()
    }

    /// Measures the gap from a point on the talus across to another bone.
    fn gutter_at(
        &self,
        on_talus: Point3<f64>,
        across: Unit<Vector3<f64>>,
        bone: usize,
    ) -> Option<GutterPoint> {
        let off_talus = self.skeleton.distance(TALUS, &on_talus);
        if off_talus.abs() > EDGE_MM {
            return None;
        }
        let inside = on_talus - across.scale(off_talus + 2.0 * EDGE_MM);
        let on_talus = self.march(inside, across, TALUS, -1.0, 4.0 * EDGE_MM)?;
        let opposite = self.march(on_talus, across, bone, 1.0, WIDEST_MM)?;
        let across_ct = self.direction_on_right((self.ct_from_limb * across).into_inner());
        let middle = nalgebra::center(&on_talus, &opposite);
        Some(GutterPoint {
            middle: self.on_right(self.ct_from_limb * middle),
            across: Unit::new_unchecked(across_ct),
            width_mm: (opposite - on_talus).norm(),
        })
    }

    /// Finds the surface of a bone along a line, from outside (`sign` 1) or inside (-1).
    fn march(
        &self,
        from: Point3<f64>,
        along: Unit<Vector3<f64>>,
        bone: usize,
        sign: f64,
        reach_mm: f64,
    ) -> Option<Point3<f64>> {
        let mut t = 0.0;
        while t < reach_mm {
            let p = from + along.scale(t);
            let distance = sign * self.skeleton.distance(bone, &p);
            if distance < 1e-5 {
                return Some(p);
            }
            t += 0.7 * distance;
        }
        None
    }
}

fn lattice() -> impl Iterator<Item = [f64; 2]> {
    (-REACH_MM..=REACH_MM).flat_map(|a| {
        (-REACH_MM..=REACH_MM).map(move |b| [STEP_MM * f64::from(a), STEP_MM * f64::from(b)])
    })
}
