//! `ppa.Network`: trained networks that predict the quality of a pose from depth images.

use std::path::PathBuf;
use std::sync::Arc;

use numpy::{PyReadonlyArray2, PyUntypedArrayMethods};
use ppa_core::Roi;
use ppa_learn::DeviceName;
use ppa_learn::data::Raster;
use ppa_learn::frames::{FramesError, PairPredictor};
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;

use crate::arguments::{threads_of, whole};
use crate::arrays::{required, untyped};
use crate::background::run;
use crate::depth_image::PyDepthImage;
use crate::errors::{OrRaise, PpaError};
use crate::values::plain;

/// Trained networks that predict the quality of a pose from a pair of depth images. Created by :meth:`Network.load`.
#[pyclass(frozen, module = "ppa", name = "Network")]
pub struct PyNetwork {
    predictor: Arc<PairPredictor>,
}

/// Input of a network: a depth image, mm, and a square region in it.
struct Seen {
    depths: Raster<u16>,
    region: Roi,
}

/// An image with the given square, its own square around the joint, or the whole of a square image.
fn seen(object: &Bound<'_, PyAny>, roi: Option<[u32; 3]>, name: &str) -> PyResult<Seen> {
    let depths = depths(object, name)?;
    let given = roi.map(|[x_start, y_start, size]| Roi {
        x_start,
        y_start,
        size,
    });
    let own = || object.cast::<PyDepthImage>().ok()?.get().roi;
    let (width, height) = (depths.width(), depths.height());
    let all = (width == height).then_some(Roi {
        x_start: 0,
        y_start: 0,
        size: width as u32,
    });
    match given.or_else(own).or(all) {
        Some(region) => Ok(Seen { depths, region }),
        None => Err(PyValueError::new_err(format!(
            "depth_{name} has {width} x {height} pixels: give roi_{name}, the square around the joint as (x, y, size)"
        ))),
    }
}

/// Depths of an image, mm.
fn depths(object: &Bound<'_, PyAny>, name: &str) -> PyResult<Raster<u16>> {
    let name = format!("depth_{name}");
    let (width, height, values) = match object.cast::<PyDepthImage>() {
        Ok(image) => {
            let image = image.get().image.to_u16();
            (image.width as usize, image.height as usize, image.z_mm)
        }
        Err(_) => {
            let array = untyped(object, &name)?;
            let aligned = required(object, None)?;
            let typed: PyReadonlyArray2<'_, u16> = aligned.extract().map_err(|_| {
                PyValueError::new_err(format!(
                    "{name} is an array of {} with the shape {:?}, expected uint16 (mm, 0 invalid) of rows and columns",
                    array.dtype(),
                    array.shape()
                ))
            })?;
            let (height, width) = (typed.shape()[0], typed.shape()[1]);
            (width, height, typed.as_array().iter().copied().collect())
        }
    };
    if values.is_empty() {
        return Err(PyValueError::new_err(format!("{name} has no pixels")));
    }
    Raster::new(width, height, values).or_raise()
}

#[pymethods]
impl PyNetwork {
    /// Load the networks of finished training runs.
    ///
    /// Parameters
    /// ----------
    /// left : str or os.PathLike
    ///     Folder of the finished training of the left camera's network, or of a network for either or both cameras' images.
    /// right : str or os.PathLike, optional
    ///     Folder of the finished training of the right camera's network.
    /// side : {"r", "l"}, optional
    ///     Side of the limb; required for networks trained with ``mirror = true``.
    /// confidence : str or os.PathLike, optional
    ///     File that ``ppa calibrate`` wrote for the same networks: adds intervals, and refuses images unlike the training images.
    /// device : str
    ///     Device to run the networks on.
    ///
    /// Returns
    /// -------
    /// Network
    #[staticmethod]
    #[pyo3(signature = (left, right=None, *, side=None, confidence=None, device="cpu"))]
    fn load(
        py: Python<'_>,
        left: PathBuf,
        right: Option<PathBuf>,
        side: Option<&str>,
        confidence: Option<PathBuf>,
        device: &str,
    ) -> PyResult<Self> {
        let side = side.map(crate::side::side).transpose()?;
        let device: DeviceName = device.parse().or_raise()?;
        // Each call replaces them.
        let regions = [0, 1].map(|_| Roi {
            x_start: 0,
            y_start: 0,
            size: 1,
        });
        let predictor = run(py, None, None, move |_| {
            let predictor = PairPredictor::new(&left, right.as_deref(), regions, side, device)?;
            match confidence {
                Some(file) => predictor.with_confidence(&file),
                None => Ok(predictor),
            }
        })?;
        let predictor = predictor.map_err(|error| match error {
            FramesError::Side { .. } => PpaError::new_err(format!("{error}: side=\"l\" or \"r\"")),
            other => crate::errors::raised(other),
        })?;
        Ok(Self {
            predictor: Arc::new(predictor),
        })
    }

    /// Predict the quality of a pose from a pair of depth images.
    ///
    /// Parameters
    /// ----------
    /// depth_left, depth_right : DepthImage or numpy.ndarray, shape (rows, columns), uint16
    ///     Depths in mm; 0 is invalid.
    /// roi_left, roi_right : (int, int, int), optional
    ///     Square around the joint: first column, first row and size, as in ``roi_depth.json``; by default that of the
    ///     DepthImage (:attr:`DepthImage.roi`), or the whole of a square array.
    /// threads : int, optional
    ///     Worker threads; one per core by default.
    ///
    /// Returns
    /// -------
    /// dict
    ///     ``quality`` from 1 (ideal) to 3 (inadequate); ``left`` and ``right``, unless one network uses both images; and
    ///     ``correction_deg``, ``interval`` and ``diagnostic`` if available.
    #[pyo3(signature = (depth_left, depth_right, *, roi_left=None, roi_right=None, threads=None))]
    fn predict<'py>(
        &self,
        py: Python<'py>,
        depth_left: &Bound<'py, PyAny>,
        depth_right: &Bound<'py, PyAny>,
        #[pyo3(from_py_with = whole::<32, _>)] roi_left: Option<[u32; 3]>,
        #[pyo3(from_py_with = whole::<32, _>)] roi_right: Option<[u32; 3]>,
        #[pyo3(from_py_with = threads_of)] threads: Option<usize>,
    ) -> PyResult<Bound<'py, PyAny>> {
        let left = seen(depth_left, roi_left, "left")?;
        let right = seen(depth_right, roi_right, "right")?;
        let predictor = self.predictor.with_regions([left.region, right.region]);
        let answer = run(py, threads, None, move |_| {
            predictor.predict_images([&left.depths, &right.depths])
        })?;
        plain(py, &answer.or_raise()?)
    }
}
