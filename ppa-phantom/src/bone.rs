//! Bones: outer shape, joints cut into it, and filling.

use nalgebra::{Point3, Unit, Vector3};

use super::bounds::Bounds;
use super::physeal_scar::PhysealScar;
use super::placement::Placement;
use super::sdf::Shape;
use super::smooth::{smooth_max, smooth_step};
use super::subchondral::{JointSurface, plate_near};
use super::trabeculae::Trabeculae;

/// Sharpness of the edge between a joint surface and the rest of the bone, mm.
const EDGE_MM: f64 = 0.8;

/// Filling of a bone at one station along it.
#[derive(Debug, Clone, Copy)]
pub(super) struct Knot {
    pub station_mm: f64,
    /// Thickness of the cortex away from joints.
    pub cortex_mm: f64,
    /// Share of fatty marrow in the core; the rest is trabecular bone.
    pub marrow: f64,
}

/// Interior of a bone as a profile along one direction.
#[derive(Debug, Clone)]
pub(super) struct Filling {
    pub origin: Point3<f64>,
    pub direction: Unit<Vector3<f64>>,
    /// In increasing order of station, at least one; constant beyond the ends.
    pub knots: Vec<Knot>,
    /// HU of trabecular bone far from the surface.
    pub trabecular_hu: f64,
    pub trabeculae: Trabeculae,
    /// Scar of the growth plate, if any.
    pub scar: Option<PhysealScar>,
}

impl Filling {
    /// Uniform filling: a thin shell over trabecular bone.
    pub(super) fn spongy(cortex_mm: f64, trabecular_hu: f64, trabeculae: Trabeculae) -> Self {
        Self {
            origin: Point3::origin(),
            direction: Vector3::z_axis(),
            knots: vec![Knot {
                station_mm: 0.0,
                cortex_mm,
                marrow: 0.0,
            }],
            trabecular_hu,
            trabeculae,
            scar: None,
        }
    }

    /// Filling of a long bone of the foot: thick-walled shaft with marrow, spongy ends.
    pub(super) fn tubular(
        from: [f64; 3],
        to: [f64; 3],
        shaft_cortex_mm: f64,
        trabecular_hu: f64,
        trabeculae: Trabeculae,
    ) -> Self {
        let (origin, end): (Point3<f64>, Point3<f64>) = (from.into(), to.into());
        let length = (end - origin).norm();
        let knot = |share: f64, cortex_mm: f64, marrow: f64| Knot {
            station_mm: share * length,
            cortex_mm,
            marrow,
        };
        let direction = Unit::new_normalize(end - origin);
        Self {
            origin,
            direction,
            knots: vec![
                knot(0.1, 0.8, 0.0),
                knot(0.35, shaft_cortex_mm, 0.8),
                knot(0.6, shaft_cortex_mm, 0.8),
                knot(0.85, 0.8, 0.0),
            ],
            trabecular_hu,
            trabeculae: trabeculae.along(&direction),
            scar: None,
        }
    }

    /// The profile of a bone at another place, size and orientation.
    fn placed(&self, to: &Placement) -> Self {
        let size = to.scaling();
        let knots = self.knots.iter().map(|knot| Knot {
            station_mm: knot.station_mm * size,
            cortex_mm: knot.cortex_mm * size,
            marrow: knot.marrow,
        });
        Self {
            origin: to * self.origin,
            direction: to.isometry.rotation * self.direction,
            knots: knots.collect(),
            trabecular_hu: self.trabecular_hu,
            trabeculae: self.trabeculae.placed(to),
            scar: self.scar.as_ref().map(|scar| scar.placed(to)),
        }
    }

    /// Filling at a point.
    pub(super) fn at(&self, p: &Point3<f64>) -> Knot {
        let station_mm = (p - self.origin).dot(&self.direction);
        let after = self.knots.partition_point(|k| k.station_mm < station_mm);
        let next = self.knots[after.min(self.knots.len() - 1)];
        let previous = self.knots[after.saturating_sub(1)];
        let share = smooth_step(
            previous.station_mm,
            next.station_mm.max(previous.station_mm + 1e-9),
            station_mm,
        );
        Knot {
            station_mm,
            cortex_mm: previous.cortex_mm + share * (next.cortex_mm - previous.cortex_mm),
            marrow: previous.marrow + share * (next.marrow - previous.marrow),
        }
    }
}

/// Joint space between a bone and its neighbour; it may grow along one direction, within a range.
#[derive(Debug, Clone, Copy)]
pub(super) struct Gap {
    /// Width at the origin of the limb, mm.
    pub at_origin_mm: f64,
    /// Growth per mm.
    pub slope: Vector3<f64>,
    /// Smallest and largest width, mm.
    pub range_mm: [f64; 2],
}

impl Gap {
    pub(super) fn even(mm: f64) -> Self {
        Self {
            at_origin_mm: mm,
            slope: Vector3::zeros(),
            range_mm: [mm; 2],
        }
    }

    fn placed(&self, to: &Placement) -> Self {
        let slope = to.isometry.rotation * self.slope;
        Self {
            at_origin_mm: self.at_origin_mm * to.scaling()
                - slope.dot(&to.isometry.translation.vector),
            slope,
            range_mm: self.range_mm.map(|mm| mm * to.scaling()),
        }
    }

    fn at(&self, p: &Point3<f64>) -> f64 {
        let [least, most] = self.range_mm;
        (self.at_origin_mm + self.slope.dot(&p.coords)).clamp(least, most)
    }
}

/// One bone.
#[derive(Debug, Clone)]
pub(super) struct Bone {
    pub name: &'static str,
    /// The bone before its joints are cut.
    pub solid: Shape,
    /// Joint spaces cut out of the solid.
    pub hollows: Vec<Shape>,
    /// Neighbours made before this bone, and the joint space to them.
    pub yields_to: Vec<(usize, Gap)>,
    pub filling: Filling,
    /// Joint surfaces, where the cortex is the subchondral plate.
    pub joints: Vec<JointSurface>,
}

impl Bone {
    /// The bone at another place, size and orientation.
    pub(super) fn placed(&self, to: &Placement) -> Self {
        Self {
            name: self.name,
            solid: self.solid.placed(to),
            hollows: self.hollows.iter().map(|h| h.placed(to)).collect(),
            yields_to: self
                .yields_to
                .iter()
                .map(|(other, gap)| (*other, gap.placed(to)))
                .collect(),
            filling: self.filling.placed(to),
            joints: self.joints.iter().map(|j| j.placed(to)).collect(),
        }
    }
}

/// All bones; a bone yields only to bones before it.
#[derive(Debug, Clone)]
pub(super) struct Skeleton {
    bones: Vec<Bone>,
    bounds: Vec<Bounds>,
}

impl Skeleton {
    pub(super) fn new(bones: Vec<Bone>) -> Self {
        let bounds = bones.iter().map(|b| b.solid.bounds()).collect();
        Self { bones, bounds }
    }

    pub(super) fn bones(&self) -> &[Bone] {
        &self.bones
    }

    /// Returns the index of the bone that contains a point, and the signed distance to its surface.
    pub(super) fn bone_at(&self, p: &Point3<f64>) -> Option<(usize, f64)> {
        (0..self.bones.len())
            .filter(|&bone| self.box_distance(bone, p) == 0.0)
            .map(|bone| (bone, self.distance(bone, p)))
            .find(|(_, distance)| *distance < 0.0)
    }

    /// Distance to the bounding box of a bone: a lower bound of the distance to the bone.
    pub(super) fn box_distance(&self, bone: usize, p: &Point3<f64>) -> f64 {
        self.bounds[bone].distance(p)
    }

    /// Thickness of the cortex of a bone at a point with this signed distance to its surface, if it may matter within
    /// `reach_mm` of the point; deeper inside, the thickness away from joints.
    pub(super) fn cortex_mm(
        &self,
        bone: usize,
        p: &Point3<f64>,
        distance_mm: f64,
        reach_mm: f64,
    ) -> f64 {
        let bone = &self.bones[bone];
        let shell_mm = bone.filling.at(p).cortex_mm;
        if !plate_near(distance_mm, reach_mm) {
            return shell_mm;
        }
        let near =
            |joint: &&JointSurface| self.box_distance(joint.other, p) < joint.farthest_mm(reach_mm);
        let plates = bone.joints.iter().filter(near).map(|joint| {
            let apart_mm = distance_mm + self.distance(joint.other, p);
            joint.cortex_mm(p, shell_mm, apart_mm)
        });
        plates.fold(shell_mm, f64::max)
    }

    /// Signed distance to a bone in mm.
    pub(super) fn distance(&self, bone: usize, p: &Point3<f64>) -> f64 {
        let Bone {
            solid,
            hollows,
            yields_to,
            ..
        } = &self.bones[bone];
        let mut distance = solid.distance(p);
        for hollow in hollows {
            distance = smooth_max(distance, -hollow.distance(p), EDGE_MM);
        }
        for (other, gap) in yields_to {
            let (other, gap_mm) = (*other, gap.at(p));
            if self.box_distance(other, p) > gap_mm - distance + EDGE_MM {
                continue; // too far to matter
            }
            let space = gap_mm - self.bones[other].solid.distance(p);
            distance = smooth_max(distance, space, EDGE_MM);
        }
        distance
    }
}
