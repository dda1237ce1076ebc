//! A field whose value is not allowed.

use std::fmt::Display;

/// A field of a request whose value is not allowed.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("`{field}` is {value}: {allowed}")]
pub struct InvalidField {
    /// The field's path, such as `film.size`.
    pub field: String,
    /// Its value, as people read it.
    pub value: String,
    /// What is allowed there.
    pub allowed: String,
}

impl InvalidField {
    pub(crate) fn new(field: impl Into<String>, value: impl Display, allowed: impl Into<String>) -> Self {
        Self { field: field.into(), value: value.to_string(), allowed: allowed.into() }
    }
}
