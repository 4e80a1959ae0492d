//! `ppa.evaluate` and `ppa.permutation_test`.

use ppa_metrics::{mean_per_seed, sign_flip_permutation};
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;

use crate::arguments::threads_of;
use crate::arrays::numbers;
use crate::background::run;
use crate::errors::OrRaise;
use crate::values::plain;

/// Compute the paper's metrics of predictions.
///
/// Parameters
/// ----------
/// labels : array_like, shape (n,)
///     Quality from 1 (ideal) to 3 (inadequate).
/// predictions : array_like, shape (n,)
///     Predicted quality.
///
/// Returns
/// -------
/// dict
///     ``n``, ``mse``, ``mae``, ``spearman``, ``accuracy``, ``diagnostic_accuracy``, ``sensitivity`` and ``specificity``; None
///     if a metric is not defined. ``constant_prediction`` is not None if the predictions hardly differ.
#[pyfunction]
pub fn evaluate<'py>(
    py: Python<'py>,
    labels: &Bound<'py, PyAny>,
    predictions: &Bound<'py, PyAny>,
) -> PyResult<Bound<'py, PyAny>> {
    let labels = numbers(labels, "labels", &[0])?;
    let predictions = numbers(predictions, "predictions", &[0])?;
    plain(
        py,
        &ppa_metrics::evaluate(&labels, &predictions).or_raise()?,
    )
}

/// Run the exact paired sign-flip permutation test of the mean difference a - b.
///
/// Parameters
/// ----------
/// a, b : array_like, shape (n,)
///     Paired values.
/// seeds : array_like of int, shape (n,), optional
///     Seed of each pair; the pairs of each seed (its folds) are averaged first.
/// threads : int, optional
///     Worker threads; one per core by default.
///
/// Returns
/// -------
/// dict
///     ``mean_difference``, ``p_one_sided``, ``p_two_sided`` and ``patterns``, the number of sign patterns.
#[pyfunction]
#[pyo3(signature = (a, b, *, seeds=None, threads=None))]
pub fn permutation_test<'py>(
    py: Python<'py>,
    a: &Bound<'py, PyAny>,
    b: &Bound<'py, PyAny>,
    seeds: Option<&Bound<'py, PyAny>>,
    #[pyo3(from_py_with = threads_of)] threads: Option<usize>,
) -> PyResult<Bound<'py, PyAny>> {
    let (a, b) = (numbers(a, "a", &[0])?, numbers(b, "b", &[0])?);
    let seed = |seed: f64| {
        if seed.fract() == 0.0 && (0.0..9e15).contains(&seed) {
            return Ok(seed as u64);
        }
        Err(PyValueError::new_err(format!(
            "seeds contains {seed}, expected whole numbers from 0 on"
        )))
    };
    let seeds = seeds.map(|seeds| {
        let seeds = numbers(seeds, "seeds", &[0])?;
        seeds.into_iter().map(seed).collect::<PyResult<Vec<u64>>>()
    });
    let seeds = seeds.transpose()?;
    let test = run(py, threads, None, move |_| match seeds {
        Some(seeds) => {
            let (a, b) = mean_per_seed(&seeds, &a, &b)?;
            sign_flip_permutation(&a, &b)
        }
        None => sign_flip_permutation(&a, &b),
    })?;
    plain(py, &test.or_raise()?)
}
