//! `ppa.generate`: the dataset of a plan.

use std::ops::ControlFlow;
use std::path::PathBuf;
use std::sync::atomic::{AtomicUsize, Ordering};

use ppa_core::Part;
use ppa_generate::{GenerateSettings, Progress, generate as make};
use pyo3::prelude::*;

use crate::arguments::{threads_of, whole};
use crate::background::{Watch, run};
use crate::errors::OrRaise;
use crate::plan::plan_of;
use crate::progress::observer;
use crate::values::plain;

/// Poses of a run: total and finished.
#[derive(Default)]
struct Counts {
    total: AtomicUsize,
    done: AtomicUsize,
}

impl Counts {
    /// Updates the counts and reports them. The run itself reads the stop flag.
    fn report(&self, progress: Progress, watch: &Watch) -> ControlFlow<()> {
        match progress {
            Progress::Findings(_) => return ControlFlow::Continue(()),
            Progress::Total(total) => self.total.store(total, Ordering::Relaxed),
            Progress::Found | Progress::Made => {
                self.done.fetch_add(1, Ordering::Relaxed);
            }
        }
        let [done, total] = [&self.done, &self.total].map(|count| count.load(Ordering::Relaxed));
        watch.report(done as f64, total as f64)
    }
}

/// Generate the missing poses of a plan's dataset; resumes an interrupted run.
///
/// Ctrl-C ends the call within a second; poses in progress are finished in the background, and the next call resumes.
///
/// Parameters
/// ----------
/// plan : Plan or path of plan.toml
///     Plan of the dataset.
/// out : str or os.PathLike
///     Folder of the dataset.
/// seed : int, optional
///     Replaces the plan's seed.
/// shard : str, optional
///     Generate only shard k of n, e.g. "2/7"; each shard needs a separate folder.
/// replace : bool
///     Replace poses that differ from the plan; old images are kept until the new ones are complete.
/// disk_limit : int, optional
///     Stop before the images exceed this size in bytes.
/// progress : bool or callable, optional
///     True for a tqdm progress bar, or a function of done and total poses.
/// threads : int, optional
///     Worker threads; one per core by default. The images do not depend on it.
///
/// Returns
/// -------
/// dict
///     ``units`` (poses), ``made``, ``depth_images``, ``radiographs``, ``findings``, ``replaced``, ``removed``, ``healed`` and
///     ``set_aside``.
#[pyfunction]
#[pyo3(signature = (plan, out, *, seed=None, shard=None, replace=false, disk_limit=None, progress=None, threads=None))]
#[expect(clippy::too_many_arguments, reason = "keywords of a Python function")]
pub fn generate<'py>(
    py: Python<'py>,
    plan: &Bound<'py, PyAny>,
    out: PathBuf,
    #[pyo3(from_py_with = whole::<64, _>)] seed: Option<u64>,
    shard: Option<&str>,
    replace: bool,
    #[pyo3(from_py_with = whole::<64, _>)] disk_limit: Option<u64>,
    progress: Option<&Bound<'py, PyAny>>,
    #[pyo3(from_py_with = threads_of)] threads: Option<usize>,
) -> PyResult<Bound<'py, PyAny>> {
    let mut plan = (*plan_of(Some(plan))?).clone();
    plan.seed = seed.unwrap_or(plan.seed);
    let part = shard.map_or(Ok(Part::WHOLE), str::parse).or_raise()?;
    let observer = observer(py, progress)?;
    let summary = run(py, threads, observer.as_ref(), move |watch| {
        let settings = GenerateSettings {
            part,
            disk_limit,
            replace,
            stop: Some(watch.stop()),
        };
        let counts = Counts::default();
        make(&plan, &out, &settings, &|progress| {
            let _ = counts.report(progress, watch);
        })
    })?;
    plain(py, &summary.or_raise()?)
}
