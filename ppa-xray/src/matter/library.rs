//! Named materials: [`MIXTURES`] of tissues, plastics, alloys and compounds; elements by symbol or by the names in
//! [`ELEMENT_NAMES`].

use crate::{
    matter::element::{atomic_number, density_g_cm3, symbol},
    matter::material::Material,
    matter::molecular_form_factors::Measured,
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

/// Names, densities in g/cm³ and mass fractions by atomic number.
#[rustfmt::skip]
const NIST_LIST: &[Entry] = &[
    entry("water", 1.0, &[(1, 0.111894), (8, 0.888106)]),
    entry("air", 0.001205, &[(6, 0.000124), (7, 0.755267), (8, 0.231781), (18, 0.012827)]),
    entry("soft_tissue", 1.0, &[
        (1, 0.104472), (6, 0.23219), (7, 0.02488), (8, 0.630238), (11, 0.00113), (12, 0.00013), (15, 0.00133),
        (16, 0.00199), (17, 0.00134), (19, 0.00199), (20, 0.00023), (26, 5e-05), (30, 3e-05),
    ]),
    entry("soft_tissue_icru4", 1.0, &[(1, 0.101172), (6, 0.111), (7, 0.026), (8, 0.761828)]),
    entry("muscle", 1.04, &[
        (1, 0.100637), (6, 0.10783), (7, 0.02768), (8, 0.754773), (11, 0.00075), (12, 0.00019), (15, 0.0018),
        (16, 0.00241), (17, 0.00079), (19, 0.00302), (20, 3e-05), (26, 4e-05), (30, 5e-05),
    ]),
    entry("adipose", 0.92, &[
        (1, 0.119477), (6, 0.63724), (7, 0.00797), (8, 0.232333), (11, 0.0005), (12, 2e-05), (15, 0.00016),
        (16, 0.00073), (17, 0.00119), (19, 0.00032), (20, 2e-05), (26, 2e-05), (30, 2e-05),
    ]),
    entry("skin", 1.1, &[
        (1, 0.100588), (6, 0.22825), (7, 0.04642), (8, 0.619002), (11, 7e-05), (12, 6e-05), (15, 0.00033),
        (16, 0.00159), (17, 0.00267), (19, 0.00085), (20, 0.00015), (26, 1e-05), (30, 1e-05),
    ]),
    entry("blood", 1.06, &[
        (1, 0.101866), (6, 0.10002), (7, 0.02964), (8, 0.759414), (11, 0.00185), (12, 4e-05), (14, 3e-05),
        (15, 0.00035), (16, 0.00185), (17, 0.00278), (19, 0.00163), (20, 6e-05), (26, 0.00046), (30, 1e-05),
    ]),
    entry("brain", 1.03, &[
        (1, 0.110667), (6, 0.12542), (7, 0.01328), (8, 0.737723), (11, 0.00184), (12, 0.00015), (15, 0.00354),
        (16, 0.00177), (17, 0.00236), (19, 0.0031), (20, 9e-05), (26, 5e-05), (30, 1e-05),
    ]),
    entry("lung", 1.05, &[
        (1, 0.101278), (6, 0.10231), (7, 0.02865), (8, 0.757072), (11, 0.00184), (12, 0.00073), (15, 0.0008),
        (16, 0.00225), (17, 0.00266), (19, 0.00194), (20, 9e-05), (26, 0.00037), (30, 1e-05),
    ]),
    entry("bone_cortical", 1.85, &[
        (1, 0.047234), (6, 0.14433), (7, 0.04199), (8, 0.446096), (12, 0.0022), (15, 0.10497), (16, 0.00315),
        (20, 0.20993), (30, 0.0001),
    ]),
    entry("bone_compact", 1.85, &[
        (1, 0.063984), (6, 0.278), (7, 0.027), (8, 0.410016), (12, 0.002), (15, 0.07), (16, 0.002), (20, 0.147),
    ]),
    entry("pmma", 1.19, &[(1, 0.080538), (6, 0.599848), (8, 0.319614)]),
    entry("polyethylene", 0.94, &[(1, 0.143711), (6, 0.856289)]),
    entry("polystyrene", 1.06, &[(1, 0.077418), (6, 0.922582)]),
    entry("nylon", 1.14, &[(1, 0.097976), (6, 0.636856), (7, 0.123779), (8, 0.141389)]),
    entry("a150", 1.127, &[(1, 0.101327), (6, 0.775501), (7, 0.035057), (8, 0.052316), (9, 0.017422), (20, 0.018378)]),
    entry("glass", 2.4, &[(8, 0.4598), (11, 0.096441), (14, 0.336553), (20, 0.107205)]),
    entry("csi", 4.51, &[(53, 0.488451), (55, 0.511549)]),
    entry("gos", 7.44, &[(8, 0.084528), (16, 0.08469), (64, 0.830782)]),
    entry("eye_lens", 1.1, &[(1, 0.099269), (6, 0.19371), (7, 0.05327), (8, 0.653751)]),
    entry("muscle_striated", 1.04, &[
        (1, 0.101997), (6, 0.123), (7, 0.035), (8, 0.729003), (11, 0.0008), (12, 0.0002), (15, 0.002), (16, 0.005),
        (19, 0.003),
    ]),
    entry("testes", 1.04, &[
        (1, 0.104166), (6, 0.09227), (7, 0.01994), (8, 0.773884), (11, 0.00226), (12, 0.00011), (15, 0.00125),
        (16, 0.00146), (17, 0.00244), (19, 0.00208), (20, 0.0001), (26, 2e-05), (30, 2e-05),
    ]),
    entry("b100", 1.45, &[(1, 0.065471), (6, 0.536945), (7, 0.0215), (8, 0.032085), (9, 0.167411), (20, 0.176589)]),
    entry("polypropylene", 0.9, &[(1, 0.143711), (6, 0.856289)]),
    entry("polycarbonate", 1.2, &[(1, 0.055491), (6, 0.755751), (8, 0.188758)]),
    entry("mylar", 1.4, &[(1, 0.041959), (6, 0.625017), (8, 0.333025)]),
    entry("kapton", 1.42, &[(1, 0.026362), (6, 0.691133), (7, 0.07327), (8, 0.209235)]),
    entry("ptfe", 2.2, &[(6, 0.240183), (9, 0.759817)]),
    entry("lead_glass", 6.22, &[(8, 0.156453), (14, 0.080866), (22, 0.008092), (33, 0.002651), (82, 0.751938)]),
    entry("barium_sulfate", 4.5, &[(8, 0.274212), (16, 0.137368), (56, 0.58842)]),
    entry("nai", 3.667, &[(11, 0.153373), (53, 0.846627)]),
    entry("cdte", 6.2, &[(48, 0.468355), (52, 0.531645)]),
    entry("cawo4", 6.062, &[(8, 0.22227), (20, 0.139202), (74, 0.638529)]),
    entry("alumina", 3.97, &[(8, 0.470749), (13, 0.529251)]),
];

#[rustfmt::skip]
const ICRU_44: &[Entry] = &[
    entry("adipose_icru44", 0.95, &[
        (1, 0.114), (6, 0.598), (7, 0.007), (8, 0.278), (11, 0.001), (16, 0.001), (17, 0.001),
    ]),
    entry("blood_icru44", 1.06, &[
        (1, 0.102), (6, 0.110), (7, 0.033), (8, 0.745), (11, 0.001), (15, 0.001), (16, 0.002), (17, 0.003),
        (19, 0.002), (26, 0.001),
    ]),
    entry("bone_cortical_icru44", 1.92, &[
        (1, 0.034), (6, 0.155), (7, 0.042), (8, 0.435), (11, 0.001), (12, 0.002), (15, 0.103), (16, 0.003),
        (20, 0.225),
    ]),
    entry("brain_icru44", 1.04, &[
        (1, 0.107), (6, 0.145), (7, 0.022), (8, 0.712), (11, 0.002), (15, 0.004), (16, 0.002), (17, 0.003),
        (19, 0.003),
    ]),
    entry("breast_icru44", 1.02, &[
        (1, 0.106), (6, 0.332), (7, 0.030), (8, 0.527), (11, 0.001), (15, 0.001), (16, 0.002), (17, 0.001),
    ]),
    entry("lung_icru44", 1.05, &[
        (1, 0.103), (6, 0.105), (7, 0.031), (8, 0.749), (11, 0.002), (15, 0.002), (16, 0.003), (17, 0.003),
        (19, 0.002),
    ]),
    entry("muscle_icru44", 1.05, &[
        (1, 0.102), (6, 0.143), (7, 0.034), (8, 0.710), (11, 0.001), (15, 0.002), (16, 0.003), (17, 0.001),
        (19, 0.004),
    ]),
    entry("skin_icru44", 1.09, &[
        (1, 0.100), (6, 0.204), (7, 0.042), (8, 0.645), (11, 0.002), (15, 0.001), (16, 0.002), (17, 0.003),
        (19, 0.001),
    ]),
    entry("soft_tissue_icru44", 1.06, &[
        (1, 0.102), (6, 0.143), (7, 0.034), (8, 0.708), (11, 0.002), (15, 0.003), (16, 0.003), (17, 0.002),
        (19, 0.003),
    ]),
];

#[rustfmt::skip]
const ICRU_46: &[Entry] = &[
    entry("cartilage", 1.10, &[
        (1, 0.096), (6, 0.099), (7, 0.022), (8, 0.744), (11, 0.005), (15, 0.022), (16, 0.009), (17, 0.003),
    ]),
    entry("marrow_red", 1.03, &[
        (1, 0.105), (6, 0.414), (7, 0.034), (8, 0.439), (15, 0.001), (16, 0.002), (17, 0.002), (19, 0.002),
        (26, 0.001),
    ]),
    entry("marrow_yellow", 0.98, &[
        (1, 0.115), (6, 0.644), (7, 0.007), (8, 0.231), (11, 0.001), (16, 0.001), (17, 0.001),
    ]),
    entry("spongiosa", 1.18, &[
        (1, 0.085), (6, 0.404), (7, 0.028), (8, 0.367), (11, 0.001), (12, 0.001), (15, 0.034), (16, 0.002),
        (17, 0.002), (19, 0.001), (20, 0.074), (26, 0.001),
    ]),
];

#[rustfmt::skip]
const IMPLANTS: &[Entry] = &[
    // (C2H4)n, used in bearings, ASTM F648.
    entry("uhmwpe", 0.935, &[(1, 0.143711), (6, 0.856289)]),
    // Ca10(PO4)6(OH)2.
    entry("hydroxyapatite", 3.16, &[(1, 0.002007), (8, 0.414068), (15, 0.184987), (20, 0.398938)]),
    // Ti-6Al-4V, ASTM F136.
    entry("ti6al4v", 4.43, &[(13, 0.06), (22, 0.90), (23, 0.04)]),
    // Co-28Cr-6Mo, ASTM F75.
    entry("cocr", 8.3, &[(24, 0.28), (27, 0.65), (28, 0.005), (42, 0.065)]),
    // Stainless steel 316L, ASTM F138.
    entry("steel_316l", 7.95, &[(24, 0.18), (25, 0.015), (26, 0.6375), (28, 0.14), (42, 0.0275)]),
    // Yttria-stabilised zirconia of femoral heads, ISO 13356, as ZrO2.
    entry("zirconia", 6.05, &[(8, 0.259698), (40, 0.740302)]),
];

#[rustfmt::skip]
const EQUIPMENT: &[Entry] = &[
    // Carbon fibres in epoxy resin, 68 % fibres by mass (60 % by volume), the resin as C21H24O4.
    entry("carbon_fibre", 1.58, &[(1, 0.0228), (6, 0.9171), (8, 0.0601)]),
    // Cellulose, C6H10O5, with the low density of a grid interspace.
    entry("paper", 0.8, &[(1, 0.062284), (6, 0.444376), (8, 0.49334)]),
    // Amorphous; the crystal has 4.8 g/cm³ (Kasap et al. 2009, doi:10.1002/pssb.200982007).
    entry("a_selenium", 4.28, &[(34, 1.0)]),
];

/// Mixtures, grouped by the source of their composition.
const MIXTURES: &[(&str, &[Entry])] = &[
    (
        "NIST compound list, with its ICRP and ICRU tissues, as in xraylib 4.3.0",
        NIST_LIST,
    ),
    ("ICRU Report 44, as in table 2 of NISTIR 5632", ICRU_44),
    ("ICRU Report 46, adult", ICRU_46),
    (
        "stoichiometry, or the middle of the range of the standard for the implant material",
        IMPLANTS,
    ),
    ("stoichiometry of the usual make", EQUIPMENT),
];

/// Materials with measured form factors: substances and their shares of the mass.
///
/// Soft tissue (ICRP) and red marrow (ICRU 46) are muscle and fat in the ratio that gives their carbon. Bone, skin, brain and lung
/// have no measurement.
const MEASURED: &[(&str, &[(Measured, f64)])] = &[
    ("water", &[(Measured::Water, 1.0)]),
    ("muscle", &[(Measured::Muscle, 1.0)]),
    ("muscle_icru44", &[(Measured::Muscle, 1.0)]),
    ("muscle_striated", &[(Measured::Muscle, 1.0)]),
    ("soft_tissue_icru4", &[(Measured::Muscle, 1.0)]),
    ("soft_tissue_icru44", &[(Measured::Muscle, 1.0)]),
    (
        "soft_tissue",
        &[(Measured::Muscle, 0.765), (Measured::Fat, 0.235)],
    ),
    (
        "marrow_red",
        &[(Measured::Muscle, 0.42), (Measured::Fat, 0.58)],
    ),
    ("marrow_yellow", &[(Measured::Fat, 1.0)]),
    ("adipose", &[(Measured::Fat, 1.0)]),
    ("adipose_icru44", &[(Measured::Fat, 1.0)]),
    ("blood", &[(Measured::Blood, 1.0)]),
    ("blood_icru44", &[(Measured::Blood, 1.0)]),
    ("breast_icru44", &[(Measured::Breast, 1.0)]),
    ("pmma", &[(Measured::Pmma, 1.0)]),
];

/// Source of the data of pure elements.
const ELEMENT_SOURCE: &str = "element, density as in xraylib 4.3.0";

/// Elements with a name in addition to the symbol.
const ELEMENT_NAMES: &[(&str, u8)] = &[
    ("beryllium", 4),
    ("carbon", 6),
    ("aluminium", 13),
    ("titanium", 22),
    ("iron", 26),
    ("copper", 29),
    ("selenium", 34),
    ("zirconium", 40),
    ("niobium", 41),
    ("molybdenum", 42),
    ("rhodium", 45),
    ("silver", 47),
    ("tin", 50),
    ("iodine", 53),
    ("gadolinium", 64),
    ("tantalum", 73),
    ("tungsten", 74),
    ("gold", 79),
    ("lead", 82),
];

fn mixtures() -> impl Iterator<Item = (&'static str, &'static Entry)> {
    MIXTURES
        .iter()
        .flat_map(|&(source, entries)| entries.iter().map(move |entry| (source, entry)))
}

/// Names of mixtures and elements and the source of their composition; symbols are also accepted.
pub(crate) fn names_and_sources() -> impl Iterator<Item = (&'static str, &'static str)> {
    let elements = ELEMENT_NAMES
        .iter()
        .map(|&(name, _)| (name, ELEMENT_SOURCE));
    mixtures()
        .map(|(source, entry)| (entry.name, source))
        .chain(elements)
}

/// Returns the material with a name or an element symbol, case-insensitive.
pub(crate) fn find(name: &str) -> Option<Material> {
    if let Some((_, entry)) = mixtures().find(|(_, entry)| entry.name.eq_ignore_ascii_case(name)) {
        let material =
            Material::from_composition(entry.name, entry.density_g_cm3, entry.mass_fractions);
        let measured = MEASURED.iter().find(|(name, _)| *name == entry.name);
        let shares = measured.map_or(&[][..], |(_, shares)| shares);
        return Some(material.ok()?.measured_as(shares));
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
        let mut seen = std::collections::HashSet::new();
        for (name, source) in names_and_sources() {
            assert!(seen.insert(name), "{name} stands twice");
            assert!(!source.is_empty());
            assert_eq!(
                find(name)
                    .map(|material| material.name().to_owned())
                    .as_deref(),
                Some(name)
            );
        }
    }

    #[test]
    fn elements_without_a_measured_density_need_one() {
        for (symbol, z) in [("At", 85), ("Fr", 87)] {
            assert!(find(symbol).is_none(), "{symbol}");
            assert!(Material::from_composition(symbol, 5.0, &[(z, 1.0)]).is_ok());
        }
    }

    /// The compositions of a tissue in two reports differ by a few percent where it matters.
    #[test]
    fn tissues_of_different_reports_are_alike() {
        for (name, other) in [
            ("adipose", "adipose_icru44"),
            ("blood", "blood_icru44"),
            ("brain", "brain_icru44"),
            ("muscle", "muscle_icru44"),
            ("muscle", "muscle_striated"),
            ("bone_cortical", "bone_cortical_icru44"),
            ("soft_tissue", "soft_tissue_icru44"),
            ("polyethylene", "uhmwpe"),
        ] {
            let [a, b] = [name, other].map(|name| find(name).unwrap().total_cm2_g(40.0).unwrap());
            assert!((a / b - 1.0).abs() < 0.07, "{name} {a}, {other} {b}");
        }
    }
}
