//! numpy arrays: arrays from Python are checked; arrays for Python are views that keep their owner alive.

use numpy::ndarray::{ArrayView, Dimension, ShapeBuilder};
use numpy::{
    Element, IntoPyArray, PyArray, PyArray2, PyArrayMethods, PyReadonlyArrayDyn, PyUntypedArray,
    PyUntypedArrayMethods,
};
use pyo3::exceptions::{PyBufferError, PyTypeError, PyValueError};
use pyo3::prelude::*;
use pyo3::types::PyDict;

/// Type and shape of an array for messages.
fn described(array: &Bound<'_, PyUntypedArray>) -> String {
    let dtype = array.dtype().to_string();
    format!("{dtype} of shape {}", shape(array.shape()))
}

/// A shape in numpy's notation.
fn shape(sizes: &[usize]) -> String {
    let sizes: Vec<String> = sizes.iter().map(ToString::to_string).collect();
    match &sizes[..] {
        [only] => format!("({only},)"),
        _ => format!("({})", sizes.join(", ")),
    }
}

/// Extracts an array of any type; other objects are refused.
pub fn untyped<'a, 'py>(
    object: &'a Bound<'py, PyAny>,
    name: &str,
) -> PyResult<&'a Bound<'py, PyUntypedArray>> {
    object.cast::<PyUntypedArray>().map_err(|_| {
        let found = object.get_type().name().map(|name| name.to_string());
        PyTypeError::new_err(format!(
            "{name} is of type {}, expected a numpy array",
            found.unwrap_or_default()
        ))
    })
}

/// Elements of an array of type `T` and `dimensions` dimensions, with the first index fastest.
///
/// C-ordered elements are reordered; arrays that are not contiguous are refused.
pub fn first_fastest<T: Element + Copy>(
    object: &Bound<'_, PyAny>,
    name: &str,
    dimensions: usize,
) -> PyResult<(Vec<T>, Vec<usize>)> {
    let array = untyped(object, name)?;
    let typed: Option<PyReadonlyArrayDyn<'_, T>> = object.extract().ok();
    let Some(typed) = typed.filter(|typed| typed.ndim() == dimensions) else {
        return Err(PyValueError::new_err(format!(
            "{name} is an array of {}, expected {} with {dimensions} dimensions",
            described(array),
            T::get_dtype(object.py())
        )));
    };
    let sizes = typed.shape().to_vec();
    if !typed.is_fortran_contiguous() && !typed.is_c_contiguous() {
        return Err(PyValueError::new_err(format!(
            "{name} is not contiguous (strides of {:?} bytes), expected numpy.ascontiguousarray(…) of it",
            array.strides()
        )));
    }
    let Ok(elements) = typed.as_slice() else {
        return Err(PyValueError::new_err(format!(
            "{name} is not aligned to the size of its elements, expected an aligned copy"
        )));
    };
    if typed.is_fortran_contiguous() {
        return Ok((elements.to_vec(), sizes));
    }
    let reversed = typed.as_array().reversed_axes();
    Ok((reversed.iter().copied().collect(), sizes))
}

/// An aligned array, converted to `dtype` if given; copied if necessary.
pub fn required<'py>(
    object: &Bound<'py, PyAny>,
    dtype: Option<&str>,
) -> PyResult<Bound<'py, PyAny>> {
    let numpy = object.py().import("numpy")?;
    numpy.call_method1("require", (object, dtype, ["ALIGNED"]))
}

/// Numbers in any form that numpy accepts, as float64 with the expected shape; an expected size of 0 allows any length.
pub fn numbers(object: &Bound<'_, PyAny>, name: &str, expected: &[usize]) -> PyResult<Vec<f64>> {
    let py = object.py();
    let array = required(object, Some("float64")).map_err(|error| {
        let refused = PyTypeError::new_err(format!("{name} is not an array of numbers"));
        refused.set_cause(py, Some(error));
        refused
    })?;
    let typed: PyReadonlyArrayDyn<'_, f64> = array.extract()?;
    let fits = typed.shape().len() == expected.len()
        && (typed.shape().iter().zip(expected)).all(|(found, size)| *size == 0 || found == size);
    if !fits {
        let any = shape(expected).replace("(0", "(n");
        return Err(PyValueError::new_err(format!(
            "{name} has the shape {}, expected {any}",
            shape(typed.shape())
        )));
    }
    let values: Vec<f64> = typed.as_array().iter().copied().collect();
    Ok(values)
}

/// Like [`numbers`], but all must be finite.
pub fn finite<const N: usize>(
    object: &Bound<'_, PyAny>,
    name: &str,
    expected: &[usize],
) -> PyResult<[f64; N]> {
    let values = numbers(object, name, expected)?;
    if let Some(bad) = values.iter().find(|value| !value.is_finite()) {
        return Err(PyValueError::new_err(format!(
            "{name} contains {bad}, expected finite numbers"
        )));
    }
    Ok(values.try_into().expect("as many as the shape holds"))
}

/// A point or direction.
pub fn point(object: &Bound<'_, PyAny>, name: &str) -> PyResult<[f64; 3]> {
    finite(object, name, &[3])
}

/// Points, one per row.
pub fn points<const N: usize>(object: &Bound<'_, PyAny>, name: &str) -> PyResult<[[f64; 3]; N]> {
    let rows = rows_of(object, name, N)?;
    Ok(rows.try_into().expect("as many as the shape holds"))
}

/// Any number of rows of N finite numbers, such as points.
pub fn row_list<const N: usize>(object: &Bound<'_, PyAny>, name: &str) -> PyResult<Vec<[f64; N]>> {
    // An empty list has no second dimension.
    match object.len() {
        Ok(0) => Ok(Vec::new()),
        _ => rows_of(object, name, 0),
    }
}

/// Rows of N finite numbers; `rows` 0 allows any number of them.
fn rows_of<const N: usize>(
    object: &Bound<'_, PyAny>,
    name: &str,
    rows: usize,
) -> PyResult<Vec<[f64; N]>> {
    let values = numbers(object, name, &[rows, N])?;
    if let Some(bad) = values.iter().find(|value| !value.is_finite()) {
        return Err(PyValueError::new_err(format!(
            "{name} contains {bad}, expected finite numbers"
        )));
    }
    let (rows, _) = values.as_chunks::<N>();
    Ok(rows.to_vec())
}

/// Rows of a 4 x 4 matrix.
pub fn matrix(object: &Bound<'_, PyAny>, name: &str) -> PyResult<[[f64; 4]; 4]> {
    let values: [f64; 16] = finite(object, name, &[4, 4])?;
    Ok(std::array::from_fn(|row| {
        std::array::from_fn(|column| values[4 * row + column])
    }))
}

/// An array with one row per item.
pub fn of_rows<T: Element, const N: usize>(
    py: Python<'_>,
    rows: Vec<[T; N]>,
) -> PyResult<Bound<'_, PyArray2<T>>> {
    let count = rows.len();
    rows.into_flattened().into_pyarray(py).reshape([count, N])
}

/// A read-only view of elements that belong to `owner`, without a copy.
///
/// # Safety
/// The elements must not be moved or changed while `owner` is alive.
#[allow(unsafe_code)]
pub unsafe fn view<'py, T: Element, D: Dimension>(
    owner: Bound<'py, PyAny>,
    elements: &[T],
    shape: impl ShapeBuilder<Dim = D>,
) -> PyResult<Bound<'py, PyArray<T, D>>> {
    let elements = ArrayView::from_shape(shape, elements).expect("as many as the shape holds");
    // SAFETY: numpy keeps `owner` alive as long as the array; the caller guarantees that the elements live as long and do not
    // change, and the array is made read-only before it is returned.
    let array = unsafe { PyArray::borrow_from_array(&elements, owner) };
    array.call_method1("setflags", (false,))?;
    Ok(array)
}

/// Result of `__array__`: the array, converted to `dtype` if given. NumPy 2 requires or forbids a copy with `copy`.
pub fn converted<'py>(
    array: Bound<'py, PyAny>,
    dtype: Option<&Bound<'py, PyAny>>,
    copy: Option<bool>,
) -> PyResult<Bound<'py, PyAny>> {
    let of_type = match dtype {
        Some(dtype) => array.call_method1("astype", (dtype,))?,
        None => array.clone(),
    };
    match (copy, of_type.is(&array)) {
        (Some(true), true) => array.call_method0("copy"),
        (Some(false), false) => Err(PyValueError::new_err(
            "another type needs a copy, but copy=False was given",
        )),
        _ => Ok(of_type),
    }
}

/// Result of `__dlpack__` for a read-only view; `options` are numpy's.
///
/// A copy, since not all libraries respect that an array is read-only; with `copy=False` the view itself, which numpy 2.1 or later
/// exports as read-only if the consumer supports DLPack 1.0, and otherwise refuses.
pub fn exported<'py>(
    view: &Bound<'py, PyAny>,
    options: Option<&Bound<'py, PyDict>>,
) -> PyResult<Bound<'py, PyAny>> {
    let (copy, options) = split_copy(view.py(), options)?;
    match copy {
        Some(false) => view.call_method("__dlpack__", (), Some(&options)),
        _ => {
            let copied = view.call_method0("copy")?;
            copied.call_method("__dlpack__", (), Some(&options))
        }
    }
}

/// Result of `__dlpack__` for an array that was computed for this export and has no other users.
pub fn given_away<'py>(
    array: &Bound<'py, PyAny>,
    options: Option<&Bound<'py, PyDict>>,
) -> PyResult<Bound<'py, PyAny>> {
    let (copy, options) = split_copy(array.py(), options)?;
    match copy {
        Some(false) => Err(PyBufferError::new_err(
            "the sum of the layers is computed for each export, but copy=False was given: export one of the layers",
        )),
        _ => array.call_method("__dlpack__", (), Some(&options)),
    }
}

/// Splits the option `copy` of `__dlpack__` from the others.
fn split_copy<'py>(
    py: Python<'py>,
    options: Option<&Bound<'py, PyDict>>,
) -> PyResult<(Option<bool>, Bound<'py, PyDict>)> {
    let options = match options {
        Some(options) => options.copy()?,
        None => PyDict::new(py),
    };
    let Some(copy) = options.get_item("copy")? else {
        return Ok((None, options));
    };
    options.del_item("copy")?;
    Ok((copy.extract()?, options))
}

/// Result of `__dlpack_device__`.
pub fn device<'py>(array: &Bound<'py, PyAny>) -> PyResult<Bound<'py, PyAny>> {
    array.call_method0("__dlpack_device__")
}
