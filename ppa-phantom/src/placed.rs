//! Shapes moved, rotated and resized: the tables describe one foot, a placement transforms it into another one.

use nalgebra::{Rotation3, Unit, Vector3};

use super::placement::Placement;
use super::sdf::{Cone, Plane, Shape};

fn turned(normal: &Unit<Vector3<f64>>, to: &Placement) -> Unit<Vector3<f64>> {
    to.isometry.rotation * *normal
}

fn local_axes(local_from_drawing: &Rotation3<f64>, to: &Placement) -> Rotation3<f64> {
    local_from_drawing * to.isometry.rotation.to_rotation_matrix().inverse()
}

impl Plane {
    pub(super) fn placed(&self, to: &Placement) -> Self {
        let normal = turned(&self.normal, to);
        Self {
            normal,
            offset: self.offset * to.scaling() + normal.dot(&to.isometry.translation.vector),
        }
    }
}

impl Shape {
    /// The shape at another place, size and orientation; distances stay distances in mm.
    pub(super) fn placed(&self, to: &Placement) -> Self {
        let size = to.scaling();
        let all = |parts: &[Self]| parts.iter().map(|part| part.placed(to)).collect();
        match self {
            Self::Ellipsoid {
                centre,
                semi,
                local_from_limb,
            } => Self::Ellipsoid {
                centre: to * centre,
                semi: semi * size,
                local_from_limb: local_axes(local_from_limb, to),
            },
            Self::Block {
                centre,
                half,
                round,
                local_from_limb,
            } => Self::Block {
                centre: to * centre,
                half: half * size,
                round: round * size,
                local_from_limb: local_axes(local_from_limb, to),
            },
            Self::RoundCone {
                from,
                to: end,
                from_radius,
                to_radius,
            } => Self::RoundCone {
                from: to * from,
                to: to * end,
                from_radius: from_radius * size,
                to_radius: to_radius * size,
            },
            Self::HalfSpace(plane) => Self::HalfSpace(plane.placed(to)),
            Self::Cone(cone) => Self::Cone(Cone {
                centre: to * cone.centre,
                axis: turned(&cone.axis, to),
                radius: cone.radius * size,
                taper: cone.taper,
                groove_depth: cone.groove_depth * size,
                groove_at: cone.groove_at * size,
                crest: cone.crest * size,
            }),
            Self::Loft(loft) => Self::Loft(Box::new(loft.placed(to))),
            Self::Union { blend, parts } => Self::Union {
                blend: blend * size,
                parts: all(parts),
            },
            Self::Common { blend, parts } => Self::Common {
                blend: blend * size,
                parts: all(parts),
            },
            Self::Grown { margin, shape } => Self::Grown {
                margin: margin * size,
                shape: Box::new(shape.placed(to)),
            },
        }
    }
}
