//! A homogeneous converter layer.

use crate::matter::material::Material;

/// A homogeneous layer.
pub(crate) struct Layer {
    pub material: Material,
    pub g_cm2: f64,
}

/// Optical thickness of the layer at one energy, normal incidence.
pub(crate) struct Thickness {
    pub photoelectric: f64,
    pub compton: f64,
}

impl Layer {
    /// A layer of a material of the library; `solid_um` is its thickness without gaps, µm.
    pub fn new(material: &str, solid_um: f64) -> Self {
        let material = Material::named(material).expect("in the library");
        Self {
            g_cm2: 1e-4 * material.density_g_cm3() * solid_um,
            material,
        }
    }

    pub fn thickness(&self, energy_kev: f64) -> Thickness {
        let sections = self.material.cross_sections_unchecked(energy_kev);
        Thickness {
            photoelectric: sections.photoelectric * self.g_cm2,
            compton: sections.compton * self.g_cm2,
        }
    }
}

impl Thickness {
    pub fn total(&self) -> f64 {
        self.photoelectric + self.compton
    }
}
