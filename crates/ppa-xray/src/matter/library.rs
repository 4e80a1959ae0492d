//! Named materials.
//!
//! Tissues, plastics and compounds: the NIST compound list (ICRP and ICRU compositions) as in xraylib 4.3.0.
//! Alloys: the middle of the ranges of their standards. Elements: by symbol, or by the names in [`ELEMENT_NAMES`].

use crate::{
    matter::element::{atomic_number, density_g_cm3, symbol},
    matter::material::Material,
};

struct Entry {
    name: &'static str,
    density_g_cm3: f64,
    mass_fractions: &'static [(u8, f64)],
}

const fn entry(
    name: &'static str,
    density_g_cm3: f64,
    mass_fractions: &'static [(u8, f64)],
) -> Entry {
    Entry {
        name,
        density_g_cm3,
        mass_fractions,
    }
}

const MIXTURES: &[Entry] = &[
    entry("water", 1.0, &[(1, 0.111894), (8, 0.888106)]),
    entry(
        "air",
        0.001205,
        &[(6, 0.000124), (7, 0.755267), (8, 0.231781), (18, 0.012827)],
    ),
    entry(
        "soft_tissue",
        1.0,
        &[
            (1, 0.104472),
            (6, 0.23219),
            (7, 0.02488),
            (8, 0.630238),
            (11, 0.00113),
            (12, 0.00013),
            (15, 0.00133),
            (16, 0.00199),
            (17, 0.00134),
            (19, 0.00199),
            (20, 0.00023),
            (26, 5e-05),
            (30, 3e-05),
        ],
    ),
    entry(
        "soft_tissue_icru4",
        1.0,
        &[(1, 0.101172), (6, 0.111), (7, 0.026), (8, 0.761828)],
    ),
    entry(
        "muscle",
        1.04,
        &[
            (1, 0.100637),
            (6, 0.10783),
            (7, 0.02768),
            (8, 0.754773),
            (11, 0.00075),
            (12, 0.00019),
            (15, 0.0018),
            (16, 0.00241),
            (17, 0.00079),
            (19, 0.00302),
            (20, 3e-05),
            (26, 4e-05),
            (30, 5e-05),
        ],
    ),
    entry(
        "adipose",
        0.92,
        &[
            (1, 0.119477),
            (6, 0.63724),
            (7, 0.00797),
            (8, 0.232333),
            (11, 0.0005),
            (12, 2e-05),
            (15, 0.00016),
            (16, 0.00073),
            (17, 0.00119),
            (19, 0.00032),
            (20, 2e-05),
            (26, 2e-05),
            (30, 2e-05),
        ],
    ),
    entry(
        "skin",
        1.1,
        &[
            (1, 0.100588),
            (6, 0.22825),
            (7, 0.04642),
            (8, 0.619002),
            (11, 7e-05),
            (12, 6e-05),
            (15, 0.00033),
            (16, 0.00159),
            (17, 0.00267),
            (19, 0.00085),
            (20, 0.00015),
            (26, 1e-05),
            (30, 1e-05),
        ],
    ),
    entry(
        "blood",
        1.06,
        &[
            (1, 0.101866),
            (6, 0.10002),
            (7, 0.02964),
            (8, 0.759414),
            (11, 0.00185),
            (12, 4e-05),
            (14, 3e-05),
            (15, 0.00035),
            (16, 0.00185),
            (17, 0.00278),
            (19, 0.00163),
            (20, 6e-05),
            (26, 0.00046),
            (30, 1e-05),
        ],
    ),
    entry(
        "brain",
        1.03,
        &[
            (1, 0.110667),
            (6, 0.12542),
            (7, 0.01328),
            (8, 0.737723),
            (11, 0.00184),
            (12, 0.00015),
            (15, 0.00354),
            (16, 0.00177),
            (17, 0.00236),
            (19, 0.0031),
            (20, 9e-05),
            (26, 5e-05),
            (30, 1e-05),
        ],
    ),
    entry(
        "lung",
        1.05,
        &[
            (1, 0.101278),
            (6, 0.10231),
            (7, 0.02865),
            (8, 0.757072),
            (11, 0.00184),
            (12, 0.00073),
            (15, 0.0008),
            (16, 0.00225),
            (17, 0.00266),
            (19, 0.00194),
            (20, 9e-05),
            (26, 0.00037),
            (30, 1e-05),
        ],
    ),
    entry(
        "bone_cortical",
        1.85,
        &[
            (1, 0.047234),
            (6, 0.14433),
            (7, 0.04199),
            (8, 0.446096),
            (12, 0.0022),
            (15, 0.10497),
            (16, 0.00315),
            (20, 0.20993),
            (30, 0.0001),
        ],
    ),
    entry(
        "bone_compact",
        1.85,
        &[
            (1, 0.063984),
            (6, 0.278),
            (7, 0.027),
            (8, 0.410016),
            (12, 0.002),
            (15, 0.07),
            (16, 0.002),
            (20, 0.147),
        ],
    ),
    entry("pmma", 1.19, &[(1, 0.080538), (6, 0.599848), (8, 0.319614)]),
    entry("polyethylene", 0.94, &[(1, 0.143711), (6, 0.856289)]),
    entry("polystyrene", 1.06, &[(1, 0.077418), (6, 0.922582)]),
    entry(
        "nylon",
        1.14,
        &[(1, 0.097976), (6, 0.636856), (7, 0.123779), (8, 0.141389)],
    ),
    entry(
        "a150",
        1.127,
        &[
            (1, 0.101327),
            (6, 0.775501),
            (7, 0.035057),
            (8, 0.052316),
            (9, 0.017422),
            (20, 0.018378),
        ],
    ),
    entry(
        "glass",
        2.4,
        &[(8, 0.4598), (11, 0.096441), (14, 0.336553), (20, 0.107205)],
    ),
    entry("csi", 4.51, &[(53, 0.488451), (55, 0.511549)]),
    entry("gos", 7.44, &[(8, 0.084528), (16, 0.08469), (64, 0.830782)]),
    // Ultra-high-molecular-weight polyethylene of bearings, (C2H4)n, ASTM F648.
    entry("uhmwpe", 0.935, &[(1, 0.143711), (6, 0.856289)]),
    // Ca10(PO4)6(OH)2.
    entry(
        "hydroxyapatite",
        3.16,
        &[(1, 0.002007), (8, 0.414068), (15, 0.184987), (20, 0.398938)],
    ),
    // Ti-6Al-4V, ASTM F136.
    entry("ti6al4v", 4.43, &[(13, 0.06), (22, 0.90), (23, 0.04)]),
    // Co-28Cr-6Mo, ASTM F75.
    entry(
        "cocr",
        8.3,
        &[(24, 0.28), (27, 0.65), (28, 0.005), (42, 0.065)],
    ),
    // Stainless steel 316L, ASTM F138.
    entry(
        "steel_316l",
        7.95,
        &[
            (24, 0.18),
            (25, 0.015),
            (26, 0.6375),
            (28, 0.14),
            (42, 0.0275),
        ],
    ),
];

/// Elements that are asked for by name.
const ELEMENT_NAMES: &[(&str, u8)] = &[
    ("carbon", 6),
    ("aluminium", 13),
    ("titanium", 22),
    ("iron", 26),
    ("copper", 29),
    ("selenium", 34),
    ("molybdenum", 42),
    ("silver", 47),
    ("tin", 50),
    ("iodine", 53),
    ("gadolinium", 64),
    ("tungsten", 74),
    ("gold", 79),
    ("lead", 82),
];

/// Names of mixtures and elements; symbols are accepted besides.
pub(crate) fn names() -> impl Iterator<Item = &'static str> {
    MIXTURES
        .iter()
        .map(|entry| entry.name)
        .chain(ELEMENT_NAMES.iter().map(|&(name, _)| name))
}

/// Material of a name or an element symbol, in any case.
pub(crate) fn find(name: &str) -> Option<Material> {
    if let Some(entry) = MIXTURES
        .iter()
        .find(|entry| entry.name.eq_ignore_ascii_case(name))
    {
        return Material::from_composition(entry.name, entry.density_g_cm3, entry.mass_fractions)
            .ok();
    }
    let element = ELEMENT_NAMES
        .iter()
        .find(|(element, _)| element.eq_ignore_ascii_case(name));
    let z = element.map(|&(_, z)| z).or_else(|| atomic_number(name))?;
    let name = element.map_or_else(|| symbol(z), |&(name, _)| Some(name))?;
    Material::from_composition(name, density_g_cm3(z)?, &[(z, 1.0)]).ok()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_name_gives_a_material_of_that_name() {
        for name in names() {
            assert_eq!(
                find(name)
                    .map(|material| material.name().to_owned())
                    .as_deref(),
                Some(name)
            );
        }
    }
}
