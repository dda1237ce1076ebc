//! Errors of reading measured materials.

use std::path::Path;

use crate::error::SceneError;

/// An error of reading a measured material. Places are bytes from the begin of the file.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub(crate) enum MeasuredError {
    #[error("it is not a measured material, because it does not begin with `tensor_file`")]
    NotTensors,
    #[error("its format has version {major}.{minor}, and 1.0 can be read")]
    Version { major: u8, minor: u8 },
    #[error("it ends at byte {place}, within {what}")]
    End { place: usize, what: &'static str },
    #[error("{what} at byte {place} is {found}, and {most} is the most that is read")]
    Many { place: usize, what: &'static str, found: u64, most: u64 },
    #[error("its field `{name}` reaches beyond the end of the file")]
    Beyond { name: String },
    #[error("it has no field `{name}`")]
    Missing { name: &'static str },
    #[error("its field `{name}` has numbers of kind {found}, and {wanted} is needed")]
    Kind { name: &'static str, found: u8, wanted: &'static str },
    #[error("its field `{name}` has the shape {found}, and {wanted} is needed")]
    Shape { name: &'static str, found: String, wanted: String },
    #[error("value {index} of its field `{name}` is {value}")]
    Value { name: &'static str, index: usize, value: f32 },
    #[error("the {name} of its directions do not increase, or are out of range")]
    Directions { name: &'static str },
    #[error("its directions of view span {degrees}° around the normal, and 90°, 180° or 360° is needed")]
    Span { degrees: f32 },
    #[error("its wavelengths cannot be read: {0}")]
    Wavelengths(String),
}

impl MeasuredError {
    /// Converts to the error for the user.
    pub(super) fn in_file(self, path: &Path) -> SceneError {
        let problem = self.to_string();
        match self {
            Self::NotTensors | Self::Version { .. } | Self::Span { .. } => {
                SceneError::Invalid { path: path.into(), place: String::new(), problem }
            }
            _ => SceneError::Damaged { path: path.into(), problem },
        }
    }
}
