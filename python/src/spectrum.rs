//! `ppa.Spectrum`: energy spectrum of the photons.

use std::sync::Arc;

use numpy::PyArray1;
use ppa_xray::{Spectrum, TubeSpec};
use pyo3::prelude::*;

use crate::arrays::numbers;
use crate::errors::OrRaise;

/// Spectrum of a tungsten tube with filters.
///
/// Parameters
/// ----------
/// kvp : float
///     Tube voltage, kV.
/// filters : sequence of str
///     Filters as "MATERIAL:mm"; by default 2.5 mm of aluminium.
/// anode_angle_deg : float
///     Angle of the anode, degrees.
#[pyclass(frozen, module = "ppa", name = "Spectrum")]
pub struct PySpectrum {
    pub spectrum: Arc<Spectrum>,
}

#[pymethods]
impl PySpectrum {
    #[new]
    #[pyo3(signature = (kvp=60.0, filters=vec!["Al:2.5".to_owned()], anode_angle_deg=12.0))]
    fn new(kvp: f64, filters: Vec<String>, anode_angle_deg: f64) -> PyResult<Self> {
        let filters = filters.iter().map(|filter| filter.parse());
        let filters = filters.collect::<Result<Vec<_>, _>>().or_raise()?;
        let tube = TubeSpec::new(kvp, anode_angle_deg, filters);
        Self::of(Spectrum::tungsten(&tube).or_raise()?)
    }

    /// Create the spectrum of photons with a single energy.
    ///
    /// Parameters
    /// ----------
    /// energy_kev : float
    ///     Energy of all photons, keV.
    #[staticmethod]
    fn monoenergetic(energy_kev: f64) -> PyResult<Self> {
        Self::of(Spectrum::monoenergetic(energy_kev).or_raise()?)
    }

    /// Create a spectrum from energy bins.
    ///
    /// Parameters
    /// ----------
    /// edges_kev : array_like, shape (n + 1,)
    ///     Edges of the bins, ascending, keV.
    /// weights : array_like, shape (n,)
    ///     Photons in each bin, in arbitrary units.
    #[staticmethod]
    fn from_bins(edges_kev: &Bound<'_, PyAny>, weights: &Bound<'_, PyAny>) -> PyResult<Self> {
        let edges = numbers(edges_kev, "edges_kev", &[0])?;
        let weights = numbers(weights, "weights", &[0])?;
        Self::of(Spectrum::from_bins(&edges, &weights).or_raise()?)
    }

    /// numpy.ndarray, shape (n + 1,): edges of the bins, keV.
    #[getter]
    fn edges_kev<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<f64>> {
        PyArray1::from_slice(py, self.spectrum.edges_kev())
    }

    /// numpy.ndarray, shape (n,): fraction of the photons in each bin.
    #[getter]
    fn weights<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<f64>> {
        PyArray1::from_vec(py, self.spectrum.bins().map(|(_, weight)| weight).collect())
    }

    /// Mean energy of the photons, keV.
    #[getter]
    fn mean_energy_kev(&self) -> f64 {
        self.spectrum.mean_energy_kev()
    }

    /// First half-value layer, mm Al.
    #[getter]
    fn hvl1_mm_al(&self) -> f64 {
        self.spectrum.hvl1_mm_al()
    }

    /// Second half-value layer, mm Al.
    #[getter]
    fn hvl2_mm_al(&self) -> f64 {
        self.spectrum.hvl2_mm_al()
    }

    /// Photons per mAs and cm² at 1 m; None unless the spectrum is that of a tube.
    #[getter]
    fn fluence_per_mas_cm2_at_1m(&self) -> Option<f64> {
        self.spectrum.fluence_per_mas_cm2_at_1m()
    }

    /// Air kerma in µGy per mAs at 1 m; None unless the spectrum is that of a tube.
    #[getter]
    fn kerma_ugy_per_mas_at_1m(&self) -> Option<f64> {
        self.spectrum.kerma_ugy_per_mas_at_1m()
    }

    fn __repr__(&self) -> String {
        let (mean, most) = (self.mean_energy_kev(), self.spectrum.max_energy_kev());
        format!("<ppa.Spectrum up to {most:.1} keV, mean {mean:.2} keV>")
    }
}

impl PySpectrum {
    fn of(spectrum: Spectrum) -> PyResult<Self> {
        Ok(Self {
            spectrum: Arc::new(spectrum),
        })
    }
}
