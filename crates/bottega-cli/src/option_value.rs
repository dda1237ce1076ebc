//! The error of option values.

/// The reason why a text is not the value of an option, with what is needed instead.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("{0}")]
pub(crate) struct InvalidValue(String);

impl From<String> for InvalidValue {
    fn from(needed: String) -> Self {
        Self(needed)
    }
}

impl From<&str> for InvalidValue {
    fn from(needed: &str) -> Self {
        Self(needed.to_owned())
    }
}
