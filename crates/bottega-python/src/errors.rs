//! Errors as Python exceptions.

use bottega::{
    Error,
    error::error_chain,
    request::{InvalidField, RequestError},
    scene::EditError,
};
use pyo3::{PyErr, import_exception, prelude::*};

/// The exception classes, which Python code declares.
mod python {
    use super::import_exception;

    import_exception!(bottega._errors, Error);
    import_exception!(bottega._errors, RequestError);
    import_exception!(bottega._errors, SceneError);
    import_exception!(bottega._errors, PictureError);
    import_exception!(bottega._errors, EngineError);
    import_exception!(bottega._errors, RulesError);
    import_exception!(bottega._errors, FarmError);
    import_exception!(bottega._errors, ForkError);
    import_exception!(bottega._errors, Interrupted);
}

/// Returns the exception of an error of the library.
pub(crate) fn raised(error: &Error) -> PyErr {
    let (text, remedy) = (error.error_chain(), error.remedy());
    match error {
        Error::Invalid(invalid) => invalid_field(invalid),
        Error::Request { source, .. } => raised_by_request(source),
        Error::Scene(_) | Error::Prepare(_) => python::SceneError::new_err((text, remedy)),
        Error::Image(_) | Error::Write { .. } | Error::Read { .. } | Error::Denoise(_) => {
            python::PictureError::new_err((text, remedy))
        }
        Error::Engine(_) | Error::External { .. } | Error::Manifest(_) | Error::Gpu(_) => {
            python::EngineError::new_err((text, remedy))
        }
        Error::Rules { .. } | Error::RulesText { .. } => python::RulesError::new_err((text, remedy)),
        Error::Usage { .. } => python::RequestError::new_err((text, remedy)),
        _ => python::Error::new_err((text, remedy)),
    }
}

/// Returns the exception of an error of a farm.
pub(crate) fn raised_by_farm(error: &bottega_cluster::Error) -> PyErr {
    match error {
        bottega_cluster::Error::Bottega(error) if !matches!(error, Error::Failed { .. }) => raised(error),
        error => farm(error.error_chain(), error.remedy()),
    }
}

/// Makes the exception `FarmError` from a problem and its remedy.
pub(crate) fn farm(text: String, remedy: Option<String>) -> PyErr {
    python::FarmError::new_err((text, remedy))
}

/// Returns the exception of an invalid request.
pub(crate) fn raised_by_request(error: &RequestError) -> PyErr {
    match error {
        RequestError::Invalid(invalid) => invalid_field(invalid),
        RequestError::Text { field, .. } => {
            let field = (!field.is_empty()).then(|| field.clone());
            python::RequestError::new_err((error_chain(error), None::<String>, field))
        }
        error => python::RequestError::new_err((error_chain(error), None::<String>)),
    }
}

fn invalid_field(invalid: &InvalidField) -> PyErr {
    let InvalidField { field, value, allowed } = invalid;
    python::RequestError::new_err((invalid.to_string(), None::<String>, field.clone(), value.clone(), allowed.clone()))
}

/// Makes a `SceneError` for an invalid argument or array.
pub(crate) fn wrong(argument: &str, problem: &str) -> PyErr {
    python::SceneError::new_err((format!("`{argument}`: {problem}"), None::<String>))
}

/// Makes a `SceneError` for an edit that was refused.
pub(crate) fn edit(error: &EditError) -> PyErr {
    python::SceneError::new_err((error.to_string(), None::<String>))
}

/// Makes an `Error` for any other failure.
pub(crate) fn failed(problem: &str, remedy: &str) -> PyErr {
    python::Error::new_err((problem.to_owned(), remedy.to_owned()))
}

/// Makes the exception `RulesError` from a problem and its remedy.
pub(crate) fn rules(problem: String, remedy: String) -> PyErr {
    python::RulesError::new_err((problem, remedy))
}

/// Makes the exception `ForkError`, raised in forked processes.
pub(crate) fn forked() -> PyErr {
    python::ForkError::new_err((
        "this process was forked after bottega was used; the threads of bottega do not exist here",
        "start processes by `spawn`: multiprocessing.get_context(\"spawn\"); or use bottega only after the fork",
    ))
}

/// Makes an `Interrupted` exception for Ctrl-C, with the picture painted so far.
pub(crate) fn interrupted(picture: Option<Py<PyAny>>) -> PyErr {
    python::Interrupted::new_err((picture,))
}

/// Returns the text of an error with its remedy.
pub(crate) fn text(error: &Error) -> String {
    let remedy = error.remedy().map(|remedy| format!("; {remedy}")).unwrap_or_default();
    format!("{}{remedy}", error.error_chain())
}
