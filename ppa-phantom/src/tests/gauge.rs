//! Measurements of a lower leg in its voxels.

use std::fmt;

use nalgebra::{Point3, Rotation3, Unit, Vector3};
use ppa_ct::Volume;

use crate::lower_leg::{FIBULA, TIBIA};
use crate::sdf::Plane;
use crate::*;

/// Half-way between cartilage and a thin shell blurred by a voxel.
pub(super) const HALF_WAY_HU: f64 = 650.0;
/// Half-way between air and skin.
pub(super) const SKIN_HU: f64 = -470.0;

/// A measurement and its expected value.
pub(super) struct Check {
    pub what: &'static str,
    pub found: f64,
    pub expected: f64,
    pub tolerance: f64,
}

impl Check {
    pub fn holds(&self) -> bool {
        (self.found - self.expected).abs() <= self.tolerance
    }
}

impl fmt::Display for Check {
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        let Self {
            what,
            found,
            expected,
            tolerance,
        } = self;
        write!(f, "{what}: {found}, expected {expected} ± {tolerance}")
    }
}

/// A check with its tolerance.
pub(super) fn within(what: &'static str, found: f64, expected: f64, tolerance: f64) -> Check {
    Check {
        what,
        found,
        expected,
        tolerance,
    }
}

/// A leg and voxels around a point of it.
pub(super) struct Gauge<'a> {
    pub leg: &'a LowerLeg,
    pub ct: Volume,
}

impl<'a> Gauge<'a> {
    /// Voxels of a box, given by its centre and half its edges, in the `ct` frame.
    pub fn around(leg: &'a LowerLeg, centre: &Point3<f64>, half: [f64; 3], voxel_mm: f64) -> Self {
        let half = Vector3::from(half);
        let ct = leg
            .voxelise_box([centre - half, centre + half], voxel_mm, TableTop::Absent)
            .unwrap();
        Self { leg, ct }
    }

    /// Voxels around the joint.
    pub fn joint(leg: &'a LowerLeg, voxel_mm: f64) -> Self {
        let centre = leg.truth().joint_centre - Vector3::new(0.0, 0.0, 4.0);
        Self::around(leg, &centre, [44.0, 44.0, 42.0], voxel_mm)
    }

    pub fn hu(&self, p: &Point3<f64>) -> f64 {
        self.ct.sample(p).unwrap_or(f64::NAN)
    }

    /// Distance from `start` along a line to the first place above (or below) a value; infinite without one.
    pub fn reach(&self, start: &Point3<f64>, along: &Vector3<f64>, hu: f64, above: bool) -> f64 {
        (0..2000)
            .map(|n| 0.05 * f64::from(n))
            .find(|t| {
                let there = self.hu(&(start + along * *t));
                if above { there > hu } else { there < hu }
            })
            .unwrap_or(f64::INFINITY)
    }

    /// From a point in a gap, the positions along a line at which bone begins behind and in front.
    pub fn gap(&self, start: &Point3<f64>, along: &Unit<Vector3<f64>>) -> [f64; 2] {
        let [back, front] =
            [-1.0, 1.0].map(|sign| self.reach(start, &along.scale(sign), HALF_WAY_HU, true));
        [-back, front]
    }

    pub fn mortise(&self, medial: f64, posterior: f64, proximal: f64) -> Point3<f64> {
        self.leg.mortise_point(medial, posterior, proximal)
    }

    /// The medial and the lateral facet of the talus: plane, width of its gutter, angle at which it opens, and its
    /// position along the mortise's medial axis.
    pub fn facets(&self) -> [(Plane, f64, f64, f64); 2] {
        let truth = self.leg.truth();
        let beside = 0.5 * truth.trochlea_width_mm + 2.0;
        [
            (
                self.leg.medial_facet(),
                truth.medial_gutter_mm,
                truth.medial_gutter_angle_rad,
                beside,
            ),
            (
                self.leg.lateral_facet(),
                truth.lateral_gutter_mm,
                truth.lateral_gutter_angle_rad,
                -beside,
            ),
        ]
    }

    /// Point on a facet nearest to another point, and the direction across its gutter; `ct`.
    pub fn on_facet(&self, facet: &Plane, near: &Point3<f64>) -> (Point3<f64>, Unit<Vector3<f64>>) {
        let near = self.leg.limb_point(near);
        let on_facet = near - facet.normal.scale(facet.distance(&near));
        let ct = &self.leg.ct_from_limb;
        (ct * on_facet, ct * facet.normal)
    }

    /// Half-way between tibia and fibula on a line across the syndesmosis, and the direction across; `ct`.
    pub fn between_shafts(
        &self,
        posterior: f64,
        proximal: f64,
    ) -> (Point3<f64>, Unit<Vector3<f64>>) {
        let to = |bone: usize, p: &Point3<f64>| {
            self.leg.skeleton.distance(bone, &self.leg.limb_point(p))
        };
        let (mut lateral, mut medial) = (-30.0, -8.0);
        for _ in 0..40 {
            let middle = 0.5 * (lateral + medial);
            let p = self.mortise(middle, posterior, proximal);
            if to(FIBULA, &p) < to(TIBIA, &p) {
                lateral = middle;
            } else {
                medial = middle;
            }
        }
        let p = self.mortise(lateral, posterior, proximal);
        let slope = |axis| {
            let step = Vector3::ith(axis, 0.01);
            to(TIBIA, &(p + step)) - to(TIBIA, &(p - step))
        };
        let towards_fibula = Vector3::new(slope(0), slope(1), slope(2));
        (p, Unit::new_normalize(towards_fibula))
    }

    /// Bone on a ray through each of the points, in mm of bone of 1000 HU, for a beam from front to back with the
    /// limb rotated inwards.
    pub fn bone_on_ray(&self, points: &[Point3<f64>], internal_rotation_deg: f64) -> f64 {
        let angle = -internal_rotation_deg.to_radians();
        let turn = Rotation3::from_axis_angle(&Vector3::z_axis(), angle);
        let along = self.leg.ct_from_limb * (turn * Vector3::y());
        let step_mm = 0.5;
        let ray = |p: &Point3<f64>| -> f64 {
            (-84..=84)
                .filter_map(|n| self.ct.sample(&(p + along * (step_mm * f64::from(n)))))
                .map(|hu| step_mm * (hu - 60.0).max(0.0) / 1000.0)
                .sum()
        };
        points.iter().map(ray).sum::<f64>() / points.len() as f64
    }

    /// Bone on rays through the middle of a gutter, at internal rotations of -10 to 50 degrees.
    pub fn opening(&self, (facet, width, _, beside): &(Plane, f64, f64, f64)) -> Vec<f64> {
        let size = self.leg.parameters.size;
        let middle: Vec<Point3<f64>> = (0..6)
            .map(|n| {
                let from = self.mortise(*beside, 0.0, (-6.0 - f64::from(n)) * size);
                let (on_facet, across) = self.on_facet(facet, &from);
                on_facet + across.scale(0.5 * width)
            })
            .collect();
        (-10..=50)
            .map(|angle| self.bone_on_ray(&middle, f64::from(angle)))
            .collect()
    }
}

/// Internal rotation at the minimum of 61 values from -10 to 50 degrees, each the amount of bone in mm: the middle of
/// the angles around it with at most a millimetre more, since the minimum is flat and other bones overlap it.
pub(super) fn least_deg(values: &[f64]) -> f64 {
    let least =
        (0..values.len()).fold(0, |best, n| if values[n] < values[best] { n } else { best });
    let open = |n: &usize| values[*n] <= values[least] + 1.0;
    let from = (0..=least).rev().take_while(open).last().unwrap_or(least);
    let to = (least..values.len())
        .take_while(open)
        .last()
        .unwrap_or(least);
    0.5 * (from + to) as f64 - 10.0
}
