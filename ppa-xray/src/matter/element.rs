//! Symbols and densities of the elements H to U.

/// Symbol and density in g/cm³ at room conditions by atomic number less one, as in xraylib 4.3.0; 0 for At and Fr, whose densities have
/// not been measured.
const ELEMENTS: [(&str, f64); 92] = [
    ("H", 8.4e-05),
    ("He", 0.000166),
    ("Li", 0.534),
    ("Be", 1.848),
    ("B", 2.37),
    ("C", 2.0),
    ("N", 0.001165),
    ("O", 0.001332),
    ("F", 0.00158),
    ("Ne", 0.000839),
    ("Na", 0.971),
    ("Mg", 1.74),
    ("Al", 2.6989),
    ("Si", 2.33),
    ("P", 2.2),
    ("S", 2.0),
    ("Cl", 0.002995),
    ("Ar", 0.001662),
    ("K", 0.862),
    ("Ca", 1.55),
    ("Sc", 2.989),
    ("Ti", 4.54),
    ("V", 6.11),
    ("Cr", 7.18),
    ("Mn", 7.44),
    ("Fe", 7.874),
    ("Co", 8.9),
    ("Ni", 8.902),
    ("Cu", 8.96),
    ("Zn", 7.133),
    ("Ga", 5.904),
    ("Ge", 5.323),
    ("As", 5.73),
    ("Se", 4.5),
    ("Br", 0.007072),
    ("Kr", 0.003478),
    ("Rb", 1.532),
    ("Sr", 2.54),
    ("Y", 4.469),
    ("Zr", 6.506),
    ("Nb", 8.57),
    ("Mo", 10.22),
    ("Tc", 11.5),
    ("Ru", 12.41),
    ("Rh", 12.41),
    ("Pd", 12.02),
    ("Ag", 10.5),
    ("Cd", 8.65),
    ("In", 7.31),
    ("Sn", 7.31),
    ("Sb", 6.691),
    ("Te", 6.24),
    ("I", 4.93),
    ("Xe", 0.005485),
    ("Cs", 1.873),
    ("Ba", 3.5),
    ("La", 6.154),
    ("Ce", 6.657),
    ("Pr", 6.71),
    ("Nd", 6.9),
    ("Pm", 7.22),
    ("Sm", 7.46),
    ("Eu", 5.243),
    ("Gd", 7.9004),
    ("Tb", 8.229),
    ("Dy", 8.55),
    ("Ho", 8.795),
    ("Er", 9.066),
    ("Tm", 9.321),
    ("Yb", 6.73),
    ("Lu", 9.84),
    ("Hf", 13.31),
    ("Ta", 16.654),
    ("W", 19.3),
    ("Re", 21.02),
    ("Os", 22.57),
    ("Ir", 22.42),
    ("Pt", 21.45),
    ("Au", 19.32),
    ("Hg", 13.546),
    ("Tl", 11.72),
    ("Pb", 11.35),
    ("Bi", 9.747),
    ("Po", 9.32),
    ("At", 0.0),
    ("Rn", 0.009066),
    ("Fr", 0.0),
    ("Ra", 5.0),
    ("Ac", 10.07),
    ("Th", 11.72),
    ("Pa", 15.37),
    ("U", 18.95),
];

/// Symbol of the element of atomic number `z`, for Z = 1 to 92.
pub(crate) fn symbol(z: u8) -> Option<&'static str> {
    Some(ELEMENTS.get(usize::from(z).checked_sub(1)?)?.0)
}

/// Atomic number of an element symbol, case-insensitive.
pub(crate) fn atomic_number(text: &str) -> Option<u8> {
    let index = ELEMENTS
        .iter()
        .position(|(symbol, _)| symbol.eq_ignore_ascii_case(text))?;
    u8::try_from(index + 1).ok()
}

/// Density of a pure element in g/cm³; `None` if it has not been measured.
pub(crate) fn density_g_cm3(z: u8) -> Option<f64> {
    let density = ELEMENTS.get(usize::from(z).checked_sub(1)?)?.1;
    (density > 0.0).then_some(density)
}
