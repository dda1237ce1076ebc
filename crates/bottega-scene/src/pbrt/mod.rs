//! Importer of pbrt-v4 files.
//!
//! Uses its own parser: the crates for the format panic on several directives, and give no error locations.
//!
//! Supported: all directives; triangle, bilinear and subdivision meshes, `plymesh` (also compressed), spheres, disks,
//! cylinders and curves; all materials but `measured`; all textures but `ptex`; all lights, also through portals; homogeneous media; all cameras,
//! `realistic` with a round stop. Anything else is reported with file, line and column, and replaced or left out, or an error
//! with [`LoadOptions::strict`](crate::LoadOptions::strict).
//!
//! Flat and cylindrical curves face each ray ([`FacingCurves`](crate::FacingCurves)), as in pbrt.
//!
//! Conventions: pbrt's camera looks along its +z with +y up and +x to the right, so its space is left-handed; ours
//! mirrors instead, and world space is as in the file. The exposure of the film is folded into the lights. Texture
//! coordinates are flipped so that v grows downwards.

mod bake;
mod build;
mod camera;
mod color;
mod context;
mod dialect;
mod environment;
mod film;
mod grid;
mod lenses;
mod light;
mod mapping;
mod material;
mod medium;
mod movement;
mod needless;
mod params;
mod parser;
mod place;
mod ramp;
mod shape;
mod texture;
mod texture_tree;
mod token;
mod transform;
mod world;

use std::path::Path;

use build::SceneBuilder;
use context::Context;
use parser::Parser;

use crate::error::{SceneError, Warnings};
use crate::hints::{Metadata, RenderHints};
use crate::import::request::{ImportOutput, ImportRequest};
use crate::import::text_place::ImportResult;
use crate::model::Scene;

/// Recognizes a file by its extension.
pub(crate) fn recognizes(path: &Path) -> bool {
    path.extension().is_some_and(|extension| extension.eq_ignore_ascii_case("pbrt"))
}

/// Imports a file with the contents `file`, read from `path`.
pub(crate) fn import(request: &ImportRequest<'_>, warnings: &mut Warnings) -> Result<ImportOutput, SceneError> {
    let &ImportRequest { path, file, options, origin, resources } = request;
    let mut context = Context::new(path, resources, options, warnings);
    context.origin = origin;
    let (scene, hints) = read(&mut context, file).map_err(|stop| context.error(stop))?;
    let metadata = Metadata { format: "pbrt-v4", generator: None, extensions: Vec::new() };
    Ok((scene, metadata, hints))
}

fn read(context: &mut Context<'_>, file: &[u8]) -> ImportResult<(Scene, RenderHints)> {
    let mut parser = Parser::new(context);
    parser.read_scene(file)?;
    let mut world = parser.world;
    world.move_to(context.origin);
    let shapes = std::mem::take(&mut world.shapes);
    let objects = std::mem::take(&mut world.objects);
    SceneBuilder::new(context, &world)?.build(shapes, objects)
}
