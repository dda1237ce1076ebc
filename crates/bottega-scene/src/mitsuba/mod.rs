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
mod importer;
mod integrator;
mod medium;
mod mesh;
mod needless;
mod placement;
mod read;
mod report;
mod sdf;
mod sensor;
mod shape;
mod shared;
mod sky;
mod slide;
mod solids;
mod texture;
mod transform;
mod value;
mod volume;
mod xml;

use std::collections::BTreeMap;
use std::path::Path;

use bottega_image::WhitePoint;
use document::{Class, Document, ObjectId};
use glam::DMat4;
use importer::{Importer, Manner};
use report::ImportReport;
use shared::SharedMeshes;

use crate::error::Warnings;
use crate::hints::{Metadata, RenderHints};
use crate::image::Pictures;
use crate::import::{ImportRequest, Imported};
use crate::{Scene, SceneError};

/// Whether a file looks like one of ours: by its name, or by its outermost element.
pub(crate) fn recognizes(path: &Path, file: &[u8]) -> bool {
    // UTF-16 has zeros between the letters.
    let start: Vec<u8> = file.iter().take(4096).copied().filter(|&byte| byte != 0).collect();
    path.extension().is_some_and(|extension| extension.eq_ignore_ascii_case("xml"))
        || start.windows(7).any(|window| window == b"<scene " || window == b"<scene>")
}

/// Builds the scene of a file. Lights and cameras may be missing from it.
pub(crate) fn import(request: &ImportRequest<'_>, warnings: &mut Warnings) -> Result<Imported, SceneError> {
    let &ImportRequest { path, file, options, origin, resources } = request;
    let mut report = ImportReport::new(path);
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
        manner: Manner::default(),
        conversions: 0,
        materials: BTreeMap::new(),
        media: BTreeMap::new(),
        groups: BTreeMap::new(),
        shared: SharedMeshes::new(&document),
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
    slide::add_slides(&mut scene, &slides, resources.budget(), path)?;
    let metadata = Metadata {
        format: if document.is_old { "Mitsuba 0.x" } else { "Mitsuba 3" },
        generator: None,
        extensions: Vec::new(),
    };
    Ok((scene, metadata, hints))
}

impl Importer<'_> {
    /// An object of the scene itself.
    pub(super) fn root(&mut self, id: ObjectId) -> Result<(), SceneError> {
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
}
