//! Why a text is no message or envelope.

/// A fault in a text that came over a wire, or in one that shall be sent.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum WireError {
    /// More than is taken.
    #[error("too many {what}: at most {max}")]
    TooMany {
        /// Of what.
        what: &'static str,
        /// How many may be.
        max: usize,
    },
    /// The text does not follow its grammar.
    #[error("byte {at}: expected {expected}")]
    Syntax {
        /// Where, as an offset in bytes.
        at: usize,
        /// What should be there.
        expected: &'static str,
    },
    /// Not well-formed XML.
    #[error("byte {at}: {reason}")]
    Xml {
        /// Where, as an offset in bytes.
        at: u64,
        /// What is wrong.
        reason: String,
    },
    /// Something that must be there is not.
    #[error("`{object}` has no `{part}`")]
    Missing {
        /// Of what.
        object: &'static str,
        /// What.
        part: &'static str,
    },
    /// Something may be there once only.
    #[error("`{0}` is given twice")]
    Twice(String),
    /// A value that makes no sense.
    #[error("`{value}` is no {what}")]
    BadValue {
        /// What it should be.
        what: &'static str,
        /// What it is; cut short.
        value: String,
    },
    /// Text with characters that the form cannot hold.
    #[error("{0} cannot be written in this form")]
    Unprintable(&'static str),
}

pub(crate) fn bad_value(what: &'static str, value: &str) -> WireError {
    WireError::BadValue { what, value: value.chars().take(80).collect() }
}
