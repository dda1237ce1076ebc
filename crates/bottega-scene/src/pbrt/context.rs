//! The shared context of the importer: files, options and warnings.

use std::path::{Path, PathBuf};

use glam::DVec3;

use super::needless::{Directive, NEEDLESS};
use super::params::Params;
use crate::error::{SceneError, Warnings};
use crate::import::text_place::{ImportError, ImportResult, TextFiles, TextPlace};
use crate::measured::MeasuredFiles;
use crate::options::LoadOptions;
use crate::resource::Resources;
use crate::text::shortened;

/// Files, options and warnings of an import.
pub(super) struct Context<'a> {
    pub(super) resources: &'a Resources<'a>,
    pub(super) options: &'a LoadOptions,
    /// Offset that is subtracted from all world positions.
    pub(super) origin: DVec3,
    pub(super) measured: MeasuredFiles,
    warnings: &'a mut Warnings,
    /// The scene file and those that it includes.
    files: TextFiles,
}

impl<'a> Context<'a> {
    /// Makes the context of a scene file.
    pub(super) fn new(
        path: &Path,
        resources: &'a Resources<'a>,
        options: &'a LoadOptions,
        warnings: &'a mut Warnings,
    ) -> Self {
        Self {
            resources,
            options,
            origin: DVec3::ZERO,
            measured: MeasuredFiles::default(),
            warnings,
            files: TextFiles::new(path),
        }
    }

    /// Registers an included file. Returns its index.
    pub(super) fn add_file(&mut self, name: impl Into<String>, path: impl Into<PathBuf>) -> u32 {
        self.files.add(name, path)
    }

    /// Returns the path of a file.
    pub(super) fn path(&self, file: u32) -> &Path {
        self.files.path(file)
    }

    /// Formats a location: file, line and column.
    pub(super) fn place(&self, at: TextPlace) -> String {
        self.files.show(at)
    }

    /// Books memory for something at a location.
    pub(super) fn take(&self, at: TextPlace, bytes: usize) -> ImportResult<()> {
        Ok(self.resources.budget().take(self.path(at.file), &self.place(at), bytes)?)
    }

    /// Warns about something unusual or slightly different.
    pub(super) fn warn(&mut self, at: TextPlace, message: impl Into<String>) {
        let place = self.place(at);
        self.warnings.add(place, message);
    }

    /// Reports an unsupported feature.
    pub(super) fn unsupported(&mut self, at: TextPlace, message: impl Into<String>) {
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
            let message = format!("the parameter \"{} {}\" is unknown here", param.kind, shortened(&param.name));
            self.unsupported(param.at, message);
        }
    }

    /// Converts to the error for the user.
    pub(super) fn error(&self, error: ImportError) -> SceneError {
        self.files.error(error)
    }
}
