//! Exceptions with the messages of the libraries' errors and of their causes.

use std::error::Error;
use std::io;

use ppa_core::text::error_chain;
use pyo3::exceptions::{PyRuntimeError, PyValueError};
use pyo3::{PyErr, create_exception};

create_exception!(
    ppa,
    PpaError,
    PyValueError,
    "Raised for invalid input: says what was found, what was expected, and where."
);

create_exception!(
    ppa,
    InternalError,
    PyRuntimeError,
    "Raised for a bug in ppa: a computation ended unexpectedly."
);

/// Command-line options in messages of the libraries, and their replacements in Python; longer options come first.
const KEYWORDS: [(&str, &str); 9] = [
    (" --axis-source bone", " axis_source=\"bone\""),
    (" --limb other", " limb=\"other\""),
    (" --limb", " limb="),
    (" --joint", " joint="),
    (" --inside", " inside="),
    (" --replace", " replace=True"),
    (" --shard", " shard"),
    (" --out", " out"),
    (
        "`ppa prepare --bones` or `--segment-bones`",
        "ppa.prepare with bones= or segment_bones=",
    ),
];

/// A message for callers in Python.
fn in_python(sentence: &str) -> String {
    let words = KEYWORDS.iter();
    words.fold(sentence.to_owned(), |text, (option, keyword)| {
        text.replace(option, keyword)
    })
}

/// The exception for a library's error: `OSError` or a subclass such as `FileNotFoundError` if the system reported the error or a
/// library did not find a file, otherwise [`PpaError`].
pub fn raised(error: impl Error + 'static) -> PyErr {
    let sentence = in_python(&error_chain(&error));
    let mut cause: Option<&(dyn Error + 'static)> = Some(&error);
    while let Some(error) = cause {
        if let Some(system) = error.downcast_ref::<io::Error>()
            && (system.raw_os_error().is_some() || system.kind() == io::ErrorKind::NotFound)
        {
            return io::Error::new(system.kind(), sentence).into();
        }
        cause = error.source();
    }
    PpaError::new_err(sentence)
}

/// Converts a library's result to a Python result.
pub trait OrRaise<T> {
    /// The value, or the exception for the error.
    fn or_raise(self) -> Result<T, PyErr>;
}

impl<T, E: Error + 'static> OrRaise<T> for Result<T, E> {
    fn or_raise(self) -> Result<T, PyErr> {
        self.map_err(raised)
    }
}
