//! Requests as JSON text.

use bottega_scene::objects_only::ObjectsOnly;
use serde::Deserialize;

use super::{InvalidField, REQUEST_VERSION, Request};

/// Longest text of a request: rules are part of it, scenes are not.
pub const REQUEST_BYTES_MAX: usize = 16 << 20;

/// Why a text is no request, or a request has no text.
#[derive(Debug, thiserror::Error)]
pub enum RequestError {
    /// More text than any request has.
    #[error("it is longer than {REQUEST_BYTES_MAX} bytes, which no request is")]
    TooLong,
    /// No JSON, or none with the fields of a request.
    #[error("{}{problem}", at(.field))]
    Text {
        /// The path of the field where it goes wrong, such as `film.size`; empty: the whole.
        field: String,
        /// What is wrong, with line and column where it has been a text.
        problem: String,
    },
    /// It is written in a vocabulary that came later.
    #[error(
        "it is a request of version {0}, and versions up to {REQUEST_VERSION} are known here: install a newer bottega"
    )]
    Newer(u64),
    /// A value that is not allowed.
    #[error(transparent)]
    Invalid(#[from] InvalidField),
    /// JSON is Unicode, and a file name in it is not.
    #[error("a file name in it is not Unicode, so it has no text: rename the file")]
    NotUnicode,
}

fn at(field: &str) -> String {
    if field.is_empty() { String::new() } else { format!("`{field}`: ") }
}

impl RequestError {
    fn text(error: &serde_path_to_error::Error<serde_json::Error>) -> Self {
        let path = error.path().to_string();
        let field = if path == "." { String::new() } else { path };
        Self::Text { field, problem: error.inner().to_string() }
    }
}

/// The version alone, whatever else there is.
#[derive(Deserialize)]
struct Versioned {
    version: Option<serde_json::Value>,
}

impl Request {
    /// Reads a request, all of it, and checks it.
    ///
    /// # Errors
    /// The text is no JSON, has a field that there is not, a value that is not allowed, or is of a newer version.
    pub fn from_json(text: &[u8]) -> Result<Self, RequestError> {
        if text.len() > REQUEST_BYTES_MAX {
            return Err(RequestError::TooLong);
        }
        // What is newer is not judged by what is known here.
        if let Ok(Versioned { version: Some(version) }) = serde_json::from_slice(text) {
            refuse_newer(&version)?;
        }
        let mut json = serde_json::Deserializer::from_slice(text);
        let request: Self =
            serde_path_to_error::deserialize(ObjectsOnly(&mut json)).map_err(|error| RequestError::text(&error))?;
        json.end().map_err(|error| RequestError::Text { field: String::new(), problem: error.to_string() })?;
        request.validate()?;
        Ok(request)
    }

    /// Reads a request from a tree of JSON values, and checks it.
    ///
    /// # Errors
    /// As of [`Self::from_json`].
    pub fn from_value(value: serde_json::Value) -> Result<Self, RequestError> {
        if let Some(version) = value.get("version") {
            refuse_newer(version)?;
        }
        let request: Self =
            serde_path_to_error::deserialize(ObjectsOnly(value)).map_err(|error| RequestError::text(&error))?;
        request.validate()?;
        Ok(request)
    }

    /// The request as a tree of JSON values.
    ///
    /// # Errors
    /// A value that is not allowed, or a file name that is not Unicode.
    pub fn to_value(&self) -> Result<serde_json::Value, RequestError> {
        self.validate()?;
        serde_json::to_value(self).map_err(|_| RequestError::NotUnicode)
    }

    /// The request as JSON for people.
    ///
    /// # Errors
    /// As of [`Self::to_value`].
    pub fn to_json(&self) -> Result<String, RequestError> {
        self.validate()?;
        serde_json::to_string_pretty(self).map_err(|_| RequestError::NotUnicode)
    }

    /// The request as one line of JSON.
    ///
    /// # Errors
    /// As of [`Self::to_value`].
    pub fn to_line(&self) -> Result<String, RequestError> {
        self.validate()?;
        serde_json::to_string(self).map_err(|_| RequestError::NotUnicode)
    }
}

fn refuse_newer(version: &serde_json::Value) -> Result<(), RequestError> {
    match version.as_u64() {
        Some(version) if version > u64::from(REQUEST_VERSION) => Err(RequestError::Newer(version)),
        _ => Ok(()),
    }
}
