//! `ppa.Material`: photon cross sections of materials.

use numpy::{IntoPyArray, PyArrayDyn, PyArrayMethods, PyReadonlyArrayDyn, PyUntypedArrayMethods};
use ppa_xray::{CrossSections, Material};
use pyo3::prelude::*;

use crate::arrays::required;
use crate::errors::OrRaise;

/// A material with its cross sections.
///
/// Parameters
/// ----------
/// name : str
///     One of :meth:`Material.names`.
#[pyclass(frozen, module = "ppa", name = "Material")]
pub struct PyMaterial {
    pub material: Material,
}

#[pymethods]
impl PyMaterial {
    #[new]
    fn new(name: &str) -> PyResult<Self> {
        Ok(Self {
            material: Material::named(name).or_raise()?,
        })
    }

    /// Create a material from its composition.
    ///
    /// Parameters
    /// ----------
    /// name : str
    ///     Freely chosen name.
    /// density_g_cm3 : float
    ///     Density, g/cm³.
    /// composition : str
    ///     Mass fractions by element, e.g. "Ca:0.4,C:0.12,O:0.48".
    #[staticmethod]
    fn compound(name: &str, density_g_cm3: f64, composition: &str) -> PyResult<Self> {
        let material = Material::parse_composition(name, density_g_cm3, composition);
        Ok(Self {
            material: material.or_raise()?,
        })
    }

    /// Names of the built-in materials.
    #[staticmethod]
    fn names() -> Vec<&'static str> {
        Material::names().collect()
    }

    /// Name of the material.
    #[getter]
    fn name(&self) -> &str {
        self.material.name()
    }

    /// Density, g/cm³.
    #[getter]
    fn density_g_cm3(&self) -> f64 {
        self.material.density_g_cm3()
    }

    /// Mass fractions by element.
    #[getter]
    fn composition(&self) -> String {
        self.material.composition()
    }

    /// Mass attenuation coefficient of the photoelectric effect, cm²/g.
    ///
    /// Parameters
    /// ----------
    /// energy_kev : array_like
    ///     Photon energies, keV.
    ///
    /// Returns
    /// -------
    /// numpy.ndarray of the same shape
    fn photoelectric_cm2_g<'py>(&self, energy_kev: &Bound<'py, PyAny>) -> Attenuation<'py> {
        self.at(energy_kev, |sections| sections.photoelectric)
    }

    /// Mass attenuation coefficient of Rayleigh scattering, cm²/g; see :meth:`photoelectric_cm2_g`.
    fn rayleigh_cm2_g<'py>(&self, energy_kev: &Bound<'py, PyAny>) -> Attenuation<'py> {
        self.at(energy_kev, |sections| sections.rayleigh)
    }

    /// Mass attenuation coefficient of Compton scattering, cm²/g; see :meth:`photoelectric_cm2_g`.
    fn compton_cm2_g<'py>(&self, energy_kev: &Bound<'py, PyAny>) -> Attenuation<'py> {
        self.at(energy_kev, |sections| sections.compton)
    }

    /// Total mass attenuation coefficient, cm²/g; see :meth:`photoelectric_cm2_g`.
    fn total_cm2_g<'py>(&self, energy_kev: &Bound<'py, PyAny>) -> Attenuation<'py> {
        self.at(energy_kev, |sections| sections.total())
    }

    fn __repr__(&self) -> String {
        let (name, density) = (self.name(), self.density_g_cm3());
        format!("<ppa.Material {name}, {density} g/cm³>")
    }
}

/// A cross section at each energy.
type Attenuation<'py> = PyResult<Bound<'py, PyArrayDyn<f64>>>;

impl PyMaterial {
    fn at<'py>(
        &self,
        energy_kev: &Bound<'py, PyAny>,
        part: impl Fn(&CrossSections) -> f64,
    ) -> Attenuation<'py> {
        let py = energy_kev.py();
        let energies = required(energy_kev, Some("float64"))?;
        let energies: PyReadonlyArrayDyn<'py, f64> = energies.extract()?;
        let shape = energies.shape().to_vec();
        let energies = energies.as_array();
        let sections = energies
            .iter()
            .map(|&kev| self.material.cross_sections(kev).map(|found| part(&found)));
        let sections = sections.collect::<Result<Vec<f64>, _>>().or_raise()?;
        sections.into_pyarray(py).reshape(shape)
    }
}
