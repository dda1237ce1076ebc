//! Import of a mesh file as a scene: its surfaces, and nothing else.

use std::path::Path;

use glam::DVec3;

use super::obj::{self, materials::Library};
use super::{ply, serialized};
use crate::color::Spectrum;
use crate::error::{SceneError, Warnings};
use crate::hints::{Metadata, RenderHints};
use crate::import::request::{ImportOutput, ImportRequest};
use crate::material::Material;
use crate::mesh_file::obj::file::ObjFile;
use crate::model::{Mesh, Scene};
use crate::options::LoadOptions;
use crate::origin::rounding;
use crate::resource::Resources;
use crate::surface::Layered;

/// Recognizes a mesh file by its first bytes or its name.
pub(crate) fn recognizes(path: &Path, file: &[u8]) -> bool {
    ply::recognizes(path, file) || serialized::recognizes(file) || obj::recognizes(path)
}

/// Imports a file that [`recognizes`] accepts. The scene has no cameras, and no lights except emissive materials.
pub(crate) fn import(request: &ImportRequest<'_>, warnings: &mut Warnings) -> Result<ImportOutput, SceneError> {
    let &ImportRequest { path, file, options, origin, resources } = request;
    let budget = resources.budget();
    let mut scene = Scene::default();
    let format = if ply::recognizes(path, file) {
        let mut mesh = ply::read(path, file, budget)?;
        if mesh.colors.is_empty()
            && let Some(colors) = ply::face_colors(path, file, budget)?
        {
            budget.take(path, "", mesh.memory_bytes().saturating_mul(3))?;
            mesh = mesh.with_triangle_colors(&colors).unwrap_or_else(|| {
                warnings.unsupported("", "the triangle strips of the mesh have no colours; they are white");
                mesh
            });
        }
        add(&mut scene, mesh);
        "PLY"
    } else if serialized::recognizes(file) {
        for shape in 0..serialized::count(path, file)? {
            add(&mut scene, serialized::read(path, file, shape, budget)?);
        }
        "Mitsuba serialized"
    } else {
        add_obj(&mut scene, obj::read(path, file, budget)?, options, resources, warnings)?;
        "Wavefront OBJ"
    };
    if origin != DVec3::ZERO {
        warnings.add("", rounding(origin));
        for mesh in scene.meshes.iter_mut() {
            mesh.positions.iter_mut().for_each(|p| *p = (p.as_dvec3() - origin).as_vec3());
        }
    }
    Ok((scene, Metadata { format, ..Metadata::default() }, RenderHints::default()))
}

/// Returns the material for surfaces without one: light gray.
fn default_material() -> Material {
    Layered { base_color: Spectrum::splat(0.8).into(), roughness: 0.6.into(), ..Layered::default() }.into()
}

/// Places a mesh with the default material, without texture coordinates.
fn add(scene: &mut Scene, mesh: Mesh) {
    if mesh.triangles.is_empty() {
        return;
    }
    if scene.materials.is_empty() {
        scene.push_material(default_material());
    }
    scene.push_surface(Mesh { uvs: Default::default(), ..mesh });
}

fn add_obj(
    scene: &mut Scene,
    mut file: ObjFile<'_>,
    options: &LoadOptions,
    resources: &Resources<'_>,
    warnings: &mut Warnings,
) -> Result<(), SceneError> {
    for (line, message) in file.take_notes() {
        warnings.unsupported(format!("line {line}"), message);
    }
    let mut library = Library::open(&file.libraries, options, resources, warnings)?;
    for part in file.into_parts()? {
        let material = match &part.material {
            Some(name) => library.material(name, warnings)?,
            None => None,
        };
        let material = material.unwrap_or_else(default_material);
        let mut mesh = part.mesh;
        let needs_uvs = !material.textures().is_empty();
        if needs_uvs && mesh.uvs[0].is_empty() {
            let name = &material.name;
            warnings.add("", format!("surfaces of `{name}` have no texture coordinates, its textures show one texel"));
        }
        if needs_uvs {
            mesh.flip_v();
        } else {
            mesh.uvs = Default::default();
        }
        mesh.material = scene.push_material(material);
        scene.push_surface(mesh);
    }
    scene.images = library.into_images(warnings)?.into();
    Ok(())
}
