//! Tests of the phantoms, on their shapes and in their voxels.

mod anatomy;
mod apart;
mod bone_points;
mod cortex;
mod foot_turns;
mod gauge;
mod knee;
mod leg_and_foot;
mod loft;
mod measured;
mod physeal_scar;
mod plate;
mod proportions;
mod rays;
mod scanner;
mod sdf;
mod skin;
mod tables;
mod tendon;
mod texture;
mod variants;
mod voxels;

use std::sync::LazyLock;

use nalgebra::{Point3, Vector3};
use ppa_ct::Volume;

use super::*;

const VOXEL_MM: f64 = 1.0;

static LIMB: LazyLock<LowerLeg> = LazyLock::new(LowerLeg::p01);
static CT: LazyLock<Volume> = LazyLock::new(|| LIMB.voxelise(VOXEL_MM, TableTop::Absent).unwrap());

/// The right limb of every phantom of the table.
fn family() -> impl Iterator<Item = (String, LowerLeg)> {
    (1..=17).map(|n| {
        let name = format!("P{n:02}");
        let leg = LowerLeg::family(&name, Side::Right).unwrap();
        (name, leg)
    })
}

impl LowerLeg {
    /// A point of the mortise frame (medial, posterior, proximal of the joint centre) in `ct`.
    fn mortise_point(&self, medial: f64, posterior: f64, proximal: f64) -> Point3<f64> {
        let in_limb = Point3::from(self.mortise.point(medial, posterior, proximal));
        self.on_right(self.ct_from_limb * in_limb)
    }
}

/// Lattice over a right limb, `step_mm` apart, not aligned with the symmetry planes.
fn lattice(limb: &Limb, step_mm: f64) -> impl Iterator<Item = Point3<f64>> + use<> {
    let (low, high) = limb.skin_box();
    let count = ((high - low) / step_mm).map(|n| n as usize);
    (0..count.x * count.y * count.z).map(move |n| {
        let place = Vector3::new(n % count.x, n / count.x % count.y, n / (count.x * count.y));
        low + place.map(|i| i as f64 + 0.37) * step_mm
    })
}
