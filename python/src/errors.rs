//! Exceptions: the sentence of a library's error, with the causes behind it.

use std::error::Error;
use std::io;

use ppa_core::text::error_chain;
use pyo3::exceptions::{PyRuntimeError, PyValueError};
use pyo3::{PyErr, create_exception};

create_exception!(
    ppa,
    PpaError,
    PyValueError,
    "What ppa refuses: what was found, what was expected, and where."
);

create_exception!(
    ppa,
    InternalError,
    PyRuntimeError,
    "A defect of ppa: a computation ended where it should not have."
);

/// Options of the command line that sentences of the libraries name, and what stands for them in Python; a longer one first.
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

/// A sentence for callers of Python.
fn in_python(sentence: &str) -> String {
    let words = KEYWORDS.iter();
    words.fold(sentence.to_owned(), |text, (option, keyword)| {
        text.replace(option, keyword)
    })
}

/// The exception of a library's error: `OSError`, or one of its kinds such as `FileNotFoundError`, where the system refused
/// something or a library did not find a file, else [`PpaError`].
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

/// Turns a library's result into Python's.
pub trait OrRaise<T> {
    /// The value, or the exception of the error.
    fn or_raise(self) -> Result<T, PyErr>;
}

impl<T, E: Error + 'static> OrRaise<T> for Result<T, E> {
    fn or_raise(self) -> Result<T, PyErr> {
        self.map_err(raised)
    }
}
