//! `ppa.label`: labels computed from the bones of a dataset's limbs.

use std::path::PathBuf;
use std::sync::atomic::Ordering;

use ppa_dataset::files::FileError;
use ppa_dataset::labels::LabelName;
use ppa_dataset::layout::LimbId;
use ppa_dataset::manifest::Manifest;
use ppa_generate::{Case, CaseError, Plan};
use ppa_label::{
    AutoLabelError, CaseBones, ComputedLabels, LabelScale, LabelledLimb, ScaleName, compute_labels,
};
use pyo3::prelude::*;
use pyo3::types::PyDict;
use serde::Serialize;

use crate::arguments::threads_of;
use crate::background::{Watch, run};
use crate::errors::OrRaise;
use crate::plan::plan_of;
use crate::progress::observer;
use crate::values::{from_table, plain, table};

/// A scale by name, with its default thresholds or those of a dictionary or TOML file.
pub fn scale_of(name: &str, thresholds: Option<&Bound<'_, PyAny>>) -> PyResult<LabelScale> {
    let name: ScaleName = name.parse().or_raise()?;
    let Some(given) = thresholds else {
        return Ok(LabelScale::new(name));
    };
    let Ok(keys) = given.cast::<PyDict>() else {
        return LabelScale::read(name, &given.extract::<PathBuf>()?).or_raise();
    };
    let keys = table(keys, "thresholds")?;
    let scale = match name {
        ScaleName::Graded => LabelScale::Graded(from_table(keys, "thresholds")?),
        ScaleName::Strict => LabelScale::Strict(from_table(keys, "thresholds")?),
    };
    scale.check().or_raise()?;
    Ok(scale)
}

/// Why a dataset cannot be labelled.
#[derive(Debug, thiserror::Error)]
enum LabelError {
    #[error(transparent)]
    Manifest(#[from] FileError),
    #[error(transparent)]
    Case(#[from] CaseError),
    #[error("cannot label by {}", case.display())]
    Limb {
        case: PathBuf,
        source: Box<AutoLabelError>,
    },
    #[error(transparent)]
    Labels(#[from] AutoLabelError),
    #[error("the call was interrupted, nothing was written")]
    Interrupted,
}

/// The JSON output of the command line.
#[derive(Serialize)]
struct Labelled {
    limbs: Vec<LabelledLimb>,
    thresholds: LabelScale,
}

/// Labels all limbs of a plan, or none.
struct Labelling {
    dataset: PathBuf,
    plan: Plan,
    scale: LabelScale,
    name: Option<LabelName>,
    replace: bool,
}

impl Labelling {
    fn run(self, watch: &Watch) -> Result<Labelled, LabelError> {
        let manifest = Manifest::read(&self.dataset)?;
        let cases = &self.plan.cases;
        let mut computed = Vec::with_capacity(cases.len());
        for planned in cases {
            let case = Case::read(&planned.file)?;
            let limb = LimbId {
                patient: planned.patient,
                side: case.side,
            };
            let bones = CaseBones {
                limb_kind: case.choices.limb,
                file: case.bones.as_ref(),
                volume_sha256: &case.source.volume_sha256,
            };
            let labels = compute_labels(&manifest, limb, &bones, &self.scale, self.name.as_ref());
            computed.push(labels.map_err(|source| LabelError::Limb {
                case: planned.file.clone(),
                source: Box::new(source),
            })?);
            if (watch.report(computed.len() as f64, cases.len() as f64)).is_break() {
                return Err(LabelError::Interrupted);
            }
        }
        if !self.replace {
            computed.iter().try_for_each(ComputedLabels::require_same)?;
        }
        if watch.stop().load(Ordering::Relaxed) {
            return Err(LabelError::Interrupted);
        }
        let limbs = computed.iter().map(ComputedLabels::write);
        Ok(Labelled {
            limbs: limbs.collect::<Result<_, _>>()?,
            thresholds: self.scale,
        })
    }
}

/// Compute the labels of a dataset from the bones of its cases and write them into its folder, like ``ppa label auto``.
///
/// No reader has validated these labels. Readers' labels are kept; an interrupted call writes nothing.
///
/// Parameters
/// ----------
/// dataset : str or os.PathLike
///     Folder of the dataset.
/// plan : Plan or path of plan.toml, optional
///     Plan of the dataset; by default the file next to its folder, named after it. Its cases name the bones (``bones`` or
///     ``segment_bones`` of :func:`prepare`).
/// scale : {"graded", "strict"}
///     "graded" grades how far the malleoli overlap the talus, with a diagnostic range fitted to readers; "strict" grades how open
///     the worst gutter is.
/// name : str, optional
///     Write labels.NAME.json and leave labels.json as it is.
/// thresholds : dict or path of a TOML file, optional
///     Thresholds of the scale: ``hidden_mm`` and ``lost_contrast`` (graded), ``relative_to`` and ``at_least`` (strict).
/// replace : bool
///     Replace computed labels that differ.
/// progress : bool or callable, optional
///     True for a tqdm progress bar, or a function of done and total limbs.
/// threads : int, optional
///     Worker threads; one per core by default.
///
/// Returns
/// -------
/// dict
///     ``limbs``, each with its number of ``radiographs``, the number of ``diagnostic`` ones and its ``best_angle_deg``; and
///     ``thresholds``.
#[pyfunction]
#[pyo3(signature = (dataset, plan=None, *, scale="graded", name=None, thresholds=None, replace=false, progress=None, threads=None))]
#[expect(clippy::too_many_arguments, reason = "keywords of a Python function")]
pub fn label<'py>(
    py: Python<'py>,
    dataset: PathBuf,
    plan: Option<&Bound<'py, PyAny>>,
    scale: &str,
    name: Option<&str>,
    thresholds: Option<&Bound<'py, PyAny>>,
    replace: bool,
    progress: Option<&Bound<'py, PyAny>>,
    #[pyo3(from_py_with = threads_of)] threads: Option<usize>,
) -> PyResult<Bound<'py, PyAny>> {
    let scale = scale_of(scale, thresholds)?;
    let name = name.map(str::parse::<LabelName>).transpose().or_raise()?;
    let plan = match plan {
        Some(plan) => (*plan_of(Some(plan))?).clone(),
        None => Plan::read(&dataset.with_extension("toml")).or_raise()?,
    };
    let labelling = Labelling {
        dataset,
        plan,
        scale,
        name,
        replace,
    };
    let observer = observer(py, progress)?;
    let labelled = run(py, threads, observer.as_ref(), |watch| labelling.run(watch))?;
    plain(py, &labelled.or_raise()?)
}
