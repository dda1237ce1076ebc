//! Writing of a saved scene.

use std::borrow::Cow;
use std::io::{self, Write};
use std::path::Path;

use bottega_image::{ImageError, write_whole_with};

use super::blocks::{CurvePointRecord, InstanceRecord, SphereRecord, put};
use super::description::{
    CurvesDescription, Description, ImageDescription, MediumDescription, MeshDescription, TexelFormat,
};
use super::motion::{describe_motion, put_motion};
use super::{MAGIC, VERSION, variation};
use crate::hints::RenderHints;
use crate::image::Image;
use crate::image::raw::LevelTexels;
use crate::medium::Medium;
use crate::model::{Mesh, Scene};

/// Writes a scene to a file of Bottega's own format, completely or not at all. Loading it gives the same scene, bit for
/// bit.
///
/// - `hints`: render settings that are stored with the scene.
///
/// # Errors
/// The file cannot be written.
pub fn save_scene(path: &Path, scene: &Scene, hints: &RenderHints) -> Result<(), ImageError> {
    write_whole_with(path, |out| write(out, scene, hints))
}

fn write(out: &mut dyn Write, scene: &Scene, hints: &RenderHints) -> io::Result<()> {
    let described = describe(scene, hints);
    let description = serde_json::to_vec(&described)?;
    out.write_all(&MAGIC)?;
    out.write_all(&VERSION.to_le_bytes())?;
    out.write_all(&(description.len() as u64).to_le_bytes())?;
    out.write_all(&description)?;
    scene.meshes.iter().try_for_each(|mesh| put_mesh(out, mesh))?;
    let instances: Vec<InstanceRecord> = scene.instances.iter().map(InstanceRecord::from).collect();
    put(out, &instances)?;
    let spheres: Vec<SphereRecord> = scene.spheres.iter().map(SphereRecord::from).collect();
    put(out, &spheres)?;
    scene.images.iter().try_for_each(|image| put_image(out, image))?;
    let variations = scene.media.iter().filter_map(|medium| medium.variation.as_deref());
    variations.into_iter().try_for_each(|it| variation::put_variation(out, it))?;
    put_motion(out, scene)
}

fn describe<'a>(scene: &'a Scene, hints: &'a RenderHints) -> Description<'a> {
    Description {
        meshes: scene.meshes.iter().map(describe_mesh).collect(),
        instances: scene.instances.len() as u64,
        spheres: scene.spheres.len() as u64,
        materials: Cow::Borrowed(&scene.materials),
        media: scene.media.iter().map(describe_medium).collect(),
        images: scene.images.iter().map(describe_image).collect(),
        mappings: Cow::Borrowed(&scene.mappings),
        lights: Cow::Borrowed(&scene.lights),
        environment: Cow::Borrowed(&scene.environment),
        cameras: Cow::Borrowed(&scene.cameras),
        origin: scene.origin.to_array(),
        hints: Cow::Borrowed(hints),
        motion: describe_motion(scene),
    }
}

fn describe_mesh(mesh: &Mesh) -> MeshDescription<'_> {
    let curves = mesh.curves.as_deref();
    MeshDescription {
        name: Cow::Borrowed(&mesh.name),
        material: mesh.material,
        vertices: mesh.positions.len() as u64,
        triangles: mesh.triangles.len() as u64,
        has_normals: !mesh.normals.is_empty(),
        has_tangents: !mesh.tangents.is_empty(),
        has_uvs: [0, 1].map(|set| !mesh.uvs[set].is_empty()),
        has_colors: !mesh.colors.is_empty(),
        curves: curves.map(|curves| CurvesDescription { look: curves.look, points: curves.points.len() as u64 }),
    }
}

fn put_mesh(out: &mut dyn Write, mesh: &Mesh) -> io::Result<()> {
    put(out, &mesh.positions)?;
    put(out, &mesh.normals)?;
    put(out, &mesh.tangents)?;
    put(out, &mesh.uvs[0])?;
    put(out, &mesh.uvs[1])?;
    put(out, &mesh.colors)?;
    put(out, &mesh.triangles)?;
    let Some(curves) = &mesh.curves else { return Ok(()) };
    let points: Vec<CurvePointRecord> = curves.points.iter().map(CurvePointRecord::from).collect();
    put(out, &points)?;
    put(out, &curves.pieces)
}

fn describe_image(image: &Image) -> ImageDescription<'_> {
    let (width, height) = image.size();
    let format = match image.level_texels(0) {
        LevelTexels::Gray8(_) => TexelFormat::Gray8,
        LevelTexels::Rgb8(_) => TexelFormat::Rgb8,
        LevelTexels::Rgba8(_) => TexelFormat::Rgba8,
        LevelTexels::Rgba16(_) => TexelFormat::Rgba16,
        LevelTexels::Rgb32(_) => TexelFormat::Rgb32,
        LevelTexels::Rgba32(_) => TexelFormat::Rgba32,
    };
    ImageDescription { name: Cow::Borrowed(&image.name), width, height, format, is_srgb: image.is_srgb() }
}

fn put_image(out: &mut dyn Write, image: &Image) -> io::Result<()> {
    match image.level_texels(0) {
        LevelTexels::Gray8(texels) => put(out, texels),
        LevelTexels::Rgb8(texels) => put(out, texels),
        LevelTexels::Rgba8(texels) => put(out, texels),
        LevelTexels::Rgba16(texels) => put(out, texels),
        LevelTexels::Rgb32(texels) => put(out, texels),
        LevelTexels::Rgba32(texels) => put(out, texels),
    }
}

fn describe_medium(medium: &Medium) -> MediumDescription<'_> {
    MediumDescription { medium: Cow::Borrowed(medium), variation: medium.variation.as_deref().map(variation::describe) }
}
