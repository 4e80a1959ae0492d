//! How far apart trabeculae are in a bone, and how they run.

use nalgebra::{Matrix3, Point3, Rotation3, Unit, Vector3};

use super::placement::Placement;
use super::texture::variance_seen;

/// HU of fatty marrow, in shafts and between trabeculae.
pub(super) const MARROW_HU: f64 = -40.0;
/// HU of the tissue of trabeculae, of about 2 g/cm³; assumed.
const TRABECULA_HU: f64 = 1960.0;
/// Voxels in which the texture has the standard deviation of the parameters, mm.
const TEXTURE_VOXEL_MM: f64 = 0.8;

/// Lines that trabeculae follow.
#[derive(Debug, Clone)]
enum Course {
    /// Parallel to the third local axis.
    Straight,
    /// Around the first local axis; the second one points to the middle of the bone, this far away.
    Arcs { radius_mm: f64 },
}

/// The trabeculae of a bone.
#[derive(Debug, Clone)]
pub(super) struct Trabeculae {
    course: Course,
    origin: Point3<f64>,
    local_from_limb: Rotation3<f64>,
    /// From a trabecula to the next one.
    distance_mm: f64,
    /// Mean intercept along the trabeculae over that across them.
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
            // There is none for a half turn only, which changes no course.
            local_from_limb: turn.unwrap_or_else(Rotation3::identity),
            ..self
        }
    }

    /// The same on circles around an axis through a point, in a bone with its middle at another one.
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

    /// The trabeculae of a bone at another place, size and orientation; they stay as far apart.
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

    /// A point across the trabeculae, twice, and along them, in distances between them.
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

    /// What makes the standard deviation of the texture 1 in voxels of [`TEXTURE_VOXEL_MM`].
    pub(super) fn gain(&self) -> f64 {
        variance_seen(self.width(TEXTURE_VOXEL_MM)).sqrt().recip()
    }

    /// From a trabecula to the next one, mm.
    #[cfg(test)]
    pub(super) fn distance_mm(&self) -> f64 {
        self.distance_mm
    }
}

/// Share of trabeculae in spongy bone (BV/TV) of this mean HU.
pub(super) fn volume_fraction(mean_hu: f64) -> f64 {
    (mean_hu - MARROW_HU) / (TRABECULA_HU - MARROW_HU)
}
