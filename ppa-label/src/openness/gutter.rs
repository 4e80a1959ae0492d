//! The gap between two bones of the joint.

use nalgebra::{Point3, Unit, UnitQuaternion, Vector3};

use super::bones::{AnkleBone, AnkleBones, Body};

/// Wider gaps are not joint space, mm.
const WIDEST_MM: f64 = 6.0;
/// Two faces oppose each other: cosine of the largest angle between the normal of one and the reversed normal of the other.
const FACING: f64 = 0.5;

/// Width of the rim of a facet, mm.
const RIM_MM: f64 = 1.5;

/// Where the talus faces another bone across the joint space.
#[derive(Debug, Clone, Copy)]
pub(super) struct Gap {
    /// Point on the talus, `ct`.
    pub foot: Point3<f64>,
    /// Direction from the talus across the gap.
    pub across: Vector3<f64>,
    /// Distance to the other bone, mm.
    pub width_mm: f64,
}

impl Gap {
    /// Point on the other bone, `ct`.
    pub fn end(&self) -> Point3<f64> {
        self.foot + self.across * self.width_mm
    }
}

/// The gaps from the talus to `other`, one for each voxel of the talus that has a neighbour outside it, without the
/// outermost 1.5 mm of the facet: beyond its rim, rays are free in any direction.
pub(super) fn gaps(bones: &AnkleBones, other: AnkleBone) -> Vec<Gap> {
    let talus = bones.body(AnkleBone::Talus);
    let gaps: Vec<Gap> = border_voxels(bones.size(), talus.values())
        .filter_map(|voxel| gap_from(bones, talus, other, bones.centre(voxel)))
        .collect();
    let near = bones.coarseness_mm();
    let within_rim = |gap: &&Gap| {
        let beside =
            UnitQuaternion::rotation_between(&Vector3::z(), &gap.across).unwrap_or_else(|| {
                UnitQuaternion::from_axis_angle(&Vector3::x_axis(), std::f64::consts::PI)
            });
        let sides = [Vector3::x(), -Vector3::x(), Vector3::y(), -Vector3::y()];
        sides.iter().all(|side| {
            let there = gap.foot + beside * side * RIM_MM;
            let close = |other: &Gap| (other.foot - there).norm_squared() < near * near;
            gaps.iter().any(close)
        })
    };
    gaps.iter().filter(within_rim).copied().collect()
}

/// Voxels inside a body with one of their six neighbours outside it.
fn border_voxels(size: [usize; 3], body: &[f32]) -> impl Iterator<Item = [usize; 3]> {
    let [nx, ny, nz] = size;
    let strides = [1, nx, nx * ny];
    let candidates = (1..nz.saturating_sub(1)).flat_map(move |k| {
        (1..ny.saturating_sub(1))
            .flat_map(move |j| (1..nx.saturating_sub(1)).map(move |i| [i, j, k]))
    });
    candidates.filter(move |[i, j, k]| {
        let at = (k * ny + j) * nx + i;
        body[at] >= 0.5
            && strides
                .iter()
                .any(|s| body[at - s] < 0.5 || body[at + s] < 0.5)
    })
}

fn gap_from(bones: &AnkleBones, talus: &Body, other: AnkleBone, near: Point3<f64>) -> Option<Gap> {
    let across = bones.normal(talus, &near)?;
    let reach = 2.0 * bones.coarseness_mm();
    let foot = leave(bones, talus, near - across * (0.5 * reach), across, reach)?;
    let opposite = bones.body(other);
    let step = 0.2 * bones.coarseness_mm();
    let inside = |t: f64| bones.at(opposite, &bones.voxel(&(foot + across * t))) >= 0.5;
    let steps = (WIDEST_MM / step).ceil() as usize;
    let hit = (1..=steps).map(|n| n as f64 * step).find(|&t| inside(t))?;
    let width_mm = bisect(hit - step, hit, |t| !inside(t));
    let facing = bones.normal(opposite, &(foot + across * width_mm))?;
    (facing.dot(&across) < -FACING).then_some(Gap {
        foot,
        across,
        width_mm,
    })
}

/// The last point inside a body along a line.
fn leave(
    bones: &AnkleBones,
    body: &Body,
    from: Point3<f64>,
    along: Vector3<f64>,
    reach: f64,
) -> Option<Point3<f64>> {
    let inside = |t: f64| bones.at(body, &bones.voxel(&(from + along * t))) >= 0.5;
    let step = 0.1 * reach;
    let steps = 1..=20;
    let out = steps
        .map(|n| f64::from(n) * step)
        .find(|&t| inside(t - step) && !inside(t))?;
    Some(from + along * bisect(out - step, out, inside))
}

/// The end of the interval from `low` on which `holds` is true, to a thousandth of a millimetre.
fn bisect(mut low: f64, mut high: f64, holds: impl Fn(f64) -> bool) -> f64 {
    while high - low > 1e-3 {
        let middle = 0.5 * (low + high);
        if holds(middle) {
            low = middle;
        } else {
            high = middle;
        }
    }
    low
}

/// Whether a gap faces along the limb's axis, like that between trochlea and plafond.
pub(super) fn is_superior(gap: &Gap, axis: &Unit<Vector3<f64>>) -> bool {
    // Half-way between the plafond (0°) and the medial facet (66° on average).
    const STEEPEST: f64 = 0.8;
    gap.across.dot(axis) > STEEPEST
}
