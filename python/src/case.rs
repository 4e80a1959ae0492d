//! `ppa.Case`: a limb of a scan with its skin, axis, joint and plane.

use std::path::PathBuf;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use nalgebra::{Point3, Vector3};
use numpy::{PyArray1, PyArray2};
use ppa_ct::read_with;
use ppa_generate::{Case, PreparedLimb, prepare_scan};
use ppa_mesh::write_mesh_file;
use ppa_scene::LandmarkOverrides;
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;

use crate::arguments::threads_of;
use crate::arrays::{of_rows, point, points};
use crate::background::run;
use crate::errors::OrRaise;
use crate::posable_case::PosableCase;
use crate::pose::PyPose;
use crate::scene::PyScene;
use crate::side::letter;
use crate::values::plain;
use crate::volume::PyVolume;

/// One limb of one CT, ready to be placed: the contents of ``case.toml`` and what is computed from them.
///
/// Created by :func:`prepare` or :meth:`Case.read`. Setting :attr:`joint`, :attr:`axis`, :attr:`anterior` or :attr:`plane` recomputes
/// the rest.
#[pyclass(frozen, module = "ppa", name = "Case")]
pub struct PyCase {
    limb: Mutex<Arc<PosableCase>>,
}

impl PyCase {
    pub fn of(limb: PosableCase) -> PyResult<Self> {
        Ok(Self {
            limb: Mutex::new(Arc::new(limb)),
        })
    }

    fn held(&self) -> MutexGuard<'_, Arc<PosableCase>> {
        self.limb.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// The current limb.
    pub fn limb(&self) -> Arc<PosableCase> {
        self.held().clone()
    }

    /// Prepares the limb again with changed choices.
    fn choose(&self, py: Python<'_>, change: impl FnOnce(&mut LandmarkOverrides)) -> PyResult<()> {
        let limb = self.limb();
        let mut choices = limb.case.choices.clone();
        change(&mut choices);
        let found = run(py, None, None, move |_| {
            let Case {
                side,
                acknowledged,
                source,
                surface,
                bones,
                ..
            } = limb.case.clone();
            let (path, reading) = (source.path.clone(), source.reading());
            let scan = limb.scan.clone();
            let (case, prepared) = prepare_scan(scan, &path, &reading, side, &surface, &choices)?;
            let case = Case {
                acknowledged,
                source,
                bones,
                ..case
            };
            Ok::<_, ppa_generate::PrepareError>(PosableCase::new(case, limb.scan.clone(), prepared))
        })?;
        *self.held() = Arc::new(found.or_raise()?);
        Ok(())
    }
}

#[pymethods]
impl PyCase {
    /// Read ``case.toml`` and extract its limb from the scan.
    ///
    /// Parameters
    /// ----------
    /// path : str or os.PathLike
    /// threads : int, optional
    ///     Worker threads; one per core by default.
    #[staticmethod]
    #[pyo3(signature = (path, *, threads=None))]
    fn read(
        py: Python<'_>,
        path: PathBuf,
        #[pyo3(from_py_with = threads_of)] threads: Option<usize>,
    ) -> PyResult<Self> {
        let case = Case::read(&path).or_raise()?;
        let limb = run(py, threads, None, move |_| {
            let scan = read_with(&case.source.path, &case.source.reading())?;
            let prepared = PreparedLimb::of_scan(scan.clone(), &case)?;
            Ok::<_, ppa_generate::PrepareError>(PosableCase::new(case, scan, prepared))
        })?;
        Self::of(limb.or_raise()?)
    }

    /// Write ``case.toml``; an existing file is replaced.
    ///
    /// Parameters
    /// ----------
    /// path : str or os.PathLike
    ///
    /// Raises
    /// ------
    /// ValueError
    ///     If the scan was not read from a file, since a case names its file.
    fn save(&self, path: PathBuf) -> PyResult<()> {
        let limb = self.limb();
        if !limb.is_of_file() {
            return Err(PyValueError::new_err(
                "the scan of this case is not in a file, and a saved case must refer to one: save the volume, then prepare the one that Volume.read returns",
            ));
        }
        limb.case.write(&path).or_raise()
    }

    /// Write the skin in the ct frame as .ply, .obj or .stl.
    fn save_skin(&self, path: PathBuf) -> PyResult<()> {
        write_mesh_file(&path, &self.limb().prepared.limb.mesh).or_raise()
    }

    /// "l" or "r".
    #[getter]
    fn side(&self) -> &'static str {
        letter(self.limb().case.side)
    }

    /// Volume: the scan.
    #[getter]
    fn volume(&self) -> PyVolume {
        PyVolume {
            volume: self.limb().prepared.volume.clone(),
            file: None,
        }
    }

    /// numpy.ndarray, shape (n, 3), float32: vertices of the skin, ct frame, mm.
    #[getter]
    fn vertices<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray2<f32>>> {
        let limb = self.limb();
        let vertices = limb.prepared.limb.mesh.vertices.iter();
        of_rows(py, vertices.map(|p| [p.x, p.y, p.z]).collect())
    }

    /// numpy.ndarray, shape (n, 3), float32: outward unit normals of the skin at its vertices.
    #[getter]
    fn normals<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray2<f32>>> {
        let limb = self.limb();
        let normals = limb.prepared.limb.mesh.normals.iter();
        of_rows(py, normals.map(|n| [n.x, n.y, n.z]).collect())
    }

    /// numpy.ndarray, shape (m, 3), uint32: vertex indices of each triangle of the skin.
    #[getter]
    fn triangles<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray2<u32>>> {
        of_rows(py, self.limb().prepared.limb.mesh.triangles.clone())
    }

    /// numpy.ndarray, shape (3,): centre of the joint, ct frame, mm. Setting it recomputes axis and plane.
    #[getter]
    fn joint<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<f64>> {
        PyArray1::from_slice(py, &self.limb().prepared.landmarks.joint_centre)
    }

    #[setter]
    fn set_joint(&self, joint: &Bound<'_, PyAny>) -> PyResult<()> {
        let centre = point(joint, "joint")?;
        self.choose(joint.py(), |choices| choices.joint_centre = Some(centre))
    }

    /// numpy.ndarray, shape (2, 3): two points of the axis, the second 100 mm proximal to the first, ct frame, mm.
    ///
    /// Setting two points of an axis recomputes joint and plane.
    #[getter]
    fn axis<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray2<f64>> {
        let limb = self.limb();
        let landmarks = &limb.prepared.landmarks;
        let first = Point3::from(landmarks.axis_point);
        let second = first + 100.0 * Vector3::from(landmarks.axis_direction);
        let points = [first.coords.into(), second.coords.into()];
        PyArray2::from_owned_array(py, numpy::ndarray::arr2::<f64, 3>(&points))
    }

    #[setter]
    fn set_axis(&self, axis: &Bound<'_, PyAny>) -> PyResult<()> {
        let axis_points = points::<2>(axis, "axis")?;
        self.choose(axis.py(), |choices| {
            choices.axis = Some(axis_points);
            (
                choices.axis_source,
                choices.joint_region,
                choices.calf_region,
            ) = (None, None, None);
        })
    }

    /// numpy.ndarray, shape (3,): direction that faces up at angle 0, ct frame. Setting it recomputes the plane.
    #[getter]
    fn anterior<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<f64>> {
        PyArray1::from_slice(py, &self.limb().prepared.landmarks.anterior)
    }

    #[setter]
    fn set_anterior(&self, anterior: &Bound<'_, PyAny>) -> PyResult<()> {
        let direction = point(anterior, "anterior")?;
        self.choose(anterior.py(), |choices| choices.anterior = Some(direction))
    }

    /// numpy.ndarray, shape (3, 3): one distal and two proximal points of the plane under the limb, ct frame, mm.
    #[getter]
    fn plane<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray2<f64>> {
        let points = self.limb().prepared.landmarks.plane_points;
        PyArray2::from_owned_array(py, numpy::ndarray::arr2(&points))
    }

    #[setter]
    fn set_plane(&self, plane: &Bound<'_, PyAny>) -> PyResult<()> {
        let plane_points = points::<3>(plane, "plane")?;
        self.choose(plane.py(), |choices| {
            choices.plane_points = Some(plane_points)
        })
    }

    /// dict: all landmarks, as in ``[found.landmarks]`` of case.toml.
    #[getter]
    fn landmarks<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        plain(py, &self.limb().prepared.landmarks)
    }

    /// list of dict: possible problems with scan and limb, severe ones first.
    #[getter]
    fn findings<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        plain(py, &self.limb().prepared.findings)
    }

    /// dict or None: ``path`` of the bone segmentation, ``numbers`` of the bones, and whether ppa ``segmented`` the scan.
    #[getter]
    fn bones<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        plain(py, &self.limb().case.bones)
    }

    /// numpy.ndarray, shape (4, 4): transform from the scan to the patient frame, T^P_CT, mm.
    #[getter]
    fn patient_from_ct<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray2<f64>> {
        let motion = self.limb().prepared.landmarks.patient_from_ct();
        crate::volume::rows(py, motion.to_homogeneous_rows())
    }

    /// Place the limb on the table.
    ///
    /// Parameters
    /// ----------
    /// angle : float
    ///     Medial rotation, degrees.
    /// scene : Scene, optional
    ///     By default, the built-in room with the paper's settings.
    /// threads : int, optional
    ///     Worker threads; one per core by default.
    ///
    /// Returns
    /// -------
    /// Pose
    #[pyo3(signature = (angle=0.0, *, scene=None, threads=None))]
    fn place(
        &self,
        py: Python<'_>,
        angle: f64,
        scene: Option<&Bound<'_, PyScene>>,
        #[pyo3(from_py_with = threads_of)] threads: Option<usize>,
    ) -> PyResult<PyPose> {
        let given = scene.map(|scene| scene.get().scene.clone());
        PyPose::new(py, self.limb(), angle, given, threads)
    }

    /// Draw skin, axis, joint and plane with matplotlib on ``ax`` or in a new figure, and return the axes.
    #[pyo3(signature = (ax=None))]
    fn plot<'py>(
        this: &Bound<'py, Self>,
        ax: Option<&Bound<'py, PyAny>>,
    ) -> PyResult<Bound<'py, PyAny>> {
        let plots = this.py().import("ppa._plots")?;
        plots.call_method1("case", (this, ax))
    }

    fn __repr__(&self) -> String {
        let limb = self.limb();
        let kind = match limb.prepared.landmarks.limb {
            ppa_scene::LimbKind::LowerLeg => "lower leg",
            ppa_scene::LimbKind::Knee => "knee",
            ppa_scene::LimbKind::Other => "limb",
        };
        let vertices = limb.prepared.limb.mesh.vertices.len();
        format!(
            "<ppa.Case: {} {kind}, skin of {vertices} vertices>",
            limb.case.side
        )
    }
}
