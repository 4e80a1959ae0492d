//! Tissue and Hounsfield units at a point or in a small ball of a limb.

use nalgebra::Point3;

use super::bone::Knot;
use super::limb::Limb;
use super::tissue::Tissue;
use super::trabeculae::MARROW_HU;

const AIR_HU: f64 = -1000.0;
const SKIN_HU: f64 = 60.0;
const FAT_HU: f64 = -100.0;
const SOFT_HU: f64 = 50.0;
const TENDON_HU: f64 = 85.0;
/// Titanium is denser; 12-bit scanners clip it here.
const TITANIUM_HU: f64 = 3071.0;
/// HU of the thin shells at joints and of the thick walls of shafts.
const CORTICAL_HU: [f64; 2] = [1200.0, 1600.0];
const CORTICAL_AT_MM: [f64; 2] = [1.0, 4.0];
/// Increase of the density of spongy bone below joint surfaces, and its depth in mm.
const SUBCHONDRAL_HU: f64 = 180.0;
const SUBCHONDRAL_MM: f64 = 5.0;

/// Share of a small ball of diameter `width` at signed distance `d` that is inside.
fn share_inside(d: f64, width: f64) -> f64 {
    (0.5 - d / width).clamp(0.0, 1.0)
}

fn cortical_hu(cortex_mm: f64) -> f64 {
    let [thin, thick] = CORTICAL_AT_MM;
    let t = ((cortex_mm - thin) / (thick - thin)).clamp(0.0, 1.0);
    CORTICAL_HU[0] + t * (CORTICAL_HU[1] - CORTICAL_HU[0])
}

/// Soft tissues with a boundary that may be near a point.
#[derive(Debug, Clone, Copy)]
pub(super) struct Near {
    /// Skin or the fat below it; if false, the point is deep inside.
    pub skin: bool,
    /// Fat bodies away from the skin.
    pub deep_fat: bool,
    pub tendon: bool,
}

/// Distances from one point to all boundaries near it, limb frame.
#[derive(Debug, Default)]
pub(super) struct Local {
    /// Signed distance to the skin; `None` if the point is known to be deep inside.
    pub skin_mm: Option<f64>,
    /// Index of each bone and signed distance to it.
    pub bones: Vec<(usize, f64)>,
}

impl Limb {
    pub(super) fn tissue_in_limb(&self, p: &Point3<f64>) -> Tissue {
        let skin = self.envelope.skin_distance(p);
        if skin >= 0.0 {
            return Tissue::Air;
        }
        if self.plate.as_ref().is_some_and(|m| m.distance(p) < 0.0) {
            return Tissue::Titanium;
        }
        if let Some((bone, distance)) = self.skeleton.bone_at(p) {
            return if distance > -self.skeleton.cortex_mm(bone, p, distance, 0.0) {
                Tissue::Cortical
            } else if self.skeleton.bones()[bone].filling.at(p).marrow > 0.5 {
                Tissue::Marrow
            } else {
                Tissue::Trabecular
            };
        }
        let envelope = &self.envelope;
        if skin > -envelope.skin_mm() {
            Tissue::Skin
        } else if skin > -envelope.cover_mm(p) {
            Tissue::Fat
        } else if envelope.tendon_distance(p) < 0.0 {
            Tissue::Tendon
        } else if envelope.deep_fat_distance(p) < 0.0 {
            Tissue::Fat
        } else {
            Tissue::SoftTissue
        }
    }

    /// Measures the distances to the listed bones and, if `near_skin`, to the skin.
    pub(super) fn measure(
        &self,
        p: &Point3<f64>,
        near_skin: bool,
        bones: impl Iterator<Item = usize>,
        local: &mut Local,
    ) {
        local.skin_mm = near_skin.then(|| self.envelope.skin_distance(p));
        local.bones.clear();
        local
            .bones
            .extend(bones.map(|b| (b, self.skeleton.distance(b, p))));
    }

    /// Whether any boundary may pass within `reach_mm` of the point.
    pub(super) fn boundary_near(&self, p: &Point3<f64>, local: &Local, reach_mm: f64) -> bool {
        let envelope = &self.envelope;
        let soft = match local.skin_mm {
            Some(skin) if skin > reach_mm => return false,
            Some(skin) => {
                skin.abs() < reach_mm
                    || (skin + envelope.skin_mm()).abs() < reach_mm
                    || (skin + envelope.cover_mm(p)).abs() < reach_mm
            }
            None => false,
        };
        let metal = || {
            let plate = self.plate.as_ref();
            plate.is_some_and(|plate| plate.distance(p).abs() < reach_mm)
        };
        soft || metal()
            || local.bones.iter().any(|&(bone, distance)| {
                distance.abs() < reach_mm
                    || (distance < 0.0 && {
                        let cortex_mm = self.skeleton.cortex_mm(bone, p, distance, reach_mm);
                        (distance + cortex_mm).abs() < reach_mm
                    })
            })
    }

    /// Mean Hounsfield unit of a ball of diameter `width_mm`, and the share of it that is in the limb.
    pub(super) fn mixture(
        &self,
        p: &Point3<f64>,
        near: Near,
        local: &Local,
        width_mm: f64,
    ) -> (f64, f64) {
        let inside = local.skin_mm.map_or(1.0, |d| share_inside(d, width_mm));
        if inside == 0.0 {
            return (AIR_HU, 0.0);
        }
        let (mut bone_share, mut bone_hu) = (0.0, 0.0);
        for &(index, distance) in &local.bones {
            let share = share_inside(distance, width_mm);
            if share == 0.0 {
                continue;
            }
            let filling = &self.skeleton.bones()[index].filling;
            let Knot {
                cortex_mm: shell_mm,
                marrow,
                ..
            } = filling.at(p);
            let cortex_mm = self.skeleton.cortex_mm(index, p, distance, width_mm);
            let core = share_inside(distance + cortex_mm, width_mm);
            // Depth below the shell rather than the plate, whose thickness is only known near the surface.
            let depth = (-distance - shell_mm).max(0.0);
            let mut spongy =
                filling.trabecular_hu + SUBCHONDRAL_HU * (-depth / SUBCHONDRAL_MM).exp();
            if let Some(scar) = &filling.scar {
                spongy += scar.hu(p, width_mm);
            }
            if self.texture_share > 0.0 && core > 0.0 && marrow < 1.0 {
                let trabeculae = &filling.trabeculae;
                let place = trabeculae.place(p);
                let texture = self.texture.at(&place, trabeculae.width(width_mm));
                let trabecular = filling.trabecular_hu - MARROW_HU;
                spongy += self.texture_share * trabecular * trabeculae.gain() * texture;
            }
            let core_hu = spongy + marrow * (MARROW_HU - spongy);
            bone_share += share;
            bone_hu += (share - core) * cortical_hu(cortex_mm) + core * core_hu;
        }
        let soft_share = (inside - bone_share).max(0.0);
        let mut hu = bone_hu + (1.0 - inside) * AIR_HU;
        if soft_share > 0.0 {
            hu += soft_share * self.soft_hu(p, near, local.skin_mm, inside, width_mm);
        }
        if let Some(plate) = &self.plate {
            let metal = share_inside(plate.distance(p), width_mm);
            hu += metal * (TITANIUM_HU - hu);
        }
        (hu, inside)
    }

    /// Mean Hounsfield unit of the part of a ball below the skin surface, without bones.
    fn soft_hu(
        &self,
        p: &Point3<f64>,
        near: Near,
        skin_mm: Option<f64>,
        inside: f64,
        width_mm: f64,
    ) -> f64 {
        let envelope = &self.envelope;
        let Some(skin) = skin_mm else {
            return self.deep_hu(p, near, width_mm);
        };
        let below_skin = share_inside(skin + envelope.skin_mm(), width_mm) / inside;
        let below_fat = share_inside(skin + envelope.cover_mm(p), width_mm) / inside;
        let mut hu = (1.0 - below_skin) * SKIN_HU + (below_skin - below_fat) * FAT_HU;
        if below_fat > 0.0 {
            hu += below_fat * self.deep_hu(p, near, width_mm);
        }
        hu
    }

    /// Mean Hounsfield unit below the fat under the skin, without bones.
    fn deep_hu(&self, p: &Point3<f64>, near: Near, width_mm: f64) -> f64 {
        let envelope = &self.envelope;
        let [mut tendon_mm, mut fat_mm] = [f64::INFINITY; 2];
        if near.tendon {
            tendon_mm = envelope.tendon_distance(p);
        }
        if near.deep_fat {
            fat_mm = envelope.deep_fat_distance(p);
        }
        let tendon = share_inside(tendon_mm, width_mm);
        let fat = share_inside(fat_mm.max(-tendon_mm), width_mm);
        let muscle = SOFT_HU + tendon * (TENDON_HU - SOFT_HU);
        muscle + fat * (FAT_HU - muscle)
    }
}
