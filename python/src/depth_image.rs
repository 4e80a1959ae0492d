//! `ppa.DepthImage`: depth image of one camera.

use std::path::PathBuf;

use numpy::{IntoPyArray, PyArray2, PyArrayMethods};
use ppa_core::Roi;
use ppa_depth::{Camera, DepthImage};
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;
use pyo3::types::PyDict;

use crate::arrays::{converted, device, exported, of_rows, view};
use crate::errors::OrRaise;
use crate::values::plain;

/// Depth image: z in the camera frame, mm; 0 where nothing is seen.
#[pyclass(frozen, module = "ppa", name = "DepthImage")]
pub struct PyDepthImage {
    pub image: DepthImage,
    pub camera: Camera,
    /// Square around the joint; None if the joint is outside the image.
    pub roi: Option<Roi>,
}

impl PyDepthImage {
    fn shape(&self) -> [usize; 2] {
        [self.image.height as usize, self.image.width as usize]
    }
}

#[pymethods]
impl PyDepthImage {
    /// numpy.ndarray, shape (rows, columns), float32: depths in mm, 0 where nothing is seen. A read-only view.
    #[getter]
    #[allow(unsafe_code)]
    fn z_mm<'py>(this: &Bound<'py, Self>) -> PyResult<Bound<'py, PyArray2<f32>>> {
        let image = this.get();
        // SAFETY: the image is neither changed nor moved within its frozen object.
        unsafe { view(this.clone().into_any(), &image.image.z_mm, image.shape()) }
    }

    /// numpy.ndarray, shape (rows, columns), uint16: depths in whole mm, as in PNG files.
    fn to_uint16<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray2<u16>>> {
        let whole = self.image.to_u16();
        whole.z_mm.into_pyarray(py).reshape(self.shape())
    }

    /// numpy.ndarray, shape (n, 3): visible points in the camera frame, mm.
    fn points<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray2<f64>>> {
        let points = self.image.points(&self.camera).or_raise()?;
        of_rows(py, points.iter().map(|p| [p.x, p.y, p.z]).collect())
    }

    /// dict: lens of the camera, with the keys of the camera JSON.
    #[getter]
    fn lens<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        plain(py, self.camera.spec())
    }

    /// (int, int, int) or None: square around the joint that networks see: first column, first row and size in pixels, as in
    /// ``roi_depth.json``; None if the joint is outside the image.
    #[getter]
    fn roi(&self) -> Option<(u32, u32, u32)> {
        self.roi.map(|roi| (roi.x_start, roi.y_start, roi.size))
    }

    /// Write the image as 16-bit PNG in mm or OpenEXR, or its visible points as PLY. An existing file is replaced.
    ///
    /// Parameters
    /// ----------
    /// path : str or os.PathLike
    ///     .png, .exr or .ply
    fn save(&self, path: PathBuf) -> PyResult<()> {
        let extension = path
            .extension()
            .map(|e| e.to_string_lossy().to_ascii_lowercase());
        match extension.as_deref() {
            Some("png") => self.image.write_png(&path).map(drop).or_raise(),
            Some("exr") => self.image.write_exr(&path).or_raise(),
            Some("ply") => self.image.write_points(&self.camera, &path).or_raise(),
            _ => Err(PyValueError::new_err(format!(
                "{} does not end in .png, .exr or .ply",
                path.display()
            ))),
        }
    }

    /// Write the image in false colour (near red, far blue) as PNG; an existing file is replaced.
    fn save_preview(&self, path: PathBuf) -> PyResult<()> {
        self.image.write_preview(&path).or_raise()
    }

    /// Draw the image with matplotlib on ``ax`` or in a new figure, and return the axes.
    #[pyo3(signature = (ax=None))]
    fn plot<'py>(
        this: &Bound<'py, Self>,
        ax: Option<&Bound<'py, PyAny>>,
    ) -> PyResult<Bound<'py, PyAny>> {
        let plots = this.py().import("ppa._plots")?;
        plots.call_method1("depth", (this, ax))
    }

    fn _repr_png_<'py>(this: &Bound<'py, Self>) -> PyResult<Bound<'py, PyAny>> {
        let display = this.py().import("ppa._display")?;
        display.call_method1("depth", (this,))
    }

    #[pyo3(signature = (dtype=None, copy=None))]
    fn __array__<'py>(
        this: &Bound<'py, Self>,
        dtype: Option<&Bound<'py, PyAny>>,
        copy: Option<bool>,
    ) -> PyResult<Bound<'py, PyAny>> {
        converted(Self::z_mm(this)?.into_any(), dtype, copy)
    }

    #[pyo3(signature = (**options))]
    fn __dlpack__<'py>(
        this: &Bound<'py, Self>,
        options: Option<&Bound<'py, PyDict>>,
    ) -> PyResult<Bound<'py, PyAny>> {
        exported(&Self::z_mm(this)?.into_any(), options)
    }

    fn __dlpack_device__<'py>(this: &Bound<'py, Self>) -> PyResult<Bound<'py, PyAny>> {
        device(&Self::z_mm(this)?.into_any())
    }

    fn __repr__(&self) -> String {
        let (width, height) = (self.image.width, self.image.height);
        let valid = self.image.valid_pixels();
        format!("<ppa.DepthImage of {width} x {height} pixels, {valid} of them see a surface>")
    }
}
