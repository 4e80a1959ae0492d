//! `ppa.Radiograph`: energy imparted to the detector by category of photons, with standard errors.

use std::path::PathBuf;

use numpy::{IntoPyArray, PyArray2, PyArrayMethods};
use ppa_ct::{Grid, Volume};
use ppa_xray::{Category, Dose, Engine, Layer, Presentation, Radiograph, Receptor};
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;
use pyo3::types::PyDict;

use crate::arrays::{converted, device, given_away, view};
use crate::errors::OrRaise;
use crate::values::{from_table, plain, table};
use crate::volume::PyVolume;

/// A finished exposure.
pub struct Made {
    pub radiograph: Radiograph,
    pub dose: Option<Dose>,
    /// Voxel grid of the dose map.
    pub grid: Option<Grid>,
    pub receptor: Receptor,
    pub presentation: Presentation,
}

/// Energy imparted to the pixels of the detector, eV/cm² per history, with standard errors.
///
/// Images have the shape (rows, columns); columns run along device x, rows along device y.
#[pyclass(frozen, module = "ppa", name = "Radiograph")]
pub struct PyRadiograph {
    made: Made,
}

/// Name of an engine.
fn engine_name(engine: Engine) -> &'static str {
    match engine {
        Engine::Analog => "analog",
        _ => "fast",
    }
}

impl PyRadiograph {
    pub fn new(made: Made) -> Self {
        Self { made }
    }

    fn shape(&self) -> [usize; 2] {
        [self.made.radiograph.rows(), self.made.radiograph.columns()]
    }

    fn of_pixels<'py, T: numpy::Element>(
        &self,
        py: Python<'py>,
        values: Vec<T>,
    ) -> PyResult<Bound<'py, PyArray2<T>>> {
        values.into_pyarray(py).reshape(self.shape())
    }

    /// One plane of each layer, by name of the layer.
    #[allow(unsafe_code)]
    fn planes<'py>(
        this: &Bound<'py, Self>,
        plane: impl Fn(&Layer) -> &[f32],
    ) -> PyResult<Bound<'py, PyDict>> {
        let made = &this.get().made;
        let layers =
            Category::ALL.map(|category| (category.name(), made.radiograph.layer(category)));
        let electronic = made.radiograph.electronic.iter();
        let dict = PyDict::new(this.py());
        for (name, layer) in layers
            .into_iter()
            .chain(electronic.map(|layer| ("electronic", layer)))
        {
            let owner = this.clone().into_any();
            // SAFETY: the radiograph is neither changed nor moved within its frozen object.
            let array = unsafe { view(owner, plane(layer), this.get().shape())? };
            dict.set_item(name, array)?;
        }
        Ok(dict)
    }

    /// The presentation of a picture: that of the scene, a named one, or one given by its keys.
    fn presentation(
        &self,
        protocol: Option<&Bound<'_, PyAny>>,
        fitted: bool,
    ) -> PyResult<Presentation> {
        let fixed = match protocol {
            None => self.made.presentation,
            Some(keys) => match keys.cast::<PyDict>() {
                Ok(keys) => from_table(table(keys, "protocol")?, "protocol")?,
                Err(_) => Presentation::protocol(keys.extract()?).or_raise()?,
            },
        };
        match fitted {
            true => fixed.fitted(&self.made.radiograph).or_raise(),
            false => Ok(fixed),
        }
    }
}

#[pymethods]
impl PyRadiograph {
    /// dict of numpy.ndarray, shape (rows, columns), float32: "primary", "compton", "rayleigh" and "multiple", and "electronic"
    /// if the detector has electronic noise; eV/cm² per history. Read-only views.
    #[getter]
    fn layers<'py>(this: &Bound<'py, Self>) -> PyResult<Bound<'py, PyDict>> {
        Self::planes(this, |layer| &layer.value)
    }

    /// dict of numpy.ndarray: standard errors of :attr:`layers`. Read-only views.
    #[getter]
    fn standard_errors<'py>(this: &Bound<'py, Self>) -> PyResult<Bound<'py, PyDict>> {
        Self::planes(this, |layer| &layer.sigma)
    }

    /// numpy.ndarray, shape (rows, columns), float32: sum of all layers, eV/cm² per history.
    #[getter]
    fn total<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray2<f32>>> {
        self.of_pixels(py, self.made.radiograph.total())
    }

    /// numpy.ndarray, shape (rows, columns), float32: standard error of :attr:`total`.
    #[getter]
    fn total_error<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray2<f32>>> {
        self.of_pixels(py, self.made.radiograph.sigma())
    }

    /// numpy.ndarray, shape (rows, columns): signal with nothing in the beam, eV/cm² per history.
    #[getter]
    fn open_field<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray2<f64>>> {
        let radiograph = &self.made.radiograph;
        let pixels = 0..radiograph.detector.pixels();
        self.of_pixels(
            py,
            pixels
                .map(|pixel| radiograph.open_field_at(pixel))
                .collect(),
        )
    }

    /// dict: energy imparted to the whole detector by category, eV per history, with standard errors.
    #[getter]
    fn sums<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        plain(py, &self.made.radiograph.sums)
    }

    /// Number of histories whose noise the image has; infinite for the expected image.
    #[getter]
    fn histories(&self) -> f64 {
        self.made.radiograph.histories
    }

    /// Photons that the tube emits into the field per mAs; None if the fluence of the spectrum is unknown.
    #[getter]
    fn histories_per_mas(&self) -> Option<f64> {
        self.made.radiograph.histories_per_mas
    }

    /// Tube load whose quantum noise the image has, mAs; None if the fluence of the spectrum is unknown.
    #[getter]
    fn mas(&self) -> Option<f64> {
        self.made.radiograph.mas()
    }

    /// Exposure index of IEC 62494-1; None for the expected image or an image without signal.
    #[getter]
    fn exposure_index(&self) -> PyResult<Option<f64>> {
        self.made
            .radiograph
            .exposure_index(&self.made.receptor)
            .or_raise()
    }

    /// "fast" or "analog".
    #[getter]
    fn engine(&self) -> &'static str {
        engine_name(self.made.radiograph.engine)
    }

    /// Side of a pixel, mm.
    #[getter]
    fn pixel_mm(&self) -> f64 {
        self.made.radiograph.detector.pixel_mm
    }

    /// dict or None: energy imparted and air kerma, if they were scored. ``phantom`` and ``materials`` hold ``mass_g`` and
    /// ``ev_per_history`` with ``value`` and ``se``; air kerma is in Gy per history.
    #[getter]
    fn dose<'py>(&self, py: Python<'py>) -> PyResult<Option<Bound<'py, PyDict>>> {
        let Some(dose) = &self.made.dose else {
            return Ok(None);
        };
        let dict = PyDict::new(py);
        let materials = PyDict::new(py);
        for (name, imparted) in &dose.materials {
            materials.set_item(name, plain(py, imparted)?)?;
        }
        dict.set_item("histories", dose.histories)?;
        dict.set_item("histories_per_mas", dose.histories_per_mas)?;
        dict.set_item("phantom", plain(py, &dose.phantom)?)?;
        dict.set_item("materials", materials)?;
        dict.set_item(
            "entrance_air_kerma_gy_per_history",
            dose.entrance_air_kerma_gy_per_history,
        )?;
        dict.set_item(
            "detector_air_kerma_gy_per_history",
            plain(py, &dose.detector_air_kerma_gy_per_history)?,
        )?;
        Ok(Some(dict))
    }

    /// Volume: absorbed dose of each voxel, µGy per mAs; requires an exposure with ``dose="map"``.
    fn dose_map(&self) -> PyResult<PyVolume> {
        let (Some(dose), Some(grid)) = (&self.made.dose, &self.made.grid) else {
            return Err(PyValueError::new_err(
                "the dose of voxels was not counted: expose with dose=\"map\"",
            ));
        };
        let volume: Volume = dose.map_ugy_per_mas(grid).or_raise()?;
        Ok(PyVolume { volume, file: None })
    }

    /// numpy.ndarray, shape (rows, columns), uint16: grey values for display; 0 where nothing is in the beam.
    ///
    /// Parameters
    /// ----------
    /// protocol : str or dict, optional
    ///     Fixed window and contrast: "limb", "ankle_ap", "ankle_mortise", "ankle_lateral", or the keys of
    ///     ``[xray.presentation]``; those of the scene by default.
    /// fitted : bool
    ///     Fit the window to this image; images for comparison or training need a fixed window.
    #[pyo3(signature = (protocol=None, *, fitted=false))]
    fn picture<'py>(
        &self,
        py: Python<'py>,
        protocol: Option<&Bound<'py, PyAny>>,
        fitted: bool,
    ) -> PyResult<Bound<'py, PyArray2<u16>>> {
        let presentation = self.presentation(protocol, fitted)?;
        let grey = self.made.radiograph.present(&presentation).or_raise()?;
        self.of_pixels(py, grey)
    }

    /// Write the picture as 16-bit PNG, or all layers with standard errors as OpenEXR. An existing file is replaced.
    ///
    /// Parameters
    /// ----------
    /// path : str or os.PathLike
    ///     .png or .exr
    /// protocol, fitted
    ///     As for :meth:`picture`.
    #[pyo3(signature = (path, protocol=None, *, fitted=false))]
    fn save(
        &self,
        path: PathBuf,
        protocol: Option<&Bound<'_, PyAny>>,
        fitted: bool,
    ) -> PyResult<()> {
        let extension = path
            .extension()
            .map(|e| e.to_string_lossy().to_ascii_lowercase());
        match extension.as_deref() {
            Some("png") => {
                let presentation = self.presentation(protocol, fitted)?;
                self.made
                    .radiograph
                    .write_png(&path, &presentation)
                    .or_raise()
            }
            Some("exr") => self.made.radiograph.write_exr(&path).or_raise(),
            _ => Err(PyValueError::new_err(format!(
                "{} does not end in .png or .exr",
                path.display()
            ))),
        }
    }

    /// Draw the picture with matplotlib on ``ax`` or in a new figure, and return the axes.
    #[pyo3(signature = (ax=None))]
    fn plot<'py>(
        this: &Bound<'py, Self>,
        ax: Option<&Bound<'py, PyAny>>,
    ) -> PyResult<Bound<'py, PyAny>> {
        let plots = this.py().import("ppa._plots")?;
        plots.call_method1("radiograph", (this, ax))
    }

    fn _repr_png_<'py>(this: &Bound<'py, Self>) -> PyResult<Bound<'py, PyAny>> {
        let display = this.py().import("ppa._display")?;
        display.call_method1("radiograph", (this,))
    }

    #[pyo3(signature = (dtype=None, copy=None))]
    fn __array__<'py>(
        &self,
        py: Python<'py>,
        dtype: Option<&Bound<'py, PyAny>>,
        copy: Option<bool>,
    ) -> PyResult<Bound<'py, PyAny>> {
        converted(self.total(py)?.into_any(), dtype, copy)
    }

    #[pyo3(signature = (**options))]
    fn __dlpack__<'py>(
        this: &Bound<'py, Self>,
        options: Option<&Bound<'py, PyDict>>,
    ) -> PyResult<Bound<'py, PyAny>> {
        given_away(&this.get().total(this.py())?.into_any(), options)
    }

    fn __dlpack_device__<'py>(this: &Bound<'py, Self>) -> PyResult<Bound<'py, PyAny>> {
        device(&this.get().total(this.py())?.into_any())
    }

    fn __repr__(&self) -> String {
        let [rows, columns] = self.shape();
        let (engine, histories) = (self.engine(), self.histories());
        format!(
            "<ppa.Radiograph of {columns} x {rows} pixels, {engine}, {histories:.3e} histories>"
        )
    }
}
