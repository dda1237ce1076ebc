//! Requests as JSON text.

use serde::Deserialize;
use serde_json::Value;

use super::{InvalidField, REQUEST_VERSION, Request};
use crate::json::{self, JsonError};

/// Largest size of a request in bytes; requests can contain rules, but not scenes.
pub const REQUEST_BYTES_MAX: usize = 16 << 20;

/// The reason why a text is not a request, or a request cannot be written as text.
#[derive(Debug, thiserror::Error)]
pub enum RequestError {
    /// The text is longer than [`REQUEST_BYTES_MAX`].
    #[error("it is longer than {REQUEST_BYTES_MAX} bytes, the maximum of a request")]
    TooLong,
    /// The text is not JSON, or its fields are not those of a request.
    #[error("{}{problem}", at(.field))]
    Text {
        /// Path of the wrong field, such as `film.size`; empty: the whole.
        field: String,
        /// The problem, with line and column if the text is not JSON.
        problem: String,
    },
    /// The request has a newer version than this library supports.
    #[error(
        "it is a request of version {0}; this program supports versions up to {REQUEST_VERSION}: install a newer bottega"
    )]
    Newer(u64),
    /// A value that is not allowed.
    #[error(transparent)]
    Invalid(#[from] InvalidField),
    /// A file name in the request is not Unicode and cannot be written as JSON.
    #[error("a file name in it is not Unicode, so it has no text: rename the file")]
    NotUnicode,
}

fn at(field: &str) -> String {
    if field.is_empty() { String::new() } else { format!("`{field}`: ") }
}

impl RequestError {
    /// Converts an error of JSON. For numbers it states the limits of the field.
    ///
    /// - `tree`: gives the whole request, if it is JSON.
    fn of(error: JsonError, tree: impl FnOnce() -> Option<Value>) -> Self {
        let JsonError::Value { field, value, needed, number } = error else {
            return Self::Text { field: error.field().to_owned(), problem: problem_of(error) };
        };
        let needed = format!("{needed} is needed");
        if field.is_empty() {
            return Self::Text { problem: format!("it is {value}: {needed}"), field };
        }
        let limits = number.and_then(|_| limits_of(&field, &tree()?));
        let allowed = match (limits, number) {
            (Some(limits), Some("a whole number")) if value.parse::<i128>().is_ok() => limits,
            (Some(limits), Some(number)) => format!("{number} is needed; {limits}"),
            _ => needed,
        };
        Self::Invalid(InvalidField { field, value, allowed })
    }
}

/// Returns the problem without the field.
fn problem_of(error: JsonError) -> String {
    match error {
        JsonError::Field { problem, .. } => problem,
        JsonError::Syntax { line, column, problem, .. } => {
            JsonError::Syntax { field: String::new(), line, column, problem }.to_string()
        }
        error @ JsonError::Value { .. } => error.to_string(),
    }
}

/// Probe values: at least one of them lies outside the limits of each limited field.
const PROBES: [f64; 7] = [4_294_967_295.0, 65_535.0, 255.0, 0.0, -1.0, 1e30, -1e30];

/// Returns the limits of a number field, which may be narrower than its type, from the message of the validation about a probe
/// value. `None`: the field is not limited.
fn limits_of(field: &str, tree: &Value) -> Option<String> {
    let pointer = format!("/{}", field.replace(['.', '['], "/").replace(']', ""));
    // Try the field alone first, since other fields may be wrong too; then the whole, since limits may depend on other fields
    let lone = lone_field(&pointer, tree);
    lone.iter()
        .chain([tree])
        .find_map(|tree| PROBES.into_iter().find_map(|probe| refused(probe, field, &pointer, tree)))
}

/// Returns a request with one field alone, or with the whole list that the field is in.
fn lone_field(pointer: &str, tree: &Value) -> Option<Value> {
    let (parent, name) = pointer.rsplit_once('/')?;
    let (mut value, mut parts) = match tree.pointer(parent)? {
        list @ Value::Array(_) => (list.clone(), parent.split('/').skip(1).collect::<Vec<_>>()),
        _ => (serde_json::json!({ name: 0 }), parent.split('/').skip(1).collect()),
    };
    while let Some(part) = parts.pop() {
        value = serde_json::json!({ part: value });
    }
    if value.get("scene").is_none() {
        value["scene"] = serde_json::json!({ "file": "scene" });
    }
    Some(value)
}

/// Returns the allowed values, from the validation of a request with `probe` in the field; `None`: the probe is allowed.
fn refused(probe: f64, field: &str, pointer: &str, tree: &Value) -> Option<String> {
    let mut tree = tree.clone();
    let number = if probe.abs() < 1e10 { Value::from(probe as i64) } else { Value::from(probe) };
    *tree.pointer_mut(pointer)? = number;
    let request: Request = json::from_value(tree).ok()?;
    let refused = request.validate().err()?;
    field.starts_with(&refused.field).then_some(refused.allowed)
}

/// The version of a request; other fields are ignored.
#[derive(Deserialize)]
struct Versioned {
    version: Option<serde_json::Value>,
}

impl Request {
    /// Reads a request from a JSON text, and validates it.
    ///
    /// # Errors
    /// The text is too long, is not JSON, or has an unknown field or a value that is not allowed; or its version is newer.
    pub fn from_json(text: &[u8]) -> Result<Self, RequestError> {
        if text.len() > REQUEST_BYTES_MAX {
            return Err(RequestError::TooLong);
        }
        // Check the version first: the fields of a newer version are unknown here
        if let Ok(Versioned { version: Some(version) }) = serde_json::from_slice(text) {
            refuse_newer(&version)?;
        }
        let tree = || serde_json::from_slice(text).ok();
        let request: Self = json::from_slice(text).map_err(|error| RequestError::of(error, tree))?;
        request.validate()?;
        Ok(request)
    }

    /// Reads a request from a tree of JSON values, and validates it.
    ///
    /// # Errors
    /// Those of [`Self::from_json`].
    pub fn from_value(value: serde_json::Value) -> Result<Self, RequestError> {
        if let Some(version) = value.get("version") {
            refuse_newer(version)?;
        }
        let request: Self = json::from_value(value.clone()).map_err(|error| RequestError::of(error, || Some(value)))?;
        request.validate()?;
        Ok(request)
    }

    /// Returns the request as a tree of JSON values.
    ///
    /// # Errors
    /// A value is not allowed, or a file name is not Unicode.
    pub fn to_value(&self) -> Result<serde_json::Value, RequestError> {
        self.validate()?;
        serde_json::to_value(self).map_err(|_| RequestError::NotUnicode)
    }

    /// Returns the request as indented JSON.
    ///
    /// # Errors
    /// Those of [`Self::to_value`].
    pub fn to_json(&self) -> Result<String, RequestError> {
        self.validate()?;
        serde_json::to_string_pretty(self).map_err(|_| RequestError::NotUnicode)
    }

    /// Returns the request as one line of JSON.
    ///
    /// # Errors
    /// Those of [`Self::to_value`].
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
