//! Mitsuba 3 scenes in XML, and those of the 0.x line, whose names run their words together (`maxDepth`).
//!
//! What is not supported is named with file, line and column, and replaced: a bsdf by gray diffuse, others are left out.
//! Unknown properties are named too. With [`LoadOptions::strict`](crate::LoadOptions::strict) each of these is an error.
//!
//! Sides: Mitsuba decides them by the shading frame, we by the winding of triangles; triangles that disagree with their
//! vertex normals are turned over. Curved shapes that we have no analytic one for (cylinders, disks, unevenly scaled
//! spheres) become triangles with exact normals, whose chords stay within 10⁻⁴ of the radius. Curves become tubes of
//! triangles: round ones of 32 sides, down to 5 where there are very many. Surfaces of grids of distances become some million
//! triangles.

mod attribute;
mod bsdf;
mod color;
mod curve;
mod document;
mod emitter;
mod integrator;
mod medium;
mod mesh;
mod read;
mod report;
mod sdf;
mod sensor;
mod shape;
mod sky;
mod solids;
mod texture;
mod transform;
mod value;
mod volume;
mod xml;

use std::collections::BTreeMap;
use std::path::Path;

use bottega_image::WhitePoint;
use document::{Class, Document, Object, ObjectId};
use glam::{DMat4, DVec3};
use report::Report;
use xml::Place;

use crate::error::Warnings;
use crate::image::Pictures;
use crate::load::{Imported, Metadata, RenderHints, Request};
use crate::resource::{Location, Resources};
use crate::text::shortened;
use crate::{Scene, SceneError};

/// Conversions for each object of the file, on average: references that double at every step would never end.
const CONVERSIONS_PER_OBJECT: usize = 64;

/// Conversions that are always allowed.
const CONVERSIONS_MIN: usize = 1 << 14;

/// Whether a file looks like one of ours: by its name, or by its outermost element.
pub(crate) fn recognizes(path: &Path, file: &[u8]) -> bool {
    // UTF-16 has zeros between the letters.
    let start: Vec<u8> = file.iter().take(4096).copied().filter(|&byte| byte != 0).collect();
    path.extension().is_some_and(|extension| extension.eq_ignore_ascii_case("xml"))
        || start.windows(7).any(|window| window == b"<scene " || window == b"<scene>")
}

/// Builds the scene of a file. Lights and cameras may be missing from it.
pub(crate) fn import(request: &Request<'_>, warnings: &mut Warnings) -> Result<Imported, SceneError> {
    let &Request { path, file, options, origin, resources } = request;
    let mut report = Report::new(path);
    let document = Document::read(file, options, resources, &mut report)?;
    let mut importer = Importer {
        document: &document,
        resources,
        origin,
        report,
        pictures: Pictures::new(resources, options).with_white_point(WhitePoint::Absolute),
        scene: Scene::default(),
        hints: RenderHints::default(),
        slides: Vec::new(),
        manner: integrator::Manner::default(),
        conversions: 0,
        materials: BTreeMap::new(),
        media: BTreeMap::new(),
        groups: BTreeMap::new(),
        shared: shape::Shared::new(&document),
        visited: vec![false; document.objects.len()],
        wants_vertex_colors: false,
        wants_face_colors: false,
        is_blended: false,
        awaited: Vec::new(),
        awaited_by: BTreeMap::new(),
    };
    for &root in &document.roots {
        importer.root(root)?;
    }
    importer.apply_manner();
    importer.report_unused();
    let Importer { report, pictures, mut scene, hints, slides, .. } = importer;
    report.finish(warnings);
    scene.images = pictures.load(warnings)?;
    emitter::add_slides(&mut scene, &slides, resources.budget(), path)?;
    let metadata = Metadata {
        format: if document.is_old { "Mitsuba 0.x" } else { "Mitsuba 3" },
        generator: None,
        extensions: Vec::new(),
    };
    Ok((scene, metadata, hints))
}

/// The scene as it grows.
struct Importer<'a> {
    document: &'a Document,
    resources: &'a Resources<'a>,
    /// What is taken from all places of the world.
    origin: DVec3,
    report: Report,
    pictures: Pictures<'a>,
    scene: Scene,
    hints: RenderHints,
    /// Pictures of spots, each with the index of its light.
    slides: Vec<(usize, emitter::Slide)>,
    manner: integrator::Manner,
    conversions: usize,
    /// What was made of a bsdf with an emitter and media.
    materials: BTreeMap<bsdf::MaterialKey, (u32, bsdf::Needs)>,
    media: BTreeMap<ObjectId, crate::MediumId>,
    groups: BTreeMap<ObjectId, shape::Group>,
    shared: shape::Shared,
    /// Objects that were looked at: what they hold and nobody asked for is not known.
    visited: Vec<bool>,
    /// Whether a texture of the material that is being made is the colours of the mesh.
    wants_vertex_colors: bool,
    /// The same of the colours of its faces.
    wants_face_colors: bool,
    /// Whether the bsdf that is being made is one of several of its material.
    is_blended: bool,
    /// Attributes of the mesh that textures of the material that is being made wait for.
    awaited: Vec<attribute::Awaited>,
    /// The same, by the material.
    awaited_by: BTreeMap<u32, Vec<attribute::Awaited>>,
}

impl<'a> Importer<'a> {
    /// An object of the scene itself.
    fn root(&mut self, id: ObjectId) -> Result<(), SceneError> {
        let object = self.document.get(id);
        match object.class {
            Class::Shape => self.add_shape(id, DMat4::from_translation(-self.origin)),
            Class::Emitter => self.add_emitter(id),
            Class::Sensor => self.add_sensor(id),
            Class::Integrator => self.read_integrator(id),
            // Used where they are referred to.
            Class::Bsdf | Class::Texture | Class::Medium | Class::Phase | Class::Volume => Ok(()),
            Class::Film | Class::Filter | Class::Sampler | Class::Other => {
                self.report.warn(object.at, format!("the {} belongs nowhere and is left out", object.describe()));
                Ok(())
            }
        }
    }

    /// Where an object of the world stands.
    fn to_world(&self, object: &Object) -> Result<DMat4, SceneError> {
        Ok(DMat4::from_translation(-self.origin) * self.bad(object.transform("to_world"))?)
    }

    /// An object that is about to be converted.
    fn visit(&mut self, id: ObjectId) -> Result<&'a Object, SceneError> {
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
    fn take(&self, at: Place, bytes: usize) -> Result<(), SceneError> {
        self.placed(at, self.resources.budget().take(self.report.path(at.file), "", bytes))
    }

    /// Adds the place to a refusal of memory. Only then: shapes may be millions.
    fn placed(&self, at: Place, taken: Result<(), SceneError>) -> Result<(), SceneError> {
        taken.map_err(|error| match error {
            SceneError::Limit { path, problem, remedy, .. } => {
                SceneError::Limit { path, place: self.report.show(at), problem, remedy }
            }
            other => other,
        })
    }

    /// A problem with a value as an error.
    fn bad<T>(&self, result: Result<T, (Place, String)>) -> Result<T, SceneError> {
        result.map_err(|(at, problem)| self.report.invalid(at, problem))
    }

    /// A number that is at least `least`, else the default.
    fn number_at_least(&self, object: &Object, name: &str, least: f64, default: f64) -> Result<f64, SceneError> {
        let number = self.bad(object.float(name))?.unwrap_or(default);
        if number < least {
            let at = object.property(name).map_or(object.at, |property| property.at);
            return Err(self.report.invalid(at, format!("`{name}` is below {least}")));
        }
        Ok(number)
    }

    /// Finds a file that the scene refers to: beside the scene, in the folders that it names, or beside the file that
    /// refers to it.
    fn find(&self, reference: &str, at: Place) -> Result<Location, SceneError> {
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
    fn filename(&self, object: &Object) -> Result<Location, SceneError> {
        let Some(name) = self.bad(object.string("filename"))? else {
            return Err(self.report.invalid(object.at, format!("the {} has no `filename`", object.describe())));
        };
        let at = object.property("filename").map_or(object.at, |property| property.at);
        self.find(name, at)
    }

    /// Tells of properties and children that nobody asked for.
    fn report_unused(&mut self) {
        let document = self.document;
        for (object, visited) in document.objects.iter().zip(&self.visited) {
            if !visited {
                continue;
            }
            for property in object.properties.iter().filter(|property| !property.used.get()) {
                let name = shortened(&property.name);
                self.report.warn(property.at, format!("`{name}` of the {} is left out", object.describe()));
            }
            for child in object.children.iter().filter(|child| !child.used.get()) {
                let inner = document.get(child.object).describe();
                self.report.warn(child.at, format!("the {inner} within the {} is left out", object.describe()));
            }
        }
    }
}
