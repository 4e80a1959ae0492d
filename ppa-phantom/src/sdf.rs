//! Signed-distance shapes and their smooth combinations.
//!
//! Every shape returns a signed distance in mm, negative inside. Spheres, round cones and half-spaces are exact;
//! ellipsoids, lofts and smooth combinations are first-order estimates: exact on the surface, with a slope near 1 close to it. Smooth
//! combinations use the quadratic polynomial blend, which never raises the slope above that of its parts.

use nalgebra::{Point3, Rotation3, Unit, Vector3};

use super::bounds::Bounds;
use super::loft::Loft;
use super::smooth::{smooth_max, smooth_min};

/// A signed-distance shape in limb coordinates.
#[derive(Debug, Clone)]
pub(super) enum Shape {
    /// Ellipsoid with semi-axes along the rows of `local_from_limb`.
    Ellipsoid {
        centre: Point3<f64>,
        semi: Vector3<f64>,
        local_from_limb: Rotation3<f64>,
    },
    /// Cuboid with rounded edges, axes as for the ellipsoid; `half` is measured to the faces.
    Block {
        centre: Point3<f64>,
        half: Vector3<f64>,
        round: f64,
        local_from_limb: Rotation3<f64>,
    },
    /// Convex hull of two balls.
    RoundCone {
        from: Point3<f64>,
        to: Point3<f64>,
        from_radius: f64,
        to_radius: f64,
    },
    /// All points behind a plane.
    HalfSpace(Plane),
    /// Grooved cone about an axis, see [`Cone`].
    Cone(Cone),
    /// Polar sections along an axis.
    Loft(Box<Loft>),
    /// Smooth union.
    Union { blend: f64, parts: Vec<Shape> },
    /// Smooth intersection.
    Common { blend: f64, parts: Vec<Shape> },
    /// The shape grown by a margin.
    Grown { margin: f64, shape: Box<Shape> },
}

/// All points with `normal · p = offset`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Plane {
    pub normal: Unit<Vector3<f64>>,
    pub offset: f64,
}

impl Plane {
    /// Signed distance, positive on the side of the normal.
    pub(super) fn distance(&self, p: &Point3<f64>) -> f64 {
        self.normal.dot(&p.coords) - self.offset
    }
}

/// A cone about an axis whose upper generator is level when the axis is tilted by the half-angle: Inman's
/// model of the talar trochlea. A shallow groove runs around it half-way between its two crests.
#[derive(Debug, Clone)]
pub(super) struct Cone {
    /// Point of the axis where the radius is `radius`.
    pub centre: Point3<f64>,
    /// Axis towards the apex.
    pub axis: Unit<Vector3<f64>>,
    /// Radius at the centre, without the groove.
    pub radius: f64,
    /// Tangent of the half-angle.
    pub taper: f64,
    pub groove_depth: f64,
    /// Distance along the axis from the centre to the groove.
    pub groove_at: f64,
    /// Distance along the axis from the groove to either crest.
    pub crest: f64,
}

impl Cone {
    fn distance(&self, p: &Point3<f64>) -> f64 {
        let q = p - self.centre;
        let along = q.dot(&self.axis);
        let radial = (q - self.axis.scale(along)).norm();
        let beside = along - self.groove_at;
        let groove = if beside.abs() < self.crest {
            0.5 * self.groove_depth * (1.0 + (std::f64::consts::PI * beside / self.crest).cos())
        } else {
            0.0
        };
        let surface = self.radius - along * self.taper - groove;
        (radial - surface) / (1.0 + self.taper * self.taper).sqrt()
    }
}

impl Shape {
    /// Axis-aligned ellipsoid.
    pub(super) fn ellipsoid(centre: [f64; 3], semi: [f64; 3]) -> Self {
        Self::turned_ellipsoid(centre, semi, Rotation3::identity())
    }

    /// Ellipsoid whose semi-axes point along `limb_from_local` times x, y, z.
    pub(super) fn turned_ellipsoid(
        centre: [f64; 3],
        semi: [f64; 3],
        limb_from_local: Rotation3<f64>,
    ) -> Self {
        Self::Ellipsoid {
            centre: centre.into(),
            semi: semi.into(),
            local_from_limb: limb_from_local.inverse(),
        }
    }

    /// Cuboid rounded by `round`, with half-edges along `limb_from_local` times x, y, z.
    pub(super) fn block(
        centre: [f64; 3],
        half: [f64; 3],
        round: f64,
        limb_from_local: Rotation3<f64>,
    ) -> Self {
        Self::Block {
            centre: centre.into(),
            half: half.into(),
            round,
            local_from_limb: limb_from_local.inverse(),
        }
    }

    /// Convex hull of a ball at `from` and a ball at `to`.
    pub(super) fn round_cone(
        from: [f64; 3],
        from_radius: f64,
        to: [f64; 3],
        to_radius: f64,
    ) -> Self {
        Self::RoundCone {
            from: from.into(),
            to: to.into(),
            from_radius,
            to_radius,
        }
    }

    pub(super) fn union(blend: f64, parts: Vec<Shape>) -> Self {
        Self::Union { blend, parts }
    }

    pub(super) fn common(blend: f64, parts: Vec<Shape>) -> Self {
        Self::Common { blend, parts }
    }

    /// Signed distance estimate in mm.
    pub(super) fn distance(&self, p: &Point3<f64>) -> f64 {
        match self {
            Self::Ellipsoid {
                centre,
                semi,
                local_from_limb,
            } => ellipsoid_distance(&(local_from_limb * (p - centre)), semi),
            Self::Block {
                centre,
                half,
                round,
                local_from_limb,
            } => {
                let core = half.add_scalar(-round);
                let q = (local_from_limb * (p - centre)).abs() - core;
                q.sup(&Vector3::zeros()).norm() + q.max().min(0.0) - round
            }
            Self::RoundCone {
                from,
                to,
                from_radius,
                to_radius,
            } => round_cone_distance(p, from, to, *from_radius, *to_radius),
            Self::HalfSpace(plane) => plane.distance(p),
            Self::Cone(cone) => cone.distance(p),
            Self::Loft(loft) => loft.distance(p),
            Self::Union { blend, parts } => parts
                .iter()
                .map(|part| part.distance(p))
                .reduce(|a, b| smooth_min(a, b, *blend))
                .unwrap_or(f64::INFINITY),
            Self::Common { blend, parts } => parts
                .iter()
                .map(|part| part.distance(p))
                .reduce(|a, b| smooth_max(a, b, *blend))
                .unwrap_or(f64::NEG_INFINITY),
            Self::Grown { margin, shape } => shape.distance(p) - margin,
        }
    }

    /// Bounding box of the shape.
    pub(super) fn bounds(&self) -> Bounds {
        match self {
            Self::Ellipsoid { centre, semi, .. } => Bounds::ball(centre, semi.max()),
            Self::Block { centre, half, .. } => Bounds::ball(centre, half.norm()),
            Self::RoundCone {
                from,
                to,
                from_radius,
                to_radius,
            } => Bounds::ball(from, *from_radius).join(&Bounds::ball(to, *to_radius)),
            Self::HalfSpace(_) | Self::Cone(_) => Bounds::everything(),
            Self::Loft(loft) => loft.bounds(),
            Self::Union { blend, parts } => parts
                .iter()
                .map(Self::bounds)
                .reduce(|a, b| a.join(&b))
                .unwrap_or(Bounds::everything())
                .grown(blend / 4.0),
            Self::Common { parts, .. } => parts
                .iter()
                .map(Self::bounds)
                .reduce(|a, b| a.meet(&b))
                .unwrap_or(Bounds::everything()),
            Self::Grown { margin, shape } => shape.bounds().grown(*margin),
        }
    }
}

/// First-order distance: the implicit function divided by its gradient, which is exact on the surface.
fn ellipsoid_distance(q: &Vector3<f64>, semi: &Vector3<f64>) -> f64 {
    let level = q.component_div(semi).norm();
    let slope = q.component_div(&semi.component_mul(semi)).norm();
    if slope < 1e-9 {
        return -semi.min();
    }
    level * (level - 1.0) / slope
}

/// Exact distance to the hull of two balls.
fn round_cone_distance(p: &Point3<f64>, a: &Point3<f64>, b: &Point3<f64>, ra: f64, rb: f64) -> f64 {
    let axis = b - a;
    let length = axis.norm();
    let q = p - a;
    if length <= (ra - rb).abs() {
        return (q.norm() - ra).min((p - b).norm() - rb); // one ball holds the other
    }
    let along = q.dot(&axis) / length;
    let across = (q.norm_squared() - along * along).max(0.0).sqrt();
    let sine = (ra - rb) / length;
    let cosine = (1.0 - sine * sine).sqrt();
    // The tangent cone touches the balls where the foot of the perpendicular leaves the segment on either side.
    let foot = along - across * sine / cosine;
    if foot < 0.0 {
        q.norm() - ra
    } else if foot > length {
        (p - b).norm() - rb
    } else {
        across * cosine + along * sine - ra
    }
}
