//! The context that all parts of the importer share: the files that were read, and what there is to say about them.

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

/// Why the scene cannot be read.
#[derive(Debug)]
pub(super) enum Stop {
    /// Something in the text.
    Fault(PbrtFault),
    /// Something else: a file that is missing or damaged, too little memory …
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

/// The result of a part of the import.
pub(super) type PbrtResult<T> = Result<T, Stop>;

/// Files, options, warnings.
pub(super) struct Context<'a> {
    pub(super) resources: &'a Resources<'a>,
    pub(super) options: &'a LoadOptions,
    /// What is taken from all places of the world.
    pub(super) origin: DVec3,
    warnings: &'a mut Warnings,
    /// Name for people and path, by the number of a file in [`PbrtPlace`].
    files: Vec<(String, PathBuf)>,
}

impl<'a> Context<'a> {
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

    /// Remembers a file, and gives it a number.
    pub(super) fn add_file(&mut self, name: impl Into<String>, path: impl Into<PathBuf>) -> u32 {
        self.files.push((name.into(), path.into()));
        self.files.len() as u32 - 1
    }

    /// The file with that number.
    pub(super) fn path(&self, file: u32) -> &Path {
        &self.files[file as usize].1
    }

    /// The place for people: file, line and column.
    pub(super) fn place(&self, at: PbrtPlace) -> String {
        format!("{}:{}:{}", shortened(&self.files[at.file as usize].0), at.line, at.column)
    }

    /// Tells of something that is odd, or differs in the last detail.
    pub(super) fn warn(&mut self, at: PbrtPlace, message: impl Into<String>) {
        let place = self.place(at);
        self.warnings.add(place, message);
    }

    /// Tells of something that the scene asks for and does not get.
    pub(super) fn unsupported(&mut self, at: PbrtPlace, message: impl Into<String>) {
        let place = self.place(at);
        self.warnings.unsupported(place, message);
    }

    pub(super) fn warnings(&mut self) -> &mut Warnings {
        self.warnings
    }

    /// Tells of parameters that nobody asked for, but for those that change nothing.
    ///
    /// - `kind`: the type that follows the directive.
    pub(super) fn report_unused(&mut self, directive: Directive, kind: &str, params: &Params) {
        let is_needless = |name: &str| NEEDLESS.iter().any(|row| row.covers(&directive, kind, name));
        for param in params.unused().filter(|param| !is_needless(&param.name)) {
            let message = format!("the parameter \"{} {}\" is not known here", param.kind, shortened(&param.name));
            self.unsupported(param.at, message);
        }
    }

    /// What the user is told.
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
