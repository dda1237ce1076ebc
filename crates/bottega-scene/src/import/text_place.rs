//! Text files of a scene: locations in them, and errors at a location.

use std::fmt::Display;
use std::path::{Path, PathBuf};

use crate::error::SceneError;
use crate::text::shortened;

/// A location in a text file of the scene.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) struct TextPlace {
    /// Index of the file in [`TextFiles`]: 0 is the scene file, others are included.
    pub(crate) file: u32,
    /// Line, counted from 1; 0 if the scene file does not mention the thing.
    pub(crate) line: u32,
    /// Column, counted from 1.
    pub(crate) column: u32,
}

impl TextPlace {
    /// Makes an error at this location.
    pub(crate) fn fault(self, problem: impl Display) -> TextFault {
        TextFault { at: self, problem: problem.to_string() }
    }
}

/// An error at a location in a text file.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("line {}, column {}: {problem}", at.line, at.column)]
pub(crate) struct TextFault {
    pub(crate) at: TextPlace,
    /// The error, and in some cases the remedy.
    pub(crate) problem: String,
}

/// An error that ends the import of a scene in text files.
#[derive(Debug, thiserror::Error)]
pub(crate) enum ImportError {
    /// An error at a location in the text; [`TextFiles::error`] adds the path of the file.
    #[error(transparent)]
    Text(#[from] TextFault),
    /// Another error: a missing or damaged file, too little memory …
    #[error(transparent)]
    Scene(Box<SceneError>),
}

impl From<SceneError> for ImportError {
    fn from(error: SceneError) -> Self {
        Self::Scene(Box::new(error))
    }
}

/// The result of an import step.
pub(crate) type ImportResult<T> = Result<T, ImportError>;

/// The text files of a scene: the scene file and those that it includes.
#[derive(Debug)]
pub(crate) struct TextFiles {
    /// Name for messages and path of each file, by [`TextPlace::file`].
    files: Vec<(String, PathBuf)>,
}

impl TextFiles {
    /// Makes the list with the scene file.
    pub(crate) fn new(path: &Path) -> Self {
        let name = path.file_name().map(|name| name.to_string_lossy().into_owned()).unwrap_or_default();
        Self { files: vec![(name, path.to_path_buf())] }
    }

    /// Registers an included file. Returns its index.
    pub(crate) fn add(&mut self, name: impl Into<String>, path: impl Into<PathBuf>) -> u32 {
        self.files.push((name.into(), path.into()));
        self.files.len() as u32 - 1
    }

    /// Returns the path of a file.
    pub(crate) fn path(&self, file: u32) -> &Path {
        &self.files[file as usize].1
    }

    /// Returns the name of a file, relative to the folder of the scene.
    pub(crate) fn name(&self, file: u32) -> &str {
        &self.files[file as usize].0
    }

    /// Formats a location as `file:line:column`; empty without a line.
    pub(crate) fn show(&self, at: TextPlace) -> String {
        if at.line == 0 {
            return String::new();
        }
        format!("{}:{}:{}", shortened(self.name(at.file)), at.line, at.column)
    }

    /// Converts to the error for the user.
    pub(crate) fn error(&self, error: ImportError) -> SceneError {
        match error {
            ImportError::Scene(error) => *error,
            ImportError::Text(TextFault { at, problem }) => SceneError::Text {
                path: self.path(at.file).into(),
                line: at.line as usize,
                column: at.column as usize,
                problem,
            },
        }
    }
}
