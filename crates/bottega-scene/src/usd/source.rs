//! The stage at a time, and the messages about it.

use std::cell::RefCell;
use std::collections::{BTreeMap, BTreeSet};
use std::rc::Rc;

use glam::DVec3;
use openusd::sdf::{AssetPath, Value};
use openusd::usd::{Prim, Stage, TimeCode};

use super::files::Files;
use super::{error, values};
use crate::error::{SceneError, Warnings};
use crate::import::request::ImportRequest;
use crate::subdivision::Subdivision;

/// The time of values that do not change: the earliest sample counts.
pub(super) const STILL: f64 = TimeCode::EARLIEST.value();

/// A composed stage, what it is read for, and the warnings about it.
pub(super) struct StageSource<'a> {
    pub(super) request: &'a ImportRequest<'a>,
    pub(super) files: &'a Files<'a>,
    pub(super) stage: Stage,
    warnings: RefCell<Warnings>,
    /// Places and messages of the warnings, each given once.
    reported: RefCell<BTreeSet<(String, String)>>,
    /// Refinements of meshes that may move, by the path of the prim, with a digest of the connectivity.
    pub(super) subdivisions: RefCell<BTreeMap<String, (blake3::Hash, Rc<Subdivision>)>>,
}

/// A file that an attribute names.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct NamedFile {
    /// The reference as authored.
    pub(super) reference: String,
    /// Its name among the files of the stage; `None`: there is no such file.
    pub(super) name: Option<String>,
}

impl<'a> StageSource<'a> {
    /// Makes a source without warnings.
    pub(super) fn new(request: &'a ImportRequest<'a>, files: &'a Files<'a>, stage: Stage) -> Self {
        let (warnings, reported, subdivisions) = Default::default();
        Self { request, files, stage, warnings, reported, subdivisions }
    }

    /// Adds a warning, unless there is an equal one.
    pub(super) fn warn(&self, place: &str, message: impl Into<String>) {
        let message = message.into();
        if self.reported.borrow_mut().insert((place.to_owned(), message.clone())) {
            self.warnings.borrow_mut().add(place, message);
        }
    }

    /// Reports what is left out or replaced, unless it was reported.
    pub(super) fn unsupported(&self, place: &str, message: impl Into<String>) {
        let message = message.into();
        if self.reported.borrow_mut().insert((place.to_owned(), message.clone())) {
            self.warnings.borrow_mut().unsupported(place, message);
        }
    }

    /// Reports something unsupported with the first place where it occurs.
    pub(super) fn unsupported_once(&self, place: &str, message: &str) {
        if self.reported.borrow_mut().insert((String::new(), message.to_owned())) {
            self.warnings.borrow_mut().unsupported(place, message);
        }
    }

    /// Adds a warning with the first place where it occurs.
    pub(super) fn warn_once(&self, place: &str, message: &str) {
        if self.reported.borrow_mut().insert((String::new(), message.to_owned())) {
            self.warnings.borrow_mut().add(place, message);
        }
    }

    /// Takes all warnings.
    pub(super) fn take_warnings(&self) -> Warnings {
        self.warnings.take()
    }

    /// Books memory of something at a place.
    pub(super) fn take(&self, place: &str, bytes: usize) -> Result<(), SceneError> {
        self.request.resources.budget().take(self.request.path, place, bytes)
    }

    /// Returns the result of a query of the library; an error is a warning.
    pub(super) fn or_warn<T, E>(&self, place: &str, result: Result<T, E>) -> T
    where
        T: Default,
        E: AsRef<dyn std::error::Error + 'static>,
    {
        result.unwrap_or_else(|fault| {
            self.unsupported(place, format!("{}; it is left out", error::chain(fault.as_ref())));
            T::default()
        })
    }

    /// Returns the value of an attribute at a time code; `None`: it has none.
    pub(super) fn value(&self, prim: &Prim, name: &str, time: f64) -> Option<Value> {
        let value = prim.attribute(name.to_owned()).get_at::<Value>(TimeCode::new(time));
        let value = match value {
            Ok(value) => value,
            Err(fault) => {
                let place = format!("{}.{name}", prim.path());
                self.unsupported(&place, format!("{}; it is left out", error::chain(fault.as_ref())));
                None
            }
        };
        value.filter(|value| !matches!(value, Value::None | Value::ValueBlock))
    }

    /// Returns the value of an attribute as another type. `None`: it has none, or one of the wrong type, which is a
    /// warning.
    pub(super) fn read<T>(
        &self,
        prim: &Prim,
        name: &str,
        time: f64,
        convert: impl FnOnce(&Value) -> Option<T>,
    ) -> Option<T> {
        let value = self.value(prim, name, time)?;
        let converted = convert(&value);
        if converted.is_none() {
            let kind: &'static str = (&value).into();
            self.unsupported(&format!("{}.{name}", prim.path()), format!("a value of the type {kind} is left out"));
        }
        converted
    }

    /// Returns the number of an attribute; `None`: it has none, or it is not finite, which is a warning.
    pub(super) fn number(&self, prim: &Prim, name: &str, time: f64) -> Option<f64> {
        let number = self.read(prim, name, time, values::number)?;
        if !number.is_finite() {
            self.warn(&format!("{}.{name}", prim.path()), format!("{number} is left out"));
        }
        Some(number).filter(|number| number.is_finite())
    }

    /// Returns the token or string of an attribute; `None` as for [`Self::read`].
    pub(super) fn text(&self, prim: &Prim, name: &str, time: f64) -> Option<String> {
        self.read(prim, name, time, values::text)
    }

    /// Returns the truth value of an attribute; `None` as for [`Self::read`].
    pub(super) fn boolean(&self, prim: &Prim, name: &str, time: f64) -> Option<bool> {
        self.read(prim, name, time, values::boolean)
    }

    /// Returns the colour or vector of an attribute; `None` as for [`Self::read`], or it is not finite.
    pub(super) fn vector(&self, prim: &Prim, name: &str, time: f64) -> Option<DVec3> {
        self.read(prim, name, time, values::vector).filter(|vector| vector.is_finite())
    }

    /// Returns metadata of a property that is a token or string; `None`: there is none.
    pub(super) fn metadata(&self, property: &openusd::sdf::Path, key: &str) -> Option<String> {
        let value = self.stage.attribute(property.clone()).get_metadata::<Value>(key);
        values::text(&self.or_warn(property.as_str(), value)?)
    }

    /// Returns the file that an attribute names; `None`: it names none.
    pub(super) fn file(&self, prim: &Prim, name: &str, time: f64) -> Option<NamedFile> {
        match self.value(prim, name, time)? {
            Value::AssetPath(asset) => named_file(&asset),
            Value::String(text) if !text.is_empty() => {
                let name = self.files.named("", &text).ok().filter(|name| self.files.exists(name));
                Some(NamedFile { reference: text, name })
            }
            _ => None,
        }
    }

    /// Returns the type of a prim; empty if it has none.
    pub(super) fn type_of(&self, prim: &Prim) -> String {
        let name = self.or_warn(prim.path().as_str(), prim.type_name());
        name.map(|name| name.as_str().to_owned()).unwrap_or_default()
    }

    /// Returns the names of the API schemas that are applied to a prim.
    pub(super) fn schemas(&self, prim: &Prim) -> Vec<String> {
        let names = self.or_warn(prim.path().as_str(), prim.api_schemas());
        names.into_iter().map(|name| name.as_str().to_owned()).collect()
    }

    /// Returns the paths that a relationship leads to.
    pub(super) fn targets(&self, prim: &Prim, name: &str) -> Vec<openusd::sdf::Path> {
        let place = format!("{}.{name}", prim.path());
        self.or_warn(&place, prim.relationship(name.to_owned()).forwarded_targets())
    }
}

fn named_file(asset: &AssetPath) -> Option<NamedFile> {
    let reference = asset.evaluated_path().unwrap_or(asset.as_str());
    let name = asset.resolved_path().filter(|name| !name.is_empty()).map(str::to_owned);
    (!reference.is_empty()).then(|| NamedFile { reference: reference.to_owned(), name })
}
