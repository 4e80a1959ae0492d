//! Seeds by address: what is drawn for an item depends on the plan's seed, the purpose and the
//! item, never on the order of the work.

use ppa_core::random::seed_of_address;
use ppa_dataset::layout::LimbId;

/// What a seed is for. The names are part of the reproducibility contract.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Purpose {
    /// Samples of the table-plane search.
    TablePlane,
    /// Places and sizes of the bumps of a body shape; item = position of the shape.
    Bumps,
    /// Photon histories and quantum noise of a radiograph; item = step.
    Radiograph,
    /// Fixed errors of a depth camera.
    DepthSensor,
    /// Noise of depth images; item = step.
    DepthNoise,
    /// Which poses are made again to verify a dataset; item = step.
    Verification,
}

impl Purpose {
    fn name(self) -> &'static str {
        match self {
            Self::TablePlane => "table-plane",
            Self::Bumps => "bumps",
            Self::Radiograph => "radiograph",
            Self::DepthSensor => "depth-sensor",
            Self::DepthNoise => "depth-noise",
            Self::Verification => "verification",
        }
    }
}

/// Seed for something that belongs to the whole plan.
pub fn plan_seed(seed: u64, purpose: Purpose) -> u64 {
    seed_of_address(&format!("{seed}/{}", purpose.name()))
}

/// Seed for item `item` of one limb.
pub fn item_seed(seed: u64, purpose: Purpose, limb: LimbId, item: u32) -> u64 {
    seed_of_address(&format!(
        "{seed}/{}/{}/{}/{item}",
        purpose.name(),
        limb.patient,
        limb.side_letter()
    ))
}

#[cfg(test)]
mod tests {
    use ppa_dataset::layout::Side;

    use super::*;

    #[test]
    fn every_part_of_the_address_matters() {
        let limb = |patient, side| LimbId { patient, side };
        let mut seeds = vec![
            item_seed(1, Purpose::Bumps, limb(0, Side::Left), 0),
            item_seed(2, Purpose::Bumps, limb(0, Side::Left), 0),
            item_seed(1, Purpose::Radiograph, limb(0, Side::Left), 0),
            item_seed(1, Purpose::Bumps, limb(1, Side::Left), 0),
            item_seed(1, Purpose::Bumps, limb(0, Side::Right), 0),
            item_seed(1, Purpose::Bumps, limb(0, Side::Left), 1),
            plan_seed(1, Purpose::Bumps),
        ];
        let count = seeds.len();
        seeds.sort_unstable();
        seeds.dedup();
        assert_eq!(seeds.len(), count);
    }
}
