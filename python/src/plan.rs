//! `ppa.Plan`: settings of a dataset or of single images.

use std::path::PathBuf;
use std::sync::Arc;

use ppa_generate::{Plan, PlanCase, Technique, XraySettings};
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;
use pyo3::types::{PyDict, PyType};
use toml::{Table, Value};

use crate::arguments::whole;
use crate::errors::{OrRaise, PpaError};
use crate::values::{dictionary, from_table, table, to_table};

/// Settings of a dataset: the keys of plan.toml.
///
/// Parameters
/// ----------
/// cases : sequence of (path, int)
///     Case files with the number N of each person's folder ``patient_N``.
/// seed : int
///     Seed of all random numbers.
/// technique : {"ankle", "knee", "lower-leg", "foot", "hand", "wrist", "elbow"}, optional
///     Typical exposure of an examination; keys of ``xray`` replace its values.
/// rotation, shapes, soft_tissue, positioning, room, depth, xray : dict, optional
///     The tables of plan.toml, e.g. ``rotation={"from_deg": 0, "to_deg": 30, "step_deg": 5}``. Omitted keys have their defaults;
///     relative paths start at the current folder.
///
/// Raises
/// ------
/// PpaError
///     If a key is unknown or a value is invalid.
#[pyclass(frozen, module = "ppa", name = "Plan")]
pub struct PyPlan {
    pub plan: Arc<Plan>,
}

/// Settings of radiographs: `base`, changed by a technique and then by the keys of a dictionary.
pub fn xray_settings(
    base: &XraySettings,
    technique: Option<&str>,
    keys: Option<&Bound<'_, PyDict>>,
) -> PyResult<XraySettings> {
    let mut settings = base.clone();
    if let Some(name) = technique {
        let known = Technique::ALL.into_iter().find(|(known, _)| *known == name);
        let (_, technique) = known.ok_or_else(|| {
            let known = Technique::ALL
                .map(|(known, _)| format!("{known:?}"))
                .join(" or ");
            PyValueError::new_err(format!("technique is {name:?}, expected {known}"))
        })?;
        technique.apply(&mut settings);
    }
    match keys {
        Some(keys) if !keys.is_empty() => {
            let mut all = to_table(&settings)?;
            all.extend(table(keys, "xray")?);
            from_table(all, "xray")
        }
        _ => Ok(settings),
    }
}

#[pymethods]
impl PyPlan {
    #[new]
    #[pyo3(signature = (cases=Vec::new(), *, seed=0, technique=None, rotation=None, shapes=None, soft_tissue=None, positioning=None, room=None, depth=None, xray=None))]
    #[expect(clippy::too_many_arguments, reason = "keywords of a Python function")]
    fn new(
        #[pyo3(from_py_with = whole::<32, _>)] cases: Vec<(PathBuf, u32)>,
        #[pyo3(from_py_with = whole::<64, _>)] seed: u64,
        technique: Option<&str>,
        rotation: Option<&Bound<'_, PyDict>>,
        shapes: Option<&Bound<'_, PyDict>>,
        soft_tissue: Option<&Bound<'_, PyDict>>,
        positioning: Option<&Bound<'_, PyDict>>,
        room: Option<&Bound<'_, PyDict>>,
        depth: Option<&Bound<'_, PyDict>>,
        xray: Option<&Bound<'_, PyDict>>,
    ) -> PyResult<Self> {
        let mut keys = Table::from_iter([
            ("version".to_owned(), Value::Integer(1)),
            ("case".to_owned(), Value::Array(Vec::new())),
        ]);
        for (name, given) in [
            ("rotation", rotation),
            ("shapes", shapes),
            ("soft_tissue", soft_tissue),
            ("positioning", positioning),
            ("room", room),
            ("depth", depth),
        ] {
            if let Some(given) = given {
                keys.insert(name.to_owned(), Value::Table(table(given, name)?));
            }
        }
        let cases = cases.into_iter();
        let plan = Plan {
            seed,
            cases: cases
                .map(|(file, patient)| PlanCase { file, patient })
                .collect(),
            xray: xray_settings(&XraySettings::default(), technique, xray)?,
            ..from_table(keys, "the plan")?
        };
        plan.check_settings().map_err(PpaError::new_err)?;
        Ok(Self {
            plan: Arc::new(plan),
        })
    }

    /// Read plan.toml.
    ///
    /// Parameters
    /// ----------
    /// path : str or os.PathLike
    #[classmethod]
    fn read(_: &Bound<'_, PyType>, path: PathBuf) -> PyResult<Self> {
        Ok(Self {
            plan: Arc::new(Plan::read(&path).or_raise()?),
        })
    }

    /// Write plan.toml; an existing file is replaced.
    ///
    /// Parameters
    /// ----------
    /// path : str or os.PathLike
    fn save(&self, path: PathBuf) -> PyResult<()> {
        self.plan.write(&path).or_raise()
    }

    /// dict: all keys of the plan with their values.
    #[getter]
    fn settings<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        dictionary(py, &to_table(&*self.plan)?)
    }

    fn __repr__(&self) -> String {
        let limbs = ppa_core::text::count(self.plan.cases.len(), "limb");
        let turn = self.plan.rotation;
        let (from, to, step) = (turn.from_deg, turn.to_deg, turn.step_deg);
        format!("<ppa.Plan of {limbs}, {from} to {to} degrees in steps of {step}>")
    }
}

/// A plan from an object or from the file at a path; the default plan if neither is given.
pub fn plan_of(object: Option<&Bound<'_, PyAny>>) -> PyResult<Arc<Plan>> {
    let Some(object) = object else {
        return Ok(Arc::new(Plan::new(Vec::new())));
    };
    if let Ok(plan) = object.cast::<PyPlan>() {
        return Ok(plan.get().plan.clone());
    }
    let path: PathBuf = object.extract()?;
    Ok(Arc::new(Plan::read(&path).or_raise()?))
}
