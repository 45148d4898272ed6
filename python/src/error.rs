//! The border for errors: one conversion from the core's [`abbe::Error`] to Python's exceptions; panics stop here.
//!
//! | core | Python |
//! |---|---|
//! | `Usage` | `abbe.UsageError` |
//! | `Scene` | `abbe.StageError` |
//! | `File`, not found | `FileNotFoundError` |
//! | `File`, otherwise | `abbe.AbbeError` |
//! | `Interrupted` | `KeyboardInterrupt` |
//! | a panic | `abbe.AbbeError` that asks for a report |

use std::any::Any;
use std::panic::{AssertUnwindSafe, catch_unwind};

use abbe::Error;
use pyo3::exceptions::{PyFileNotFoundError, PyKeyboardInterrupt};
use pyo3::prelude::*;

pyo3::import_exception!(abbe.errors, AbbeError);
pyo3::import_exception!(abbe.errors, StageError);
pyo3::import_exception!(abbe.errors, UsageError);

/// An error on its way to Python.
pub(crate) enum Failure {
    /// From the core.
    Core(Error),
    /// A defect: the text of a panic.
    Defect(String),
    /// Already Python's.
    Python(PyErr),
}

/// The result of everything that Python calls.
pub(crate) type Outcome<T> = Result<T, Failure>;

impl From<Error> for Failure {
    fn from(error: Error) -> Self {
        Self::Core(error)
    }
}

impl From<PyErr> for Failure {
    fn from(error: PyErr) -> Self {
        Self::Python(error)
    }
}

impl From<Failure> for PyErr {
    fn from(failure: Failure) -> Self {
        let error = match failure {
            Failure::Core(error) => error,
            Failure::Defect(text) => {
                return AbbeError::new_err(format!("abbe: a defect in the renderer, please report it: {text}"));
            }
            Failure::Python(error) => return error,
        };
        let text = error.to_string();
        match error {
            Error::Usage { .. } => UsageError::new_err(text),
            Error::Scene { .. } => StageError::new_err(text),
            Error::File { source: Some(source), .. } if source.kind() == std::io::ErrorKind::NotFound => {
                PyFileNotFoundError::new_err(text)
            }
            Error::File { .. } => AbbeError::new_err(text),
            Error::Interrupted => PyKeyboardInterrupt::new_err(text),
        }
    }
}

/// The text of a panic.
pub(crate) fn defect(panic: &(dyn Any + Send)) -> Failure {
    let text = panic
        .downcast_ref::<&str>()
        .map(|text| (*text).to_owned())
        .or_else(|| panic.downcast_ref::<String>().cloned())
        .unwrap_or_else(|| "no message".to_owned());
    Failure::Defect(text)
}

/// Runs `work` with the interpreter released; a panic becomes an error.
///
/// What `work` shares is immutable or dropped with it, so a panic leaves nothing half-changed behind.
pub(crate) fn released<T: Send>(py: Python<'_>, work: impl FnOnce() -> Outcome<T> + Send) -> Outcome<T> {
    py.detach(|| catch_unwind(AssertUnwindSafe(work)).unwrap_or_else(|panic| Err(defect(panic.as_ref()))))
}
