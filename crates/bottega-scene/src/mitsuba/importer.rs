//! The scene as it grows, and what all parts of the importer ask of it.

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

/// Conversions for each object of the file, on average: references that double at every step would never end.
const CONVERSIONS_PER_OBJECT: usize = 64;

/// Conversions that are always allowed.
const CONVERSIONS_MIN: usize = 1 << 14;

/// The scene as it grows.
pub(super) struct Importer<'a> {
    pub(super) document: &'a Document,
    pub(super) resources: &'a Resources<'a>,
    /// What is taken from all places of the world.
    pub(super) origin: DVec3,
    pub(super) report: ImportReport,
    pub(super) pictures: Pictures<'a>,
    pub(super) scene: Scene,
    pub(super) hints: RenderHints,
    /// Pictures of spots, each with the index of its light.
    pub(super) slides: Vec<(usize, Slide)>,
    pub(super) manner: Manner,
    pub(super) conversions: usize,
    /// What was made of a bsdf with an emitter and media.
    pub(super) materials: BTreeMap<MaterialKey, (u32, MeshNeeds)>,
    pub(super) media: BTreeMap<ObjectId, MediumId>,
    pub(super) groups: BTreeMap<ObjectId, Group>,
    pub(super) shared: SharedMeshes,
    /// Objects that were looked at: what they hold and nobody asked for is not known.
    pub(super) visited: Vec<bool>,
    /// Whether a texture of the material that is being made is the colours of the mesh.
    pub(super) wants_vertex_colors: bool,
    /// The same of the colours of its faces.
    pub(super) wants_face_colors: bool,
    /// Whether the bsdf that is being made is one of several of its material.
    pub(super) is_blended: bool,
    /// Attributes of the mesh that textures of the material that is being made wait for.
    pub(super) awaited: Vec<AwaitedTexture>,
    /// The same, by the material.
    pub(super) awaited_by: BTreeMap<u32, Vec<AwaitedTexture>>,
}

impl<'a> Importer<'a> {
    /// Where an object of the world stands.
    pub(super) fn to_world(&self, object: &Object) -> Result<DMat4, SceneError> {
        Ok(DMat4::from_translation(-self.origin) * self.bad(object.transform("to_world"))?)
    }

    /// An object that is about to be converted.
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

    /// Books memory for what stands at a place.
    pub(super) fn take(&self, at: XmlPlace, bytes: usize) -> Result<(), SceneError> {
        self.placed(at, self.resources.budget().take(self.report.path(at.file), "", bytes))
    }

    /// Adds the place to a refusal of memory. Only then: shapes may be millions.
    pub(super) fn placed(&self, at: XmlPlace, taken: Result<(), SceneError>) -> Result<(), SceneError> {
        taken.map_err(|error| match error {
            SceneError::Limit { path, problem, remedy, .. } => {
                SceneError::Limit { path, place: self.report.show(at), problem, remedy }
            }
            other => other,
        })
    }

    /// A problem with a value as an error.
    pub(super) fn bad<T>(&self, result: Result<T, (XmlPlace, String)>) -> Result<T, SceneError> {
        result.map_err(|(at, problem)| self.report.invalid(at, problem))
    }

    /// A number that is at least `least`, else the default.
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

    /// Finds a file that the scene refers to: beside the scene, in the folders that it names, or beside the file that
    /// refers to it.
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

    /// The name of a file that must be there.
    pub(super) fn filename(&self, object: &Object) -> Result<Location, SceneError> {
        let Some(name) = self.bad(object.string("filename"))? else {
            return Err(self.report.invalid(object.at, format!("the {} has no `filename`", object.describe())));
        };
        let at = object.property("filename").map_or(object.at, |property| property.at);
        self.find(name, at)
    }

    /// Tells of properties and children that nobody asked for, but for those that change nothing.
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

/// What a material is made of: bsdf, emitter, interior and exterior medium.
pub(super) type MaterialKey = (Option<ObjectId>, Option<ObjectId>, Option<MediumId>, Option<MediumId>);

/// A texture that waits for its mesh.
#[derive(Clone, Debug)]
pub(super) struct AwaitedTexture {
    pub(super) name: String,
    /// Its picture, which is 0.5 until the mesh is there.
    pub(super) image: ImageId,
    /// Whether its luminance is wanted.
    pub(super) is_number: bool,
}

/// What an integrator makes of the scene beside following its light.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Manner {
    /// Whether what goes straight through thin panes is no bounce, and lamps shine through them.
    pub(super) sees_through_panes: bool,
    /// Whether there are no media for it.
    pub(super) ignores_media: bool,
    /// Whether the camera does not see what shines.
    pub(super) hides_emitters: bool,
    pub(super) at: XmlPlace,
}
