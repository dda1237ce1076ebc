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
mod boundary;
mod bsdf;
mod color;
mod context;
mod curve;
mod document;
mod emitter;
mod fov;
mod gloss;
mod integrator;
mod looks;
mod material;
mod medium;
mod mesh;
mod needless;
mod orientation;
mod placement;
mod read;
mod report;
mod sdf;
mod sensor;
mod shape;
mod shared;
mod sky;
mod solids;
mod texture;
mod transform;
mod value;
mod volume;
mod xml;

use std::path::Path;

use bottega_image::WhitePoint;
use context::ImportContext;
use document::{Class, Document};
use emitter::Emitters;
use glam::DMat4;
use integrator::read_integrator;
use looks::SceneLooks;
use report::ImportReport;
use sensor::read_sensor;
use shape::Shapes;
use texture::MitsubaTextures;

use crate::error::{SceneError, Warnings};
use crate::hints::{Metadata, RenderHints};
use crate::image::pictures::Pictures;
use crate::import::projector::{Slide, add_slides};
use crate::import::request::{ImportOutput, ImportRequest};
use crate::import::text_place::ImportResult;
use crate::model::Scene;

/// Recognizes a file by its extension or its root element.
pub(crate) fn recognizes(path: &Path, file: &[u8]) -> bool {
    // UTF-16 has zeros between the letters.
    let start: Vec<u8> = file.iter().take(4096).copied().filter(|&byte| byte != 0).collect();
    path.extension().is_some_and(|extension| extension.eq_ignore_ascii_case("xml"))
        || start.windows(7).any(|window| window == b"<scene " || window == b"<scene>")
}

/// A converted scene whose pictures are not loaded yet.
struct ConvertedScene<'a> {
    /// The scene without its pictures.
    scene: Scene,
    pictures: Pictures<'a>,
    /// Pictures of spot lights, each with the index of its light.
    slides: Vec<(usize, Slide)>,
    hints: RenderHints,
}

/// Imports a file. The scene may lack lights and cameras.
pub(crate) fn import(request: &ImportRequest<'_>, warnings: &mut Warnings) -> Result<ImportOutput, SceneError> {
    let &ImportRequest { path, file, options, origin, resources } = request;
    let mut report = ImportReport::new(path);
    let document = Document::read(file, options, resources, &mut report).map_err(|error| report.files.error(error))?;
    let pictures = Pictures::new(resources, options).with_white_point(WhitePoint::Absolute);
    let mut context = ImportContext::new(&document, resources, origin, report);
    let converted = convert(&mut context, pictures).map_err(|error| context.report.files.error(error))?;
    let ConvertedScene { pictures, mut scene, slides, hints } = converted;
    context.report.finish(warnings);
    scene.images = pictures.load(warnings)?.into();
    add_slides(&mut scene, &slides, resources.budget(), path)?;
    let metadata = Metadata {
        format: if document.is_old { "Mitsuba 0.x" } else { "Mitsuba 3" },
        generator: None,
        extensions: Vec::new(),
    };
    Ok((scene, metadata, hints))
}

/// Converts the objects at the top of a document, with all that they refer to.
fn convert<'a>(context: &mut ImportContext<'_>, pictures: Pictures<'a>) -> ImportResult<ConvertedScene<'a>> {
    let mut looks = SceneLooks::new(MitsubaTextures::new(pictures));
    let mut shapes = Shapes::new(context);
    let mut emitters = Emitters::default();
    let (mut cameras, mut shutters) = (Vec::new(), Vec::new());
    let (mut hints, mut effects) = (RenderHints::default(), None);
    for &root in &context.document.roots {
        let object = context.document.get(root);
        match object.class {
            Class::Shape => {
                let to_world = DMat4::from_translation(-context.origin);
                shapes.add(context, &mut looks, root, to_world)?;
            }
            Class::Emitter => emitters.add(context, &mut looks.textures, root)?,
            Class::Sensor => {
                let (camera, shutter) = read_sensor(context, &mut looks, &mut hints, root)?;
                shutters.push((shutter, object.at));
                cameras.push(camera);
            }
            Class::Integrator => effects = read_integrator(context, &mut hints, root)?.or(effects),
            // Converted where they are referred to.
            Class::Bsdf | Class::Texture | Class::Medium | Class::Phase | Class::Volume => {}
            Class::Film | Class::Filter | Class::Sampler | Class::Other => {
                context.warn(object.at, format!("the {} is out of place and is left out", object.describe()));
            }
        }
    }
    let Emitters { lights, environment, slides } = emitters;
    let mut scene = Scene {
        materials: looks.materials.list,
        media: looks.media.list,
        lights,
        environment,
        cameras,
        ..shapes.scene
    };
    if scene.has_motion()
        && let Some(&(shutter, at)) = shutters.first()
    {
        scene.shutter = shutter;
        if shutter.is_instant() {
            context.note(at, "the shutter is open for no time, so nothing moves; --shutter opens it");
        }
        if shutters.iter().any(|other| other.0 != shutter) {
            context.warn(at, "the sensors have different shutters; that of the first one counts");
        }
    }
    effects.unwrap_or_default().apply(context, &mut scene);
    context.report_unused();
    Ok(ConvertedScene { pictures: looks.textures.pictures, scene, slides, hints })
}
