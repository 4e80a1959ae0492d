//! `ppa.Pose`: a limb on the table, and its images.

use std::sync::Arc;

use numpy::PyArray2;
use ppa_dataset::layout::View;
use ppa_depth::SensorSpec;
use ppa_generate::{Frames, PlacedCamera, PoseError, SceneSetupError, VisibleLimb};
use ppa_label::{Exposure as LabelExposure, PoseLabel};
use ppa_scene::{Placement, ct_from_device};
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;
use pyo3::types::PyDict;

use crate::arguments::{threads_of, whole};
use crate::arrays::of_rows;
use crate::background::run;
use crate::camera::PyCamera;
use crate::depth_image::PyDepthImage;
use crate::errors::OrRaise;
use crate::exposure::{ExposeError, Exposure, fast};
use crate::label::scale_of;
use crate::plan::xray_settings;
use crate::posable_case::{LabelError, PosableCase};
use crate::progress::observer;
use crate::radiograph::{Made, PyRadiograph};
use crate::scene::{Scene, frames};
use crate::values::{plain, table};
use crate::volume::rows;

/// A limb on the table, rotated medially by an angle. Created by :meth:`Case.place`.
#[pyclass(frozen, module = "ppa", name = "Pose")]
pub struct PyPose {
    limb: Arc<PosableCase>,
    scene: Arc<Scene>,
    angle_deg: f64,
    placement: Placement,
}

/// Why a depth image cannot be made.
#[derive(Debug, thiserror::Error)]
enum SightError {
    #[error(transparent)]
    Scene(#[from] SceneSetupError),
    #[error(transparent)]
    Pose(#[from] PoseError),
}

/// A sensor: the default one by name, or its keys.
fn sensor_of(sensor: &Bound<'_, PyAny>) -> PyResult<SensorSpec> {
    if let Ok(keys) = sensor.cast::<PyDict>() {
        return crate::values::from_table(table(keys, "sensor")?, "sensor");
    }
    match sensor.extract::<&str>() {
        Ok("default") => Ok(SensorSpec::default()),
        _ => Err(PyValueError::new_err(
            "sensor is neither \"default\" nor a dictionary with the keys of a sensor",
        )),
    }
}

/// The camera of an image.
enum Chosen {
    OfScene(View),
    Own(Box<PyCamera>),
}

impl PyPose {
    pub fn new(
        py: Python<'_>,
        limb: Arc<PosableCase>,
        angle_deg: f64,
        scene: Option<Arc<Scene>>,
        threads: Option<usize>,
    ) -> PyResult<Self> {
        let prepared = limb.prepared.clone();
        let (scene, placement) = run(py, threads, None, move |_| {
            let scene = match scene {
                Some(scene) => scene,
                None => Scene::built_in()?,
            };
            let (skin, landmarks) = (&prepared.limb.mesh, &prepared.landmarks);
            let (angle_rad, settings) = (angle_deg.to_radians(), scene.plan.place_settings());
            let placement = scene.table.place(skin, landmarks, angle_rad, &settings);
            Ok::<_, SightError>((scene.clone(), placement.map_err(PoseError::from)?))
        })?
        .or_raise()?;
        Ok(Self {
            limb,
            scene,
            angle_deg,
            placement,
        })
    }
}

#[pymethods]
impl PyPose {
    /// Medial rotation, degrees.
    #[getter]
    fn angle_deg(&self) -> f64 {
        self.angle_deg
    }

    /// numpy.ndarray, shape (4, 4): transform from the patient frame to the room, T^ToF_P, mm.
    #[getter]
    fn room_from_patient<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray2<f64>> {
        rows(py, self.placement.room_from_patient.to_homogeneous_rows())
    }

    /// numpy.ndarray, shape (4, 4): transform from the scan to the room, mm.
    #[getter]
    fn room_from_ct<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray2<f64>> {
        let landmarks = &self.limb.prepared.landmarks;
        let motion = self.placement.room_from_patient * landmarks.patient_from_ct();
        rows(py, motion.to_homogeneous_rows())
    }

    /// dict of numpy.ndarray, shape (4, 4): rigid transforms by name, ``target_from_source``, between scan, patient, room, device and
    /// cameras, mm.
    #[getter]
    fn frames<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        let rig = self.scene.plan.depth.cameras().or_raise()?;
        let of_room = Frames::of_room(&self.scene.table, &rig).or_raise()?;
        let landmarks = &self.limb.prepared.landmarks;
        frames(
            py,
            &of_room.with_limb(&self.placement, landmarks, &self.scene.table),
        )
    }

    /// Distance from the x-ray source to the detector, mm.
    #[getter]
    fn source_detector_mm(&self) -> f64 {
        self.scene.table.room.device.source_detector_mm
    }

    /// dict: how the limb rests on the table, e.g. ``gap_mm``, ``penetration_mm`` and ``tilt_rad``.
    #[getter]
    fn contact<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        plain(py, &self.placement.contact)
    }

    /// numpy.ndarray, shape (n, 3), float32: vertices of the skin in the room, mm; flattened where soft tissue is compressed.
    #[getter]
    fn vertices<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray2<f32>>> {
        let prepared = &self.limb.prepared;
        let skin = &prepared.limb.mesh.vertices;
        let placed = self.placement.in_room(skin, &prepared.landmarks);
        of_rows(py, placed.iter().map(|p| [p.x, p.y, p.z]).collect())
    }

    /// numpy.ndarray, shape (m, 3), uint32: vertex indices of each triangle of the skin.
    #[getter]
    fn triangles<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray2<u32>>> {
        of_rows(py, self.limb.prepared.limb.mesh.triangles.clone())
    }

    /// Simulate a depth image of the limb in the room.
    ///
    /// Parameters
    /// ----------
    /// camera : {"left", "right"} or Camera
    ///     A camera of the scene, by default the left one, or another camera.
    /// sensor : "default" or dict, optional
    ///     Errors of the sensor, as in ``[depth.sensor]`` of plan.toml; by default those of the scene. A scene without sensor errors
    ///     gives ideal images.
    /// seed : int
    ///     Seed of the sensor's noise.
    /// threads : int, optional
    ///     Worker threads; one per core by default.
    ///
    /// Returns
    /// -------
    /// DepthImage
    #[pyo3(signature = (camera=None, *, sensor=None, seed=0, threads=None))]
    fn depth(
        &self,
        py: Python<'_>,
        camera: Option<&Bound<'_, PyAny>>,
        sensor: Option<&Bound<'_, PyAny>>,
        #[pyo3(from_py_with = whole::<64, _>)] seed: u64,
        #[pyo3(from_py_with = threads_of)] threads: Option<usize>,
    ) -> PyResult<PyDepthImage> {
        let chosen = match camera {
            None => Chosen::OfScene(View::Left),
            Some(camera) => match camera.cast::<PyCamera>() {
                Ok(camera) => Chosen::Own(Box::new(camera.get().clone())),
                Err(_) => match camera.extract::<&str>() {
                    Ok("left") => Chosen::OfScene(View::Left),
                    Ok("right") => Chosen::OfScene(View::Right),
                    _ => {
                        return Err(PyValueError::new_err(
                            "camera is neither \"left\", \"right\" nor a ppa.Camera",
                        ));
                    }
                },
            },
        };
        let sensor = sensor.map(sensor_of).transpose()?;
        let (scene, limb, placement) = (self.scene.clone(), self.limb.clone(), self.placement);
        let image = run(py, threads, None, move |_| {
            let skin = VisibleLimb::new(limb.prepared.clone())?.posed(&placement, &scene.plan)?;
            let seen = match chosen {
                Chosen::OfScene(view) => {
                    let setup = scene.setup(sensor)?;
                    let of_view = |camera: &&PlacedCamera| camera.view == view;
                    let camera = setup.cameras.iter().find(of_view);
                    skin.seen_by(camera.expect("a scene has both cameras"), seed)?
                }
                Chosen::Own(camera) => {
                    let sensor = sensor.or_else(|| scene.plan.depth.sensor.clone());
                    skin.seen_by(&camera.placed(&scene, sensor)?, seed)?
                }
            };
            Ok::<_, SightError>(PyDepthImage {
                image: seen.image,
                camera: seen.camera,
                roi: seen.region,
            })
        })?;
        image.or_raise()
    }

    /// Simulate a radiograph of the limb.
    ///
    /// Parameters
    /// ----------
    /// tube : dict, optional
    ///     ``kvp``, ``filters`` and ``anode_angle_deg``.
    /// technique : {"ankle", "knee", "lower-leg", "foot", "hand", "wrist", "elbow"}, optional
    ///     Typical exposure of an examination: tube voltage and load, focal spot, collimation, CsI detector.
    /// xray : dict, optional
    ///     Keys of ``[xray]`` of plan.toml that replace those of the scene and the technique.
    /// engine : {"fast", "analog"}
    ///     Ray-traced primary with Monte Carlo scatter and added noise, or analog Monte Carlo.
    /// histories : float, optional
    ///     Photons to follow (analog; 2e7 by default unless ``target_error`` or ``seconds`` is given), or whose noise the image has
    ///     (fast; 2e10 by default, ``math.inf`` for the expected image).
    /// mas : float, optional
    ///     Fast engine: tube load in mAs, instead of ``histories``.
    /// exposure_index : float, optional
    ///     Fast engine: automatic exposure control, with the tube load that gives this exposure index.
    /// target_error : float, optional
    ///     Analog engine: stop when half of the pixels have a relative standard error below this, e.g. 0.02.
    /// seconds : float, optional
    ///     Analog engine: stop after this time.
    /// dose : bool or "map"
    ///     Analog engine: score energy imparted and air kerma; with "map", also the dose of each voxel.
    /// seed : int
    ///     Seed of histories and noise.
    /// progress : bool or callable, optional
    ///     True for a tqdm progress bar, or a function of done and total.
    /// threads : int, optional
    ///     Worker threads; one per core by default. The image does not depend on it.
    ///
    /// Returns
    /// -------
    /// Radiograph
    #[pyo3(signature = (*, tube=None, technique=None, xray=None, engine="fast", histories=None, mas=None, exposure_index=None, target_error=None, seconds=None, dose=None, seed=0, progress=None, threads=None))]
    #[expect(clippy::too_many_arguments, reason = "keywords of a Python function")]
    fn radiograph(
        &self,
        py: Python<'_>,
        tube: Option<&Bound<'_, PyDict>>,
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
        let mut settings = xray_settings(&self.scene.plan.xray, technique, xray)?;
        if let Some(tube) = tube {
            for key in tube.keys() {
                let key: String = key.extract()?;
                if !["kvp", "filters", "anode_angle_deg"].contains(&key.as_str()) {
                    return Err(PyValueError::new_err(format!(
                        "tube has the key {key:?}, expected kvp, filters or anode_angle_deg"
                    )));
                }
            }
            settings = xray_settings(&settings, None, Some(tube))?;
        }
        let exposure = Exposure::new(engine, histories, target_error, seconds, dose, seed)?;
        exposure.load(&mut settings, histories, mas, exposure_index)?;
        let (limb, scene, placement) = (self.limb.clone(), self.scene.clone(), self.placement);
        let observer = observer(py, progress)?;
        let made = run(py, threads, observer.as_ref(), move |watch| {
            let exposable = limb.exposable(&scene)?.exposed_by(settings)?;
            let exposed = exposable.placed(placement);
            let (phantom, spectrum) = (&exposable.phantom, &exposable.spectrum);
            let projection = &exposed.projection;
            let settings = exposable.settings();
            let (radiograph, dose) = match &exposure {
                Exposure::Analog(run) => run.follow(phantom, spectrum, projection, watch)?,
                Exposure::Fast { seed } => {
                    let engine = exposed.fast_settings(settings.engine.with_seed(*seed))?;
                    (fast(phantom, spectrum, projection, &engine, watch)?, None)
                }
            };
            Ok::<_, ExposeError>(Made {
                radiograph,
                dose,
                grid: Some(phantom.phantom().grid().clone()),
                receptor: projection.receptor.clone(),
                presentation: settings.presentation,
            })
        })?;
        Ok(PyRadiograph::new(made.or_raise()?))
    }

    /// Grade, from the bones of the case, how well a radiograph of the pose would show the joint space of the ankle.
    ///
    /// No reader has validated these labels.
    ///
    /// Parameters
    /// ----------
    /// scale : {"graded", "strict"}
    ///     As for :func:`label`.
    /// thresholds : dict or path of a TOML file, optional
    ///     As for :func:`label`.
    /// threads : int, optional
    ///     Worker threads; one per core by default.
    ///
    /// Returns
    /// -------
    /// dict
    ///     ``label`` from 1 (ideal) to 3 (inadequate), its ``std``, and ``gutters``, each with ``name``, ``openness`` and ``grade``.
    #[pyo3(signature = (*, scale="graded", thresholds=None, threads=None))]
    fn label<'py>(
        &self,
        py: Python<'py>,
        scale: &str,
        thresholds: Option<&Bound<'py, PyAny>>,
        #[pyo3(from_py_with = threads_of)] threads: Option<usize>,
    ) -> PyResult<Bound<'py, PyAny>> {
        let scale = scale_of(scale, thresholds)?;
        let (limb, scene, placement) = (self.limb.clone(), self.scene.clone(), self.placement);
        let label = run(py, threads, None, move |_| {
            let landmarks = &limb.prepared.landmarks;
            let device = ct_from_device(&placement, landmarks, &scene.table.room.device);
            let joint = landmarks.joint_centre.into();
            let exposure = LabelExposure::of_device(device.isometry(), joint);
            let space = limb.joint_space()?;
            Ok::<_, LabelError>(PoseLabel::new(&space, exposure, &scale)?)
        })?;
        plain(py, &label.or_raise()?)
    }

    /// Draw the limb in the room with matplotlib on ``ax`` or in a new figure, and return the axes.
    #[pyo3(signature = (ax=None))]
    fn plot<'py>(
        this: &Bound<'py, Self>,
        ax: Option<&Bound<'py, PyAny>>,
    ) -> PyResult<Bound<'py, PyAny>> {
        let plots = this.py().import("ppa._plots")?;
        plots.call_method1("pose", (this, ax))
    }

    fn __repr__(&self) -> String {
        format!("<ppa.Pose at {} degrees>", self.angle_deg)
    }
}
