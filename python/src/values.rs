//! Settings and results: conversion between Python dictionaries and TOML tables.

use pyo3::exceptions::{PyTypeError, PyValueError};
use pyo3::prelude::*;
use pyo3::types::{PyBool, PyDict, PyFloat, PyInt, PyList, PyString};
use serde::Serialize;
use serde::de::DeserializeOwned;
use toml::{Table, Value};

use crate::errors::{InternalError, PpaError};

/// Converts a Python value to TOML; entries of dictionaries that are None are omitted.
fn value(object: &Bound<'_, PyAny>, key: &str) -> PyResult<Value> {
    if let Ok(dict) = object.cast::<PyDict>() {
        return table(dict, key).map(Value::Table);
    }
    // Before integers, since Python's bool is an int.
    if object.is_instance_of::<PyBool>() {
        return object.extract().map(Value::Boolean);
    }
    if object.is_instance_of::<PyInt>() {
        return object.extract().map(Value::Integer);
    }
    if object.is_instance_of::<PyFloat>() {
        return object.extract().map(Value::Float);
    }
    if object.is_instance_of::<PyString>() {
        return object.extract().map(Value::String);
    }
    if object.hasattr("__fspath__")? {
        let path = object.call_method0("__fspath__")?;
        return path.extract().map(Value::String);
    }
    if object.hasattr("tolist")? {
        return value(&object.call_method0("tolist")?, key);
    }
    if let Ok(items) = object.try_iter() {
        let items = items.map(|item| value(&item?, key));
        return items.collect::<PyResult<_>>().map(Value::Array);
    }
    Err(PyTypeError::new_err(format!(
        "{key} is of type {}, expected a number, text, a truth value, a list or a dictionary",
        object.get_type().name()?
    )))
}

/// Converts a dictionary to a TOML table.
pub fn table(dict: &Bound<'_, PyDict>, name: &str) -> PyResult<Table> {
    let mut table = Table::new();
    for (key, item) in dict {
        let key: String = key
            .extract()
            .map_err(|_| PyTypeError::new_err(format!("a key of {name} is not text")))?;
        if !item.is_none() {
            let value = value(&item, &format!("{name}.{key}"))?;
            table.insert(key, value);
        }
    }
    Ok(table)
}

/// Deserialises a table; an error names the invalid key.
pub fn from_table<T: DeserializeOwned>(table: Table, name: &str) -> PyResult<T> {
    table
        .try_into()
        .map_err(|error| PpaError::new_err(format!("{name}: {}", error.to_string().trim_end())))
}

/// Parses one of several names, spelled as in files.
pub fn word<T: DeserializeOwned>(text: &str, name: &str) -> PyResult<T> {
    Value::String(text.to_owned())
        .try_into()
        .map_err(|error| PyValueError::new_err(format!("{name}: {}", error.to_string().trim_end())))
}

/// Converts settings to a table.
pub fn to_table(value: &impl Serialize) -> PyResult<Table> {
    Table::try_from(value).map_err(|error| InternalError::new_err(error.to_string()))
}

/// Converts a table to a dictionary.
pub fn dictionary<'py>(py: Python<'py>, table: &Table) -> PyResult<Bound<'py, PyDict>> {
    let dict = PyDict::new(py);
    for (key, value) in table {
        dict.set_item(key, of_toml(py, value)?)?;
    }
    Ok(dict)
}

fn of_toml<'py>(py: Python<'py>, value: &Value) -> PyResult<Bound<'py, PyAny>> {
    Ok(match value {
        Value::Table(table) => dictionary(py, table)?.into_any(),
        Value::Array(items) => {
            let items: PyResult<Vec<_>> = items.iter().map(|item| of_toml(py, item)).collect();
            PyList::new(py, items?)?.into_any()
        }
        Value::String(text) => text.into_pyobject(py)?.into_any(),
        Value::Integer(number) => number.into_pyobject(py)?.into_any(),
        Value::Float(number) => number.into_pyobject(py)?.into_any(),
        Value::Boolean(flag) => flag.into_pyobject(py)?.to_owned().into_any(),
        Value::Datetime(date) => date.to_string().into_pyobject(py)?.into_any(),
    })
}

/// Converts a result to the structure of the command line's JSON: dictionaries, lists, numbers, text, None.
pub fn plain<'py>(py: Python<'py>, result: &impl Serialize) -> PyResult<Bound<'py, PyAny>> {
    let value = serde_json::to_value(result);
    of_json(
        py,
        &value.map_err(|error| InternalError::new_err(error.to_string()))?,
    )
}

fn of_json<'py>(py: Python<'py>, value: &serde_json::Value) -> PyResult<Bound<'py, PyAny>> {
    use serde_json::Value;
    Ok(match value {
        Value::Null => py.None().into_bound(py),
        Value::Bool(flag) => flag.into_pyobject(py)?.to_owned().into_any(),
        Value::Number(number) => match (number.as_i64(), number.as_u64()) {
            (Some(whole), _) => whole.into_pyobject(py)?.into_any(),
            (None, Some(whole)) => whole.into_pyobject(py)?.into_any(),
            (None, None) => number.as_f64().into_pyobject(py)?.into_any(),
        },
        Value::String(text) => text.into_pyobject(py)?.into_any(),
        Value::Array(items) => {
            let items: PyResult<Vec<_>> = items.iter().map(|item| of_json(py, item)).collect();
            PyList::new(py, items?)?.into_any()
        }
        Value::Object(entries) => {
            let dict = PyDict::new(py);
            for (key, value) in entries {
                dict.set_item(key, of_json(py, value)?)?;
            }
            dict.into_any()
        }
    })
}
