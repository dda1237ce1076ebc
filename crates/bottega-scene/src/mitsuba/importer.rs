//! The importer's state, shared by all its parts.

use std::cell::Cell;
use std::collections::BTreeMap;

use glam::{DMat4, DVec3};

use super::document::{Document, Object, ObjectId};
use super::needless::NEEDLESS;
use super::report::ImportReport;
use super::shared::{Group, MeshNeeds, SharedMeshes};
use super::slide::Slide;
use super::xml::XmlPlace;
use crate::hints::RenderHints;
use crate::image::Pictures;
use crate::resource::{Location, Resources};
use crate::text::shortened;
use crate::{ImageId, MediumId, Scene, SceneError};

/// Limit of conversions per object of the file, on average: nested references can grow exponentially.
const CONVERSIONS_PER_OBJECT: usize = 64;

/// Number of conversions that is always allowed.
const CONVERSIONS_MIN: usize = 1 << 14;

/// The scene under construction.
pub(super) struct Importer<'a> {
    pub(super) document: &'a Document,
    pub(super) resources: &'a Resources<'a>,
    /// Offset that is subtracted from all world positions.
    pub(super) origin: DVec3,
    /// Files and warnings, for messages.
    pub(super) report: ImportReport,
    pub(super) pictures: Pictures<'a>,
    /// The scene so far.
    pub(super) scene: Scene,
    pub(super) hints: RenderHints,
    /// Pictures of spot lights, each with the index of its light.
    pub(super) slides: Vec<(usize, Slide)>,
    /// Effects of the integrator on the scene.
    pub(super) manner: Manner,
    /// Number of conversions so far, which is limited.
    pub(super) conversions: usize,
    /// Material and mesh needs of each combination of bsdf, emitter and media.
    pub(super) materials: BTreeMap<MaterialKey, (u32, MeshNeeds)>,
    /// Media that were converted.
    pub(super) media: BTreeMap<ObjectId, MediumId>,
    /// Shape groups that were converted.
    pub(super) groups: BTreeMap<ObjectId, Group>,
    /// Meshes that several shapes use.
    pub(super) shared: SharedMeshes,
    /// Objects that were converted: their unread values are reported.
    pub(super) visited: Vec<bool>,
    /// `true`: a texture of the current material uses the mesh's vertex colours.
    pub(super) wants_vertex_colors: bool,
    /// `true`: a texture of the current material uses the mesh's face colours.
    pub(super) wants_face_colors: bool,
    /// `true`: the current bsdf is one of several of its material.
    pub(super) is_blended: bool,
    /// Mesh attributes that textures of the current material use.
    pub(super) awaited: Vec<AwaitedTexture>,
    /// Mesh attributes that each material uses.
    pub(super) awaited_by: BTreeMap<u32, Vec<AwaitedTexture>>,
}

impl<'a> Importer<'a> {
    /// Returns the world transformation of an object.
    pub(super) fn to_world(&self, object: &Object) -> Result<DMat4, SceneError> {
        Ok(DMat4::from_translation(-self.origin) * self.bad(object.transform("to_world"))?)
    }

    /// Returns an object for conversion, and marks it as visited.
    pub(super) fn visit(&mut self, id: ObjectId) -> Result<&'a Object, SceneError> {
        let document = self.document;
        let object = document.get(id);
        self.visited[id.0] = true;
        self.conversions += 1;
        if self.conversions > CONVERSIONS_MIN + CONVERSIONS_PER_OBJECT * document.objects.len() {
            return Err(self.report.invalid(object.at, "references multiply beyond measure"));
        }
        Ok(object)
    }

    /// Books memory for something at a location.
    pub(super) fn take(&self, at: XmlPlace, bytes: usize) -> Result<(), SceneError> {
        self.placed(at, self.resources.budget().take(self.report.path(at.file), "", bytes))
    }

    /// Adds the location to a memory error, which is formatted only then: there may be millions of shapes.
    pub(super) fn placed(&self, at: XmlPlace, taken: Result<(), SceneError>) -> Result<(), SceneError> {
        taken.map_err(|error| match error {
            SceneError::Limit { path, problem, remedy, .. } => {
                SceneError::Limit { path, place: self.report.show(at), problem, remedy }
            }
            other => other,
        })
    }

    /// Converts a problem with a value to an error.
    pub(super) fn bad<T>(&self, result: Result<T, (XmlPlace, String)>) -> Result<T, SceneError> {
        result.map_err(|(at, problem)| self.report.invalid(at, problem))
    }

    /// Returns a number that is at least `least`, or the default if it is not given.
    pub(super) fn number_at_least(
        &self,
        object: &Object,
        name: &str,
        least: f64,
        default: f64,
    ) -> Result<f64, SceneError> {
        let number = self.bad(object.float(name))?.unwrap_or(default);
        if number < least {
            let at = object.property(name).map_or(object.at, |property| property.at);
            return Err(self.report.invalid(at, format!("`{name}` is below {least}")));
        }
        Ok(number)
    }

    /// Finds a referenced file: beside the scene, in the search folders, or beside the referring file.
    pub(super) fn find(&self, reference: &str, at: XmlPlace) -> Result<Location, SceneError> {
        let place = self.report.show(at);
        let beside = match self.report.name(at.file).rsplit_once('/') {
            Some((folder, _)) if at.file > 0 => Some(folder),
            _ => None,
        };
        let others = self.document.search_folders.iter().map(String::as_str).chain(beside);
        let folders: Vec<&str> = std::iter::once("").chain(others).collect();
        self.resources.locate_in(&folders, reference, &place)
    }

    /// Returns the location of a required `filename`.
    pub(super) fn filename(&self, object: &Object) -> Result<Location, SceneError> {
        let Some(name) = self.bad(object.string("filename"))? else {
            return Err(self.report.invalid(object.at, format!("the {} has no `filename`", object.describe())));
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

/// The key of a material: bsdf, emitter, interior and exterior medium.
pub(super) type MaterialKey = (Option<ObjectId>, Option<ObjectId>, Option<MediumId>, Option<MediumId>);

/// A texture that needs its mesh.
#[derive(Clone, Debug)]
pub(super) struct AwaitedTexture {
    /// Name of the mesh attribute.
    pub(super) name: String,
    /// Its picture, which is 0.5 until the mesh is read.
    pub(super) image: ImageId,
    /// `true`: its luminance is used.
    pub(super) is_number: bool,
}

/// The effects of an integrator on the scene beyond light transport.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Manner {
    /// `true`: passing straight through a thin sheet is not a bounce, and lights are visible through it.
    pub(super) sees_through_panes: bool,
    /// `true`: media are ignored.
    pub(super) ignores_media: bool,
    /// `true`: the camera does not see emitters.
    pub(super) hides_emitters: bool,
    /// Location of the integrator.
    pub(super) at: XmlPlace,
}
