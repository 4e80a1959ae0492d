//! The family of lower legs: a fixed table of seventeen, and any number of others by seed.

use ppa_core::Side;

use super::draw::{Purpose, bits, truncated_normal};
use super::family_table::{Dimensions, FAMILY, Phantom};
use super::parameters::{P01, Parameters, Sex};

/// Error for a name that is not a phantom's.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error("no phantom {name:?}, expected P01 to P17")]
pub struct UnknownPhantom {
    /// The name asked for.
    pub name: String,
}

/// Difference of a phantom's left limb from the mirror image of the right one: relative standard deviation of each
/// dimension. Left and right tali differ by less than 7.5 % in volume, 2.5 % in length (Bone Joint Res 2014).
const LEFT_RIGHT_SHARE: f64 = 0.01;

/// Returns the phantom of this name, in upper or lower case.
pub(super) fn named(name: &str, side: Side) -> Result<Parameters, UnknownPhantom> {
    let is_it = |phantom: &Phantom| phantom.name.eq_ignore_ascii_case(name);
    let Some(index) = FAMILY.phantoms.iter().position(is_it) else {
        let name = name.to_owned();
        return Err(UnknownPhantom { name });
    };
    if index == 0 && side == Side::Right {
        return Ok(P01);
    }
    let number = index as u64 + 1;
    let phantom = &FAMILY.phantoms[index];
    let dimensions = on_side(phantom.values, side, number, Purpose::LeftSide);
    let texture_seed = bits(number, Purpose::TextureOfName, side as u64);
    Ok(parameters(phantom.sex, texture_seed, &dimensions))
}

/// Returns the phantom of this seed.
pub(super) fn of_seed(seed: u64, side: Side) -> Parameters {
    let female = bits(seed, Purpose::Dimension, u64::MAX) & 1 == 1;
    let sex = if female { Sex::Female } else { Sex::Male };
    let mut dimensions: Dimensions = std::array::from_fn(|index| {
        let dimension = &FAMILY.dimensions[index];
        let address = (seed, Purpose::Dimension, index as u64);
        truncated_normal(address, dimension.mean_and_deviation(sex), dimension.range)
    });
    let size = dimensions[0];
    for (dimension, value) in FAMILY.dimensions.iter().zip(&mut dimensions) {
        if dimension.grows {
            *value *= size;
        }
    }
    let dimensions = on_side(dimensions, side, seed, Purpose::LeftSideOfSeed);
    let texture_seed = bits(seed, Purpose::TextureOfSeed, side as u64);
    parameters(sex, texture_seed, &dimensions)
}

fn on_side(dimensions: Dimensions, side: Side, seed: u64, purpose: Purpose) -> Dimensions {
    match side {
        Side::Right => dimensions,
        Side::Left => std::array::from_fn(|index| {
            let right = dimensions[index];
            let deviation = LEFT_RIGHT_SHARE * right.abs();
            let size = if FAMILY.dimensions[index].grows {
                dimensions[0]
            } else {
                1.0
            };
            let range = FAMILY.dimensions[index].range.map(|end| end * size);
            truncated_normal((seed, purpose, index as u64), [right, deviation], range)
        }),
    }
}

fn parameters(sex: Sex, texture_seed: u64, dimensions: &Dimensions) -> Parameters {
    let of = |name: &str| {
        let index = FAMILY.dimensions.iter().position(|d| d.name == name);
        dimensions[index.expect("a test asks for every dimension")]
    };
    let size = of("size");
    Parameters {
        sex,
        size,
        mortise_angle_rad: of("mortise_deg").to_radians(),
        superior_gutter_mm: of("superior_gutter_mm"),
        medial_gutter_mm: of("medial_gutter_mm"),
        lateral_gutter_mm: of("lateral_gutter_mm"),
        syndesmosis_mm: ["front_gap_mm", "back_gap_mm"].map(of),
        incisura_depth_mm: of("incisura_depth_mm"),
        trochlea_radius_mm: of("trochlea_radius_mm"),
        trochlea_width_mm: of("trochlea_width_mm"),
        trochlea_wedge_rad: of("wedge_deg").to_radians(),
        trochlea_groove_mm: of("trochlea_groove_mm"),
        axis_inclination_rad: of("inclination_deg").to_radians(),
        medial_facet_slope_rad: of("medial_slope_deg").to_radians(),
        lateral_facet_slope_rad: of("lateral_slope_deg").to_radians(),
        medial_malleolus_mm: of("medial_malleolus_mm"),
        lateral_malleolus_mm: of("lateral_malleolus_mm"),
        metatarsal_heads_mm: ["head_1_mm", "head_3_mm", "head_4_mm", "head_5_mm"].map(of),
        tibia_cortex_mm: ["thin_cortex_mm", "distal_cortex_mm", "shaft_cortex_mm"].map(of),
        trabecular_hu: of("trabecular_hu"),
        trabecular_texture_hu: of("trabecular_texture_hu"),
        texture_seed,
        ankle_girth: of("ankle_girth"),
        calf_girth: of("calf_girth"),
        plantarflexion_rad: of("plantarflexion_deg").to_radians(),
        heel_valgus_rad: of("heel_valgus_deg").to_radians(),
        small_joint_mm: P01.small_joint_mm * size,
        skin_mm: of("skin_mm"),
        leg_length_mm: P01.leg_length_mm,
        joint_centre_ct_mm: P01.joint_centre_ct_mm,
    }
}
