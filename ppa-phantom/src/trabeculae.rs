//! Spacing and direction of the trabeculae in a bone.

use nalgebra::{Matrix3, Point3, Rotation3, Unit, Vector3};

use super::placement::Placement;
use super::texture::variance_seen;

/// HU of fatty marrow, in shafts and between trabeculae.
pub(super) const MARROW_HU: f64 = -40.0;
/// HU of the tissue of trabeculae, of about 2 g/cm³; assumed.
const TRABECULA_HU: f64 = 1960.0;
/// Size of the voxels for which the standard deviation of the texture is specified, mm.
const TEXTURE_VOXEL_MM: f64 = 0.8;

/// Lines along which trabeculae run.
#[derive(Debug, Clone)]
enum Course {
    /// Parallel to the third local axis.
    Straight,
    /// Around the first local axis; the second one points to the middle of the bone, at this distance.
    Arcs { radius_mm: f64 },
}

/// The trabeculae of a bone.
#[derive(Debug, Clone)]
pub(super) struct Trabeculae {
    course: Course,
    origin: Point3<f64>,
    local_from_limb: Rotation3<f64>,
    /// Distance from one trabecula to the next.
    distance_mm: f64,
    /// Mean intercept along the trabeculae divided by that across them.
    anisotropy: f64,
}

impl Trabeculae {
    /// Trabeculae along the leg, in bone of this mean HU; `separation_mm` is the gap between neighbours (Tb.Sp).
    pub(super) fn new(mean_hu: f64, separation_mm: f64, anisotropy: f64) -> Self {
        Self {
            course: Course::Straight,
            origin: Point3::origin(),
            local_from_limb: Rotation3::identity(),
            distance_mm: separation_mm / (1.0 - volume_fraction(mean_hu)),
            anisotropy,
        }
    }

    /// The same along another direction.
    pub(super) fn along(self, direction: &Unit<Vector3<f64>>) -> Self {
        let turn = Rotation3::rotation_between(direction, &Vector3::z_axis());
        Self {
            // Undefined only for a half turn, which changes no course.
            local_from_limb: turn.unwrap_or_else(Rotation3::identity),
            ..self
        }
    }

    /// The same on circles around an axis through a point; another point is the middle of the bone.
    pub(super) fn around(
        self,
        centre: Point3<f64>,
        axis: &Unit<Vector3<f64>>,
        middle: Point3<f64>,
    ) -> Self {
        let out = middle - centre;
        let out = out - axis.scale(out.dot(axis));
        let towards = out.normalize();
        let third = axis.cross(&towards);
        let rows = [axis.into_inner(), towards, third].map(|v| v.transpose());
        Self {
            course: Course::Arcs {
                radius_mm: out.norm(),
            },
            origin: centre,
            local_from_limb: Rotation3::from_matrix_unchecked(Matrix3::from_rows(&rows)),
            ..self
        }
    }

    /// The trabeculae of a bone at another place, size and orientation; their spacing is unchanged.
    pub(super) fn placed(&self, to: &Placement) -> Self {
        let course = match self.course {
            Course::Straight => Course::Straight,
            Course::Arcs { radius_mm } => Course::Arcs {
                radius_mm: radius_mm * to.scaling(),
            },
        };
        let turn = to.isometry.rotation.inverse().to_rotation_matrix();
        Self {
            course,
            origin: to * self.origin,
            local_from_limb: self.local_from_limb * turn,
            ..*self
        }
    }

    /// Coordinates of a point across the trabeculae, twice, and along them, in units of their distance.
    pub(super) fn place(&self, p: &Point3<f64>) -> Point3<f64> {
        let q = self.local_from_limb * (p - self.origin);
        let [a, b, along] = match self.course {
            Course::Straight => [q.x, q.y, q.z],
            Course::Arcs { radius_mm } => [q.x, q.y.hypot(q.z), radius_mm * q.z.atan2(q.y)],
        };
        let [across, _, lengthwise] = self.width(1.0);
        Point3::new(a * across, b * across, along * lengthwise)
    }

    /// The edges of a voxel in the units of [`Self::place`].
    pub(super) fn width(&self, width_mm: f64) -> [f64; 3] {
        let across = width_mm / self.distance_mm;
        [across, across, across / self.anisotropy]
    }

    /// Factor that makes the standard deviation of the texture 1 in voxels of [`TEXTURE_VOXEL_MM`].
    pub(super) fn gain(&self) -> f64 {
        variance_seen(self.width(TEXTURE_VOXEL_MM)).sqrt().recip()
    }

    /// Distance from one trabecula to the next, mm.
    #[cfg(test)]
    pub(super) fn distance_mm(&self) -> f64 {
        self.distance_mm
    }
}

/// Share of trabeculae in spongy bone (BV/TV) of this mean HU.
pub(super) fn volume_fraction(mean_hu: f64) -> f64 {
    (mean_hu - MARROW_HU) / (TRABECULA_HU - MARROW_HU)
}
