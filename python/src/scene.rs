//! `ppa.Scene`: the x-ray room with its table, device and cameras.

use std::path::PathBuf;
use std::sync::{Arc, Mutex, PoisonError};

use numpy::PyArray1;
use ppa_depth::SensorSpec;
use ppa_generate::{Frames, Plan, SceneSetup, SceneSetupError, Table};
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;
use pyo3::types::PyDict;

use crate::background::run;
use crate::errors::OrRaise;
use crate::plan::{PyPlan, plan_of};
use crate::volume::rows;

/// The x-ray room: table, x-ray device and cameras, with the settings of the images made in it.
///
/// Parameters
/// ----------
/// plan : Plan or path of plan.toml, optional
///     Room, cameras, soft tissue and x-ray settings; by default, the built-in room with the paper's settings.
/// room : str or os.PathLike, optional
///     Room file, instead of a plan.
#[pyclass(frozen, module = "ppa", name = "Scene")]
pub struct PyScene {
    pub scene: Arc<Scene>,
}

/// A plan with its room.
pub struct Scene {
    pub plan: Arc<Plan>,
    pub table: Arc<Table>,
    /// Cameras by sensor, the latest first.
    setups: Mutex<Vec<(Option<SensorSpec>, Arc<SceneSetup>)>>,
}

/// Number of sensors for which a scene keeps its cameras.
const SENSORS_KEPT: usize = 4;

impl Scene {
    pub fn new(plan: Arc<Plan>) -> Result<Self, SceneSetupError> {
        Ok(Self {
            table: Arc::new(Table::of_plan(&plan)?),
            plan,
            setups: Mutex::new(Vec::new()),
        })
    }

    /// The built-in room with the paper's settings, created once.
    pub fn built_in() -> Result<Arc<Self>, SceneSetupError> {
        static BUILT_IN: Mutex<Option<Arc<Scene>>> = Mutex::new(None);
        let mut kept = BUILT_IN.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some(scene) = &*kept {
            return Ok(scene.clone());
        }
        let scene = Arc::new(Self::new(Arc::new(Plan::new(Vec::new())))?);
        *kept = Some(scene.clone());
        Ok(scene)
    }

    /// The cameras with the given sensor, or that of the plan.
    pub fn setup(&self, sensor: Option<SensorSpec>) -> Result<Arc<SceneSetup>, SceneSetupError> {
        let sensor = sensor.or_else(|| self.plan.depth.sensor.clone());
        let mut setups = self.setups.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some((_, setup)) = setups.iter().find(|(of, _)| *of == sensor) {
            return Ok(setup.clone());
        }
        let mut plan = (*self.plan).clone();
        plan.depth.sensor.clone_from(&sensor);
        let setup = Arc::new(SceneSetup::of_plan(&plan)?);
        setups.insert(0, (sensor, setup.clone()));
        setups.truncate(SENSORS_KEPT);
        Ok(setup)
    }
}

#[pymethods]
impl PyScene {
    #[new]
    #[pyo3(signature = (plan=None, *, room=None))]
    fn new(
        py: Python<'_>,
        plan: Option<&Bound<'_, PyAny>>,
        room: Option<PathBuf>,
    ) -> PyResult<Self> {
        let plan = match (plan, room) {
            (Some(_), Some(_)) => {
                return Err(PyValueError::new_err(
                    "plan and room are both given: a plan already has a room",
                ));
            }
            (None, Some(room)) => Arc::new(Plan::in_room(&room).or_raise()?),
            (plan, None) => plan_of(plan)?,
        };
        let scene = run(py, None, None, move |_| Scene::new(plan))?.or_raise()?;
        Ok(Self {
            scene: Arc::new(scene),
        })
    }

    /// Plan: the settings of the scene.
    #[getter]
    fn plan(&self) -> PyPlan {
        PyPlan {
            plan: self.scene.plan.clone(),
        }
    }

    /// dict of numpy.ndarray, shape (4, 4): rigid transforms by name, ``target_from_source``, mm.
    #[getter]
    fn frames<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        let rig = self.scene.plan.depth.cameras().or_raise()?;
        frames(py, &Frames::of_room(&self.scene.table, &rig).or_raise()?)
    }

    /// numpy.ndarray, shape (4,): normal n and offset of the table plane, n · p = offset in the room frame, mm.
    #[getter]
    fn table<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<f64>> {
        let plane = &self.scene.table.plane.plane;
        let normal = plane.normal;
        PyArray1::from_slice(py, &[normal.x, normal.y, normal.z, plane.offset_mm])
    }

    /// Distance from the x-ray source to the detector, mm.
    #[getter]
    fn source_detector_mm(&self) -> f64 {
        self.scene.table.room.device.source_detector_mm
    }

    /// Draw table, x-ray source, detector and cameras with matplotlib on ``ax`` or in a new figure, and return the axes.
    #[pyo3(signature = (ax=None))]
    fn plot<'py>(
        this: &Bound<'py, Self>,
        ax: Option<&Bound<'py, PyAny>>,
    ) -> PyResult<Bound<'py, PyAny>> {
        let plots = this.py().import("ppa._plots")?;
        plots.call_method1("scene", (this, ax))
    }

    fn __repr__(&self) -> String {
        let distance = self.source_detector_mm();
        format!("<ppa.Scene with {distance} mm from the source to the detector>")
    }
}

/// Transforms by name.
pub fn frames<'py>(py: Python<'py>, frames: &Frames) -> PyResult<Bound<'py, PyDict>> {
    let dict = PyDict::new(py);
    for (name, motion) in &frames.motions {
        dict.set_item(name, rows(py, *motion))?;
    }
    Ok(dict)
}
