//! The shared context of the importer: files, options and warnings.

use std::path::{Path, PathBuf};

use glam::DVec3;

use super::needless::{Directive, NEEDLESS};
use super::params::Params;
use super::token::{PbrtFault, PbrtPlace};
use crate::SceneError;
use crate::error::Warnings;
use crate::options::LoadOptions;
use crate::resource::Resources;
use crate::text::shortened;

/// An error that ends the import.
#[derive(Debug)]
pub(super) enum Stop {
    /// An error in the text.
    Fault(PbrtFault),
    /// Another error: a missing or damaged file, too little memory …
    Scene(Box<SceneError>),
}

impl From<PbrtFault> for Stop {
    fn from(fault: PbrtFault) -> Self {
        Self::Fault(fault)
    }
}

impl From<SceneError> for Stop {
    fn from(error: SceneError) -> Self {
        Self::Scene(Box::new(error))
    }
}

/// The result of an import step.
pub(super) type PbrtResult<T> = Result<T, Stop>;

/// Files, options and warnings of an import.
pub(super) struct Context<'a> {
    pub(super) resources: &'a Resources<'a>,
    pub(super) options: &'a LoadOptions,
    /// Offset that is subtracted from all world positions.
    pub(super) origin: DVec3,
    warnings: &'a mut Warnings,
    /// Display name and path of each file, by [`PbrtPlace::file`].
    files: Vec<(String, PathBuf)>,
}

impl<'a> Context<'a> {
    /// Makes the context of a scene file.
    pub(super) fn new(
        path: &Path,
        resources: &'a Resources<'a>,
        options: &'a LoadOptions,
        warnings: &'a mut Warnings,
    ) -> Self {
        let mut context = Self { resources, options, origin: DVec3::ZERO, warnings, files: Vec::new() };
        context.add_file(path.file_name().map(|name| name.to_string_lossy()).unwrap_or_default(), path);
        context
    }

    /// Registers a file. Returns its number.
    pub(super) fn add_file(&mut self, name: impl Into<String>, path: impl Into<PathBuf>) -> u32 {
        self.files.push((name.into(), path.into()));
        self.files.len() as u32 - 1
    }

    /// Returns the path of a file.
    pub(super) fn path(&self, file: u32) -> &Path {
        &self.files[file as usize].1
    }

    /// Formats a location: file, line and column.
    pub(super) fn place(&self, at: PbrtPlace) -> String {
        format!("{}:{}:{}", shortened(&self.files[at.file as usize].0), at.line, at.column)
    }

    /// Warns about something unusual or slightly different.
    pub(super) fn warn(&mut self, at: PbrtPlace, message: impl Into<String>) {
        let place = self.place(at);
        self.warnings.add(place, message);
    }

    /// Reports an unsupported feature.
    pub(super) fn unsupported(&mut self, at: PbrtPlace, message: impl Into<String>) {
        let place = self.place(at);
        self.warnings.unsupported(place, message);
    }

    /// Returns the warnings.
    pub(super) fn warnings(&mut self) -> &mut Warnings {
        self.warnings
    }

    /// Reports parameters that were not read, except those that have no effect.
    ///
    /// - `kind`: type that follows the directive.
    pub(super) fn report_unused(&mut self, directive: Directive, kind: &str, params: &Params) {
        let is_needless = |name: &str| NEEDLESS.iter().any(|row| row.covers(&directive, kind, name));
        for param in params.unused().filter(|param| !is_needless(&param.name)) {
            let message = format!("the parameter \"{} {}\" is not known here", param.kind, shortened(&param.name));
            self.unsupported(param.at, message);
        }
    }

    /// Converts to the error for the user.
    pub(super) fn error(&self, stop: Stop) -> SceneError {
        match stop {
            Stop::Scene(error) => *error,
            Stop::Fault(PbrtFault { at, problem }) => SceneError::Text {
                path: self.path(at.file).into(),
                line: at.line as usize,
                column: at.column as usize,
                problem,
            },
        }
    }
}
