//! The error of a field whose value is not allowed.

use std::fmt::Display;

/// A field of a request whose value is not allowed.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("`{field}` is {value}: {allowed}")]
pub struct InvalidField {
    /// Path of the field, such as `film.size`.
    pub field: String,
    /// The value, as readable text.
    pub value: String,
    /// The allowed values, as readable text.
    pub allowed: String,
}

impl InvalidField {
    pub(crate) fn new(field: impl Into<String>, value: impl Display, allowed: impl Into<String>) -> Self {
        Self { field: field.into(), value: value.to_string(), allowed: allowed.into() }
    }
}
