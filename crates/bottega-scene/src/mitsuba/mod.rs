//! Importer of Mitsuba 3 and Mitsuba 0.x scenes in XML; names of the latter are in camel case (`maxDepth`).
//!
//! Unsupported features are reported with file, line and column; an unsupported bsdf is replaced by gray diffuse,
//! others are left out. Unknown properties are also reported. With [`LoadOptions::strict`](crate::LoadOptions::strict)
//! each of these is an error.
//!
//! Mitsuba determines the front by the shading frame, we by the winding of triangles, so triangles that disagree with
//! their vertex normals are flipped. Curved shapes without an analytic equivalent (cylinders, disks, unevenly scaled
//! spheres) become triangles with exact normals, whose chords deviate by at most 10⁻⁴ of the radius. Curves become
//! tubes of triangles with 32 sides, down to 5 if there are very many. Surfaces of signed distance grids become about
//! half a million triangles.

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

/// Recognizes a file by its extension or its root element.
pub(crate) fn recognizes(path: &Path, file: &[u8]) -> bool {
    // UTF-16 has zeros between the letters.
    let start: Vec<u8> = file.iter().take(4096).copied().filter(|&byte| byte != 0).collect();
    path.extension().is_some_and(|extension| extension.eq_ignore_ascii_case("xml"))
        || start.windows(7).any(|window| window == b"<scene " || window == b"<scene>")
}

/// Imports a file. The scene may lack lights and cameras.
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
    /// Converts an object at the top of the scene.
    pub(super) fn root(&mut self, id: ObjectId) -> Result<(), SceneError> {
        let object = self.document.get(id);
        match object.class {
            Class::Shape => self.add_shape(id, DMat4::from_translation(-self.origin)),
            Class::Emitter => self.add_emitter(id),
            Class::Sensor => self.add_sensor(id),
            Class::Integrator => self.read_integrator(id),
            // Converted where they are referred to.
            Class::Bsdf | Class::Texture | Class::Medium | Class::Phase | Class::Volume => Ok(()),
            Class::Film | Class::Filter | Class::Sampler | Class::Other => {
                self.report.warn(object.at, format!("the {} belongs nowhere and is left out", object.describe()));
                Ok(())
            }
        }
    }
}
