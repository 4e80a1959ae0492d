//! `ppa.Transport`: radiographs of arbitrary voxels and materials.

use std::sync::Arc;

use numpy::PyArray2;
use ppa_depth::isometry_from_rows;
use ppa_generate::XraySettings;
use ppa_xray::{HuCalibration, PreparedPhantom, Projection, VoxelPhantom};
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;
use pyo3::types::PyDict;

use crate::arguments::{threads_of, whole};
use crate::arrays::{first_fastest, matrix};
use crate::background::run;
use crate::errors::OrRaise;
use crate::exposure::{ExposeError, Exposure, fast};
use crate::material::PyMaterial;
use crate::plan::xray_settings;
use crate::progress::observer;
use crate::radiograph::{Made, PyRadiograph};
use crate::spectrum::PySpectrum;
use crate::values::{from_table, table, word};
use crate::volume::{PyVolume, affine, grid};

/// Voxels with materials and densities for photon transport; vacuum outside.
///
/// Parameters
/// ----------
/// material : numpy.ndarray, shape (ni, nj, nk), uint8
///     Index of the material of voxel (i, j, k) in ``materials``.
/// density_g_cm3 : numpy.ndarray, shape (ni, nj, nk), float32
///     Mass density of each voxel, g/cm³.
/// materials : sequence of Material or str
///     At most 256 materials.
/// affine : array_like, shape (4, 4)
///     Transform from voxel indices to the ct frame, mm.
/// interpolation : {"nearest", "trilinear"}
///     Interpolation of the density between voxel centres.
#[pyclass(frozen, module = "ppa", name = "Transport")]
pub struct PyTransport {
    phantom: Arc<PreparedPhantom<'static>>,
    /// Settings with which the voxels were prepared.
    settings: XraySettings,
}

impl PyTransport {
    fn of(voxels: VoxelPhantom) -> Self {
        let settings = XraySettings::default();
        let model = settings.engine.compton_model;
        Self {
            phantom: Arc::new(PreparedPhantom::new(voxels, model)),
            settings,
        }
    }
}

#[pymethods]
impl PyTransport {
    #[new]
    #[pyo3(signature = (material, density_g_cm3, materials, affine, *, interpolation="nearest"))]
    fn new(
        material: &Bound<'_, PyAny>,
        density_g_cm3: &Bound<'_, PyAny>,
        materials: Vec<Bound<'_, PyAny>>,
        affine: &Bound<'_, PyAny>,
        interpolation: &str,
    ) -> PyResult<Self> {
        let (indices, size) = first_fastest::<u8>(material, "material", 3)?;
        let (density, of_density) = first_fastest::<f32>(density_g_cm3, "density_g_cm3", 3)?;
        if size != of_density {
            return Err(PyValueError::new_err(format!(
                "material has the shape {size:?}, density_g_cm3 {of_density:?}: expected the same shape"
            )));
        }
        let named = materials
            .iter()
            .map(|material| match material.cast::<PyMaterial>() {
                Ok(material) => Ok(material.get().material.clone()),
                Err(_) => ppa_xray::Material::named(material.extract()?).or_raise(),
            });
        let materials = named.collect::<PyResult<_>>()?;
        let voxels = VoxelPhantom::new(grid(&size, affine)?, indices, density, materials);
        let interpolation = word(interpolation, "interpolation")?;
        Ok(Self::of(
            voxels.or_raise()?.with_interpolation(interpolation),
        ))
    }

    /// Create the voxels of a CT, with materials and densities from Hounsfield units and trilinear interpolation.
    ///
    /// Parameters
    /// ----------
    /// volume : Volume
    ///     The scan.
    /// calibration : dict, optional
    ///     Conversion of HU to material and density, as in ``[xray.calibration]`` of plan.toml.
    /// mask : numpy.ndarray, shape (ni, nj, nk), bool, optional
    ///     Voxels outside it become air.
    /// threads : int, optional
    ///     Worker threads; one per core by default.
    ///
    /// Returns
    /// -------
    /// Transport
    #[staticmethod]
    #[pyo3(signature = (volume, *, calibration=None, mask=None, threads=None))]
    fn of_volume(
        py: Python<'_>,
        volume: &Bound<'_, PyVolume>,
        calibration: Option<&Bound<'_, PyDict>>,
        mask: Option<&Bound<'_, PyAny>>,
        #[pyo3(from_py_with = threads_of)] threads: Option<usize>,
    ) -> PyResult<Self> {
        let volume = volume.get().volume.clone();
        let calibration: HuCalibration = match calibration {
            Some(keys) => from_table(table(keys, "calibration")?, "calibration")?,
            None => HuCalibration::default(),
        };
        let mask = mask.map(|mask| {
            let (mask, size) = first_fastest::<bool>(mask, "mask", 3)?;
            if size != volume.grid().size() {
                return Err(PyValueError::new_err(format!(
                    "mask has the shape {size:?}, expected {:?}, that of the volume",
                    volume.grid().size()
                )));
            }
            Ok(mask)
        });
        let mask = mask.transpose()?;
        let voxels = run(py, threads, None, move |_| {
            VoxelPhantom::from_volume(&volume, &calibration, mask.as_deref())
        })?;
        Ok(Self::of(voxels.or_raise()?))
    }

    /// list of str: names of the materials; for a CT, those that occur.
    #[getter]
    fn materials(&self) -> Vec<String> {
        let materials = self.phantom.phantom().materials().iter();
        materials
            .map(|material| material.name().to_owned())
            .collect()
    }

    /// numpy.ndarray, shape (4, 4): transform from voxel indices to the ct frame, mm.
    #[getter]
    fn affine<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray2<f64>> {
        affine(py, self.phantom.phantom().grid())
    }

    /// Simulate a radiograph of the voxels.
    ///
    /// Parameters
    /// ----------
    /// ct_from_device : array_like, shape (4, 4)
    ///     Pose of the x-ray device in the ct frame, mm: source at the origin, z along the beam towards the detector.
    /// source_detector_mm : float
    ///     Distance from the source to the detector plane, mm.
    /// spectrum : Spectrum, optional
    ///     Replaces the spectrum of the settings.
    /// technique, xray, engine, histories, mas, exposure_index, target_error, seconds, dose, seed, progress, threads
    ///     As for :meth:`Pose.radiograph`; detector, source and receptor are keys of ``xray``.
    ///
    /// Returns
    /// -------
    /// Radiograph
    #[pyo3(signature = (ct_from_device, source_detector_mm, *, spectrum=None, technique=None, xray=None, engine="fast", histories=None, mas=None, exposure_index=None, target_error=None, seconds=None, dose=None, seed=0, progress=None, threads=None))]
    #[expect(clippy::too_many_arguments, reason = "keywords of a Python function")]
    fn radiograph(
        &self,
        py: Python<'_>,
        ct_from_device: &Bound<'_, PyAny>,
        source_detector_mm: f64,
        spectrum: Option<&Bound<'_, PySpectrum>>,
        technique: Option<&str>,
        xray: Option<&Bound<'_, PyDict>>,
        engine: &str,
        histories: Option<f64>,
        mas: Option<f64>,
        exposure_index: Option<f64>,
        target_error: Option<f64>,
        seconds: Option<f64>,
        dose: Option<&Bound<'_, PyAny>>,
        #[pyo3(from_py_with = whole::<64, _>)] seed: u64,
        progress: Option<&Bound<'_, PyAny>>,
        #[pyo3(from_py_with = threads_of)] threads: Option<usize>,
    ) -> PyResult<PyRadiograph> {
        let mut settings = xray_settings(&self.settings, technique, xray)?;
        if settings.marker.take().is_some() && technique.is_none() {
            return Err(PyValueError::new_err(
                "xray has the key marker, but voxels have no side that it could show",
            ));
        }
        let exposure = Exposure::new(engine, histories, target_error, seconds, dose, seed)?;
        exposure.load(&mut settings, histories, mas, exposure_index)?;
        let rows = matrix(ct_from_device, "ct_from_device")?;
        let pose = isometry_from_rows(&rows).or_raise()?;
        let projection = Projection::new(pose, source_detector_mm, settings.detector)
            .with_source(settings.source)
            .with_receptor(settings.receptor.clone());
        let spectrum = match spectrum {
            Some(spectrum) => spectrum.get().spectrum.clone(),
            None => Arc::new(ppa_generate::spectrum(&settings).or_raise()?),
        };
        let phantom = self.phantom.clone();
        let observer = observer(py, progress)?;
        let made = run(py, threads, observer.as_ref(), move |watch| {
            let (radiograph, dose) = match &exposure {
                Exposure::Analog(run) => run.follow(&phantom, &spectrum, &projection, watch)?,
                Exposure::Fast { seed } => {
                    let mut engine = settings.engine.with_seed(*seed);
                    if let Some(load) = settings.tube_load {
                        let histories = phantom.histories(load, &spectrum, &projection, &engine)?;
                        engine = engine.with_dose_histories(histories);
                    }
                    (
                        fast(&phantom, &spectrum, &projection, &engine, watch)?,
                        None,
                    )
                }
            };
            Ok::<_, ExposeError>(Made {
                radiograph,
                dose,
                grid: Some(phantom.phantom().grid().clone()),
                receptor: projection.receptor,
                presentation: settings.presentation,
            })
        })?;
        Ok(PyRadiograph::new(made.or_raise()?))
    }

    fn __repr__(&self) -> String {
        let [i, j, k] = self.phantom.phantom().grid().size();
        format!(
            "<ppa.Transport of {i} x {j} x {k} voxels of {}>",
            self.materials().join(", ")
        )
    }
}
