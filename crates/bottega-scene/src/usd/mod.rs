//! Importer of Universal Scene Description: `.usda`, `.usdc`, `.usd` and `.usdz`.
//!
//! The library `openusd` parses layers and composes the stage; [`files`] gives it the bytes of layers, so that it reads only
//! what the scene may read, and checks them first: [`layer_text`] mends text that the library cannot parse, and
//! [`crate_file`] bounds what a binary layer allocates. The library runs in a thread of its own with a large stack; a panic
//! there is an error about the file.
//!
//! Schemas are read here, from the composed stage: UsdGeom, UsdShade with UsdPreviewSurface, UsdLux and UsdSkel.
//!
//! Scenes keep their units. A stage whose up axis is z is turned to y.
//!
//! Light: radiance is `intensity × 2^exposure × color`, with W·sr⁻¹·m⁻² for nits, one to one.

mod binding;
mod camera;
mod context;
mod crate_file;
mod crate_parts;
mod crate_values;
mod curves;
mod error;
mod files;
mod gprim;
mod instancer;
mod layer_text;
mod light;
mod light_profile;
mod light_shape;
mod look;
mod material;
mod mesh;
mod names;
mod package;
mod place;
mod placement;
mod polygon;
mod primvar;
mod shape;
mod shaping;
mod skel;
mod source;
mod stage;
mod subdivision;
mod texture;
mod time;
mod values;
mod walk;
mod xform;

use std::path::Path;
use std::thread::{Builder, scope};

use files::Files;

use crate::error::{SceneError, Warnings};
use crate::import::request::{ImportOutput, ImportRequest};

/// Stack of the thread that composes the stage, in bytes: the library and our walk use a few frames per level of a path.
const STACK_BYTES: usize = 256 << 20;

/// File extensions of the format.
const EXTENSIONS: [&str; 4] = ["usd", "usda", "usdc", "usdz"];

/// Recognizes a file by its extension.
pub(crate) fn recognizes(path: &Path) -> bool {
    path.extension().is_some_and(|end| EXTENSIONS.iter().any(|known| end.eq_ignore_ascii_case(known)))
}

/// Imports a stage. The scene may lack lights and cameras.
pub(crate) fn import(request: &ImportRequest<'_>, warnings: &mut Warnings) -> Result<ImportOutput, SceneError> {
    let files = Files::new(request);
    files.check_root()?;
    let (client, server) = files::connect();
    let read = scope(|scope| {
        let files = &files;
        let reader = Builder::new()
            .name("usd".into())
            .stack_size(STACK_BYTES)
            .spawn_scoped(scope, move || stage::read(request, files, client))
            .map_err(|source| SceneError::Read { path: request.path.into(), by: String::new(), source })?;
        server.serve(files);
        reader.join().map_err(|panic| error::panicked(request.path, &*panic))
    });
    let (imported, news) = read??;
    warnings.append(news);
    Ok(imported)
}
