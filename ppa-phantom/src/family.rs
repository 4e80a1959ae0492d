//! The family of lower legs: a fixed table of seventeen, and any further by seed.

use ppa_core::Side;

use super::draw::{Purpose, bits, truncated_normal};
use super::family_table::{DIMENSIONS, Dimensions, FAMILY};
use super::parameters::{P01, Parameters, Sex};

/// No phantom has this name.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error("no phantom {name:?}, expected P01 to P17")]
pub struct UnknownPhantom {
    /// The name asked for.
    pub name: String,
}

/// How the left limb of a phantom differs from the mirror image of the right one: standard deviation of each
/// dimension. Left and right tali differ by less than 7.5 % in volume, 2.5 % in length (Bone Joint Res 2014).
const LEFT_RIGHT_SHARE: f64 = 0.01;

/// The phantom of this name, in upper or lower case.
pub(super) fn named(name: &str, side: Side) -> Result<Parameters, UnknownPhantom> {
    let number = name
        .strip_prefix(['P', 'p'])
        .filter(|n| n.len() == 2 && n.bytes().all(|digit| digit.is_ascii_digit()));
    let number = number.and_then(|n| n.parse::<usize>().ok());
    let row = number.and_then(|n| FAMILY.get(n.checked_sub(1)?));
    let (Some(number), Some(&(sex, dimensions))) = (number, row) else {
        let name = name.to_owned();
        return Err(UnknownPhantom { name });
    };
    if number == 1 && side == Side::Right {
        return Ok(P01);
    }
    let number = number as u64;
    let dimensions = on_side(dimensions, side, number, Purpose::LeftSide);
    let texture_seed = bits(number, Purpose::TextureOfName, side as u64);
    Ok(parameters(sex, texture_seed, &dimensions))
}

/// The phantom of this seed.
pub(super) fn of_seed(seed: u64, side: Side) -> Parameters {
    let female = bits(seed, Purpose::Dimension, u64::MAX) & 1 == 1;
    let sex = if female { Sex::Female } else { Sex::Male };
    let mut dimensions: Dimensions = std::array::from_fn(|index| {
        let dimension = &DIMENSIONS[index];
        let address = (seed, Purpose::Dimension, index as u64);
        truncated_normal(address, dimension.mean_and_deviation(sex), dimension.range)
    });
    let size = dimensions[0];
    for (dimension, value) in DIMENSIONS.iter().zip(&mut dimensions) {
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
            let size = if DIMENSIONS[index].grows {
                dimensions[0]
            } else {
                1.0
            };
            let range = DIMENSIONS[index].range.map(|end| end * size);
            truncated_normal((seed, purpose, index as u64), [right, deviation], range)
        }),
    }
}

fn parameters(sex: Sex, texture_seed: u64, dimensions: &Dimensions) -> Parameters {
    let &[
        size,
        mortise_deg,
        inclination_deg,
        trochlea_radius_mm,
        trochlea_width_mm,
        wedge_deg,
        trochlea_groove_mm,
        medial_slope_deg,
        lateral_slope_deg,
        superior_gutter_mm,
        medial_gutter_mm,
        lateral_gutter_mm,
        medial_malleolus_mm,
        lateral_malleolus_mm,
        front_gap_mm,
        back_gap_mm,
        incisura_depth_mm,
        head_1_mm,
        head_3_mm,
        head_4_mm,
        head_5_mm,
        thin_cortex_mm,
        distal_cortex_mm,
        shaft_cortex_mm,
        trabecular_hu,
        trabecular_texture_hu,
        ankle_girth,
        calf_girth,
        plantarflexion_deg,
        heel_valgus_deg,
        skin_mm,
    ] = dimensions;
    Parameters {
        sex,
        size,
        mortise_angle_rad: mortise_deg.to_radians(),
        superior_gutter_mm,
        medial_gutter_mm,
        lateral_gutter_mm,
        syndesmosis_mm: [front_gap_mm, back_gap_mm],
        incisura_depth_mm,
        trochlea_radius_mm,
        trochlea_width_mm,
        trochlea_wedge_rad: wedge_deg.to_radians(),
        trochlea_groove_mm,
        axis_inclination_rad: inclination_deg.to_radians(),
        medial_facet_slope_rad: medial_slope_deg.to_radians(),
        lateral_facet_slope_rad: lateral_slope_deg.to_radians(),
        medial_malleolus_mm,
        lateral_malleolus_mm,
        metatarsal_heads_mm: [head_1_mm, head_3_mm, head_4_mm, head_5_mm],
        tibia_cortex_mm: [thin_cortex_mm, distal_cortex_mm, shaft_cortex_mm],
        trabecular_hu,
        trabecular_texture_hu,
        texture_seed,
        ankle_girth,
        calf_girth,
        plantarflexion_rad: plantarflexion_deg.to_radians(),
        heel_valgus_rad: heel_valgus_deg.to_radians(),
        small_joint_mm: P01.small_joint_mm * size,
        skin_mm,
        leg_length_mm: P01.leg_length_mm,
        joint_centre_ct_mm: P01.joint_centre_ct_mm,
    }
}
