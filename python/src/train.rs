//! `ppa.train`: training of a network on datasets.

use std::ffi::CString;
use std::path::{Path, PathBuf};

use ppa_learn::train::{TrainConfig, cautions, read_log, read_start, train as make};
use pyo3::exceptions::{PyTypeError, PyUserWarning};
use pyo3::prelude::*;
use pyo3::types::{PyDict, PyList};
use toml::{Table, Value};

use crate::arguments::threads_of;
use crate::background::run;
use crate::errors::OrRaise;
use crate::progress::observer;
use crate::values::{plain, table};

/// Name of the settings in messages, in place of a file; relative paths start at the current folder.
const SETTINGS: &str = "ppa.train";

/// A dataset given by its folder, or by the keys of a selection of its samples.
fn source(object: &Bound<'_, PyAny>, name: &str) -> PyResult<Table> {
    if let Ok(keys) = object.cast::<PyDict>() {
        return table(keys, name);
    }
    let path: PathBuf = object.extract().map_err(|_| {
        PyTypeError::new_err(format!(
            "{name} holds neither a path nor a dictionary with the keys of a dataset"
        ))
    })?;
    let text = path.to_string_lossy().into_owned();
    Ok(Table::from_iter([(
        "dataset".to_owned(),
        Value::String(text),
    )]))
}

/// One dataset or several.
fn sources(object: &Bound<'_, PyAny>, name: &str) -> PyResult<Value> {
    let listed = object.cast::<PyList>();
    let tables = match &listed {
        Ok(items) => items.iter().map(|item| source(&item, name)).collect(),
        Err(_) => source(object, name).map(|only| vec![only]),
    };
    let tables: Vec<Table> = tables?;
    Ok(Value::Array(tables.into_iter().map(Value::Table).collect()))
}

/// Train a network on labelled datasets; resumes an interrupted training in the same folder.
///
/// Ctrl-C ends the call within a second. The current step is finished and the checkpoint written in the background; the next call
/// resumes from there and ends with the same bytes.
///
/// Parameters
/// ----------
/// training : path, dict or list of them
///     Folders of datasets, or the keys of ``[[training]]`` of a configuration: ``dataset``, ``patients``, ``shapes``, ``every_pose``
///     and ``labels``.
/// out : str or os.PathLike
///     Folder of the training.
/// evaluation : path, dict or list of them, optional
///     Datasets to measure errors on, with other persons.
/// preset : {"quick", "standard", "paper"}
///     Default settings: on two cores, training takes minutes with the first two, and days with the last.
/// seed : int, optional
///     Replaces the preset's seed.
/// progress : bool or callable, optional
///     True for a tqdm progress bar, or a function of done and total steps.
/// threads : int, optional
///     Worker threads; one per core by default.
/// **settings
///     Keys of a configuration that replace the preset's, e.g. ``steps=800``, ``views="pairs"`` or
///     ``augmentation={"noise_probability": 0}``.
///
/// Warns
/// -----
/// UserWarning
///     If the datasets have severe findings that no case acknowledges, or if ``start`` was trained with ``mirror=True`` and this
///     training has ``mirror=False``.
///
/// Returns
/// -------
/// dict
///     ``steps``; ``last_loss``, None if no step was left; and ``start``: which weights of ``start`` were converted, missing or unused.
///     :func:`training_log` gives losses and errors.
#[pyfunction]
#[pyo3(signature = (training, out, *, evaluation=None, preset="standard", seed=None, progress=None, threads=None, **settings))]
#[expect(clippy::too_many_arguments, reason = "keywords of a Python function")]
pub fn train<'py>(
    py: Python<'py>,
    training: &Bound<'py, PyAny>,
    out: PathBuf,
    evaluation: Option<&Bound<'py, PyAny>>,
    preset: &str,
    seed: Option<i64>,
    progress: Option<&Bound<'py, PyAny>>,
    #[pyo3(from_py_with = threads_of)] threads: Option<usize>,
    settings: Option<&Bound<'py, PyDict>>,
) -> PyResult<Bound<'py, PyDict>> {
    let settings = settings.map(|settings| table(settings, "settings"));
    let mut keys = settings.transpose()?.unwrap_or_default();
    keys.insert("preset".to_owned(), Value::String(preset.to_owned()));
    keys.insert("training".to_owned(), sources(training, "training")?);
    if let Some(evaluation) = evaluation {
        keys.insert("evaluation".to_owned(), sources(evaluation, "evaluation")?);
    }
    if let Some(seed) = seed {
        keys.insert("seed".to_owned(), Value::Integer(seed));
    }
    let config = TrainConfig::of_keys(keys, Path::new(SETTINGS)).or_raise()?;
    for caution in cautions(&config).or_raise()? {
        let (category, text) = (py.get_type::<PyUserWarning>(), CString::new(caution)?);
        PyErr::warn(py, &category, &text, 1)?;
    }
    let steps = config.schedule().steps();
    let observer = observer(py, progress)?;
    let folder = out.clone();
    let last_loss = run(py, threads, observer.as_ref(), move |watch| {
        let mut last_loss = None;
        let ended = make(&config, &folder, watch.stop(), |progress| {
            last_loss = Some(progress.loss);
            // The training itself reads the stop flag.
            let _ = watch.report(progress.step as f64, progress.steps as f64);
        });
        ended.map(|_| last_loss)
    })?;
    let trained = PyDict::new(py);
    trained.set_item("steps", steps)?;
    trained.set_item("last_loss", last_loss.or_raise()?)?;
    trained.set_item("start", plain(py, &read_start(&out).or_raise()?)?)?;
    Ok(trained)
}

/// Read the log of a training, finished or not.
///
/// Parameters
/// ----------
/// run : str or os.PathLike
///     Folder of the training.
///
/// Returns
/// -------
/// list of dict
///     Rows for a ``pandas.DataFrame`` with ``step`` and ``seconds``. Rows of steps also have ``training/loss`` and ``training/rate``,
///     rows of evaluations ``evaluation/mae``, ``evaluation/mse``, ``evaluation/r_s``, ``evaluation/gap`` and ``training/mae``. Empty
///     if there is no log.
#[pyfunction]
pub fn training_log(py: Python<'_>, run: PathBuf) -> PyResult<Bound<'_, PyList>> {
    let rows = read_log(&run.join("log.jsonl")).or_raise()?;
    let rows = rows.iter().map(|measured| {
        let row = PyDict::new(py);
        row.set_item("step", measured.step)?;
        row.set_item("seconds", measured.seconds)?;
        for (tag, value) in &measured.scalars {
            row.set_item(tag, value)?;
        }
        Ok(row)
    });
    PyList::new(py, rows.collect::<PyResult<Vec<_>>>()?)
}
