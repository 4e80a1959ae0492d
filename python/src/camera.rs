//! `ppa.Camera`: a depth camera in the room.

use std::path::PathBuf;

use nalgebra::Isometry3;
use ppa_dataset::layout::View;
use ppa_depth::{Camera, CameraSpec, DepthMode, Sensor, SensorSpec, isometry_from_rows};
use ppa_generate::{PlacedCamera, SceneSetupError};
use pyo3::prelude::*;
use pyo3::types::PyDict;

use crate::arrays::matrix;
use crate::errors::OrRaise;
use crate::scene::Scene;
use crate::values::{from_table, plain, table};

/// A depth camera and its pose in the room.
///
/// Parameters
/// ----------
/// room_from_camera : array_like, shape (4, 4)
///     Rigid transform from the camera frame (x right, y down, z forward) to the room, mm.
/// lens : dict or path, optional
///     Keys of a camera JSON, or a calibration file: Azure Kinect, Orbbec, OpenCV YAML, or a camera JSON. By default, an Azure
///     Kinect in its narrow unbinned mode.
#[pyclass(frozen, module = "ppa", name = "Camera")]
#[derive(Clone)]
pub struct PyCamera {
    camera: Camera,
    camera_from_room: Isometry3<f64>,
}

#[pymethods]
impl PyCamera {
    #[new]
    #[pyo3(signature = (room_from_camera, lens=None))]
    fn new(room_from_camera: &Bound<'_, PyAny>, lens: Option<&Bound<'_, PyAny>>) -> PyResult<Self> {
        let mode = DepthMode::NfovUnbinned;
        let spec = match lens {
            None => CameraSpec::azure_kinect(mode),
            Some(lens) => match lens.cast::<PyDict>() {
                Ok(keys) => from_table(table(keys, "lens")?, "lens")?,
                Err(_) => CameraSpec::import(&lens.extract::<PathBuf>()?, mode).or_raise()?,
            },
        };
        let rows = matrix(room_from_camera, "room_from_camera")?;
        Ok(Self {
            camera: Camera::try_from(spec).or_raise()?,
            camera_from_room: isometry_from_rows(&rows).or_raise()?.inverse(),
        })
    }

    /// dict: the keys of the camera JSON.
    #[getter]
    fn lens<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        plain(py, self.camera.spec())
    }
}

impl PyCamera {
    /// The camera in a scene, with the furniture that it sees.
    pub fn placed(
        self,
        scene: &Scene,
        sensor: Option<SensorSpec>,
    ) -> Result<PlacedCamera, SceneSetupError> {
        let sensor = sensor.map(|spec| Sensor::new(spec, scene.plan.seed));
        Ok(PlacedCamera::new(
            View::Left,
            self.camera,
            self.camera_from_room,
            &scene.table.furniture()?,
            sensor.transpose()?,
        ))
    }
}
