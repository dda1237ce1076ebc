//! Errors of messages and envelopes as text.

/// An error in a received text, or in one to send.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum WireError {
    /// A limit is exceeded.
    #[error("too many {what}: at most {max}")]
    TooMany {
        /// The kind of items, such as `bytes` or `elements`.
        what: &'static str,
        /// The greatest number of items that is accepted.
        max: usize,
    },
    /// A syntax error.
    #[error("byte {at}: expected {expected}")]
    Syntax {
        /// The position, as an offset in bytes.
        at: usize,
        /// The syntax expected there, as text for the user.
        expected: &'static str,
    },
    /// The XML is not well-formed.
    #[error("byte {at}: {reason}")]
    Xml {
        /// The position, as an offset in bytes.
        at: u64,
        /// The error of the XML reader, for display.
        reason: String,
    },
    /// A required part is missing.
    #[error("`{object}` has no `{part}`")]
    Missing {
        /// The name of the object that lacks a part.
        object: &'static str,
        /// The name of the missing part.
        part: &'static str,
    },
    /// A part that may occur once is repeated; holds its name.
    #[error("`{0}` is given twice")]
    Twice(String),
    /// A value is invalid.
    #[error("`{value}` is not a {what}")]
    BadValue {
        /// The kind of value expected, such as `date-time`.
        what: &'static str,
        /// The value, at most 80 characters of it.
        value: String,
    },
    /// A text contains characters that the representation does not allow; says which text.
    #[error("{0} cannot be written in this form")]
    Unprintable(&'static str),
}

pub(crate) fn bad_value(what: &'static str, value: &str) -> WireError {
    WireError::BadValue { what, value: value.chars().take(80).collect() }
}
