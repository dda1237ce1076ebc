//! The context of an import: the objects of the file, the files that they refer to, and warnings.

use std::cell::Cell;

use glam::{DMat4, DVec3};

use super::document::{Document, Object, ObjectId};
use super::needless::NEEDLESS;
use super::report::ImportReport;
use crate::error::SceneError;
use crate::import::text_place::{ImportResult, TextPlace};
use crate::measured::MeasuredFiles;
use crate::resource::{Location, Resources};
use crate::text::shortened;

/// Limit of conversions per object of the file, on average: nested references can grow exponentially.
const CONVERSIONS_PER_OBJECT: usize = 64;

/// Number of conversions that is always allowed.
const CONVERSIONS_MIN: usize = 1 << 14;

/// The objects of a scene file, the files that they refer to, and warnings.
pub(super) struct ImportContext<'a> {
    pub(super) document: &'a Document,
    pub(super) resources: &'a Resources<'a>,
    /// Offset that is subtracted from all world positions.
    pub(super) origin: DVec3,
    pub(super) measured: MeasuredFiles,
    /// Files and warnings, for messages.
    pub(super) report: ImportReport,
    /// Number of conversions so far, which is limited.
    conversions: usize,
    /// Objects that were converted, by their [`ObjectId`]: their unread values are reported.
    visited: Vec<bool>,
}

impl<'a> ImportContext<'a> {
    /// Makes the context of a document.
    pub(super) fn new(
        document: &'a Document,
        resources: &'a Resources<'a>,
        origin: DVec3,
        report: ImportReport,
    ) -> Self {
        let (measured, visited) = (MeasuredFiles::default(), vec![false; document.objects.len()]);
        Self { document, resources, origin, measured, report, conversions: 0, visited }
    }

    /// Returns the world transformation of an object.
    pub(super) fn to_world(&self, object: &Object) -> ImportResult<DMat4> {
        Ok(DMat4::from_translation(-self.origin) * object.transform("to_world")?)
    }

    /// Returns an object for conversion, and marks it as visited.
    pub(super) fn visit(&mut self, id: ObjectId) -> ImportResult<&'a Object> {
        let document = self.document;
        let object = document.get(id);
        self.visited[id.0] = true;
        self.conversions += 1;
        if self.conversions > CONVERSIONS_MIN + CONVERSIONS_PER_OBJECT * document.objects.len() {
            return Err(object.at.fault("references multiply without end").into());
        }
        Ok(object)
    }

    /// Warns that something at a location was left out or replaced.
    pub(super) fn warn(&mut self, at: TextPlace, message: impl Into<String>) {
        self.report.warn(at, message);
    }

    /// Notes something unexpected at a location that does not change the picture.
    pub(super) fn note(&mut self, at: TextPlace, message: impl Into<String>) {
        self.report.note(at, message);
    }

    /// Formats a location as `file:line:column`.
    pub(super) fn place(&self, at: TextPlace) -> String {
        self.report.files.show(at)
    }

    /// Books memory for something at a location.
    pub(super) fn take(&self, at: TextPlace, bytes: usize) -> ImportResult<()> {
        self.placed(at, self.resources.budget().take(self.report.files.path(at.file), "", bytes))
    }

    /// Checks that memory for something at a location is available, without booking it.
    pub(super) fn check_memory(&self, at: TextPlace, bytes: usize) -> ImportResult<()> {
        self.placed(at, self.resources.budget().check(self.report.files.path(at.file), bytes))
    }

    /// Adds the location to a memory error, which is formatted only then: there may be millions of shapes.
    fn placed(&self, at: TextPlace, taken: Result<(), SceneError>) -> ImportResult<()> {
        Ok(taken.map_err(|error| match error {
            SceneError::Limit { path, problem, remedy, .. } => {
                SceneError::Limit { path, place: self.place(at), problem, remedy }
            }
            other => other,
        })?)
    }

    /// Finds a referenced file: beside the scene, in the search folders, or beside the referring file.
    pub(super) fn find(&self, reference: &str, at: TextPlace) -> ImportResult<Location> {
        let place = self.place(at);
        let beside = match self.report.files.name(at.file).rsplit_once('/') {
            Some((folder, _)) if at.file > 0 => Some(folder),
            _ => None,
        };
        let others = self.document.search_folders.iter().map(String::as_str).chain(beside);
        let folders: Vec<&str> = std::iter::once("").chain(others).collect();
        Ok(self.resources.locate_in(&folders, reference, &place)?)
    }

    /// Returns the location of a required `filename`.
    pub(super) fn filename(&self, object: &Object) -> ImportResult<Location> {
        let Some(name) = object.string("filename")? else {
            return Err(object.at.fault(format!("the {} has no `filename`", object.describe())).into());
        };
        let at = object.property("filename").map_or(object.at, |property| property.at);
        self.find(name, at)
    }

    /// Reports properties and nested objects that were not read, except those that have no effect.
    pub(super) fn report_unused(&mut self) {
        let document = self.document;
        for (object, visited) in document.objects.iter().zip(&self.visited) {
            if !visited {
                continue;
            }
            let is_needless = |name: &str| NEEDLESS.iter().any(|row| row.covers(&object.class, &object.plugin, name));
            let is_left = |used: &Cell<bool>, name: &str| !used.get() && !is_needless(name);
            for property in object.properties.iter().filter(|it| is_left(&it.used, &it.name)) {
                let name = shortened(&property.name);
                self.report.warn(property.at, format!("`{name}` of the {} is left out", object.describe()));
            }
            for child in object.children.iter().filter(|it| is_left(&it.used, &it.name)) {
                let inner = document.get(child.object).describe();
                self.report.warn(child.at, format!("the {inner} within the {} is left out", object.describe()));
            }
        }
    }
}
