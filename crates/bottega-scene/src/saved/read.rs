//! Reading of a saved scene.

use std::path::Path;
use std::sync::Arc;

use glam::{DVec3, Vec2, Vec3, Vec4};

use super::blocks::{Blocks, CurvePointRecord, InstanceRecord, SphereRecord};
use super::description::{Description, ImageDescription, MediumDescription, MeshDescription, TexelFormat};
use super::motion::read_motion;
use super::variation::read_variation;
use super::{MAGIC, VERSION};
use crate::error::{SceneError, Warnings};
use crate::facing_curves::{CurvePoint, FacingCurves};
use crate::hints::Metadata;
use crate::image::Image;
use crate::image::pyramid::Encoding;
use crate::image::raw::LevelTexels;
use crate::import::request::{ImportOutput, ImportRequest};
use crate::medium::Medium;
use crate::model::{Instance, Mesh, Scene, Sphere};
use crate::motion::Shutter;

/// The length of magic number, version and length of the description, in bytes.
const HEAD_BYTES: usize = 20;

/// Recognizes a saved scene by its first bytes.
pub(crate) fn recognizes(file: &[u8]) -> bool {
    file.starts_with(&MAGIC)
}

/// Reads a file that [`recognizes`] accepts. The scene is not yet validated.
pub(crate) fn import(request: &ImportRequest<'_>, _: &mut Warnings) -> Result<ImportOutput, SceneError> {
    let &ImportRequest { path, file, resources, .. } = request;
    let (description, rest) = description_of(path, file)?;
    let mut blocks = Blocks::new(path, rest, resources.budget());
    // Read the blocks in the order of the file
    let meshes = read_each("meshes", description.meshes, |place, mesh| read_mesh(&mut blocks, place, mesh))?;
    let instances: Vec<InstanceRecord> = blocks.take("instances", description.instances)?;
    let spheres: Vec<SphereRecord> = blocks.take("spheres", description.spheres)?;
    let images = read_each("images", description.images, |place, image| read_image(&mut blocks, place, &image))?;
    let media = read_each("media", description.media, |place, medium| read_medium(&mut blocks, place, medium))?;
    let motion = description.motion;
    let instances = instances.into_iter().map(Instance::try_from).collect::<Result<Vec<_>, _>>();
    let spheres = spheres.into_iter().map(Sphere::try_from).collect::<Result<Vec<_>, _>>();
    let mut scene = Scene {
        meshes: meshes.into_iter().collect(),
        instances: instances.map_err(|problem| blocks.damaged(problem))?,
        spheres: spheres.map_err(|problem| blocks.damaged(problem))?,
        materials: description.materials.into_owned(),
        media,
        images: images.into_iter().collect(),
        mappings: description.mappings.into_owned(),
        lights: description.lights.into_owned(),
        environment: description.environment.into_owned(),
        cameras: description.cameras.into_owned(),
        shutter: Shutter::default(),
        origin: DVec3::from_array(description.origin),
        digest: String::new(),
    };
    if let Some(motion) = &motion {
        read_motion(&mut blocks, motion, &mut scene)?;
    }
    blocks.end()?;
    Ok((scene, Metadata { format: "Bottega", ..Metadata::default() }, description.hints.into_owned()))
}

/// Returns the description of a file and the bytes after it.
fn description_of<'a>(path: &Path, file: &'a [u8]) -> Result<(Description<'static>, &'a [u8]), SceneError> {
    let damaged = |problem: String| SceneError::Damaged { path: path.into(), problem };
    let (head, rest) = file.split_at_checked(HEAD_BYTES).ok_or_else(|| damaged("its head is cut off".into()))?;
    let [_, _, version, low, high] = [0, 4, 8, 12, 16].map(|at| word(head, at));
    if version != VERSION {
        return Err(SceneError::OtherVersion { path: path.into(), found: version, known: VERSION });
    }
    let length = u64::from(high) << 32 | u64::from(low);
    let (text, rest) = usize::try_from(length)
        .ok()
        .and_then(|length| rest.split_at_checked(length))
        .ok_or_else(|| damaged("its description is cut off".into()))?;
    let description = serde_json::from_slice(text).map_err(|error| damaged(format!("its description: {error}")))?;
    Ok((description, rest))
}

fn word(bytes: &[u8], at: usize) -> u32 {
    u32::from_le_bytes(bytes[at..at + 4].try_into().expect("four bytes"))
}

/// Reads each part of a list. `read` gets its place, such as `meshes[3]`.
fn read_each<T, U>(
    name: &str,
    parts: Vec<T>,
    mut read: impl FnMut(&str, T) -> Result<U, SceneError>,
) -> Result<Vec<U>, SceneError> {
    parts.into_iter().enumerate().map(|(index, part)| read(&format!("{name}[{index}]"), part)).collect()
}

fn read_mesh(blocks: &mut Blocks<'_>, place: &str, mesh: MeshDescription<'_>) -> Result<Mesh, SceneError> {
    let (vertices, triangles) = (mesh.vertices, mesh.triangles);
    Ok(Mesh {
        name: mesh.name.into_owned(),
        positions: blocks.take::<Vec3>(place, vertices)?,
        normals: blocks.take_if::<Vec3>(mesh.has_normals, place, vertices)?,
        tangents: blocks.take_if::<Vec4>(mesh.has_tangents, place, vertices)?,
        uvs: [
            blocks.take_if::<Vec2>(mesh.has_uvs[0], place, vertices)?,
            blocks.take_if::<Vec2>(mesh.has_uvs[1], place, vertices)?,
        ],
        colors: blocks.take_if::<Vec4>(mesh.has_colors, place, vertices)?,
        triangles: blocks.take::<[u32; 3]>(place, triangles)?,
        material: mesh.material,
        curves: match mesh.curves {
            None => None,
            Some(curves) => {
                let points: Vec<CurvePointRecord> = blocks.take(place, curves.points)?;
                let points = points.into_iter().map(CurvePoint::from).collect();
                let pieces = blocks.take(place, triangles)?;
                Some(Box::new(FacingCurves { look: curves.look, points, pieces }))
            }
        },
        motion: Vec::new(),
    })
}

fn read_image(blocks: &mut Blocks<'_>, place: &str, image: &ImageDescription<'_>) -> Result<Image, SceneError> {
    let &ImageDescription { width, height, format, is_srgb, .. } = image;
    if width == 0 || height == 0 {
        return Err(blocks.damaged(format!("{place} has {width} × {height} texels")));
    }
    let count = u64::from(width) * u64::from(height);
    let encoding = if is_srgb { Encoding::Srgb } else { Encoding::Linear };
    let made = |texels: LevelTexels<'_>| Image::of_level(&image.name, (width, height), texels, encoding);
    let is_finite = |texels: &[f32]| texels.iter().all(|value| value.is_finite());
    let not_finite = format!("{place}: a texel is not finite");
    Ok(match format {
        TexelFormat::Gray8 => made(LevelTexels::Gray8(&blocks.take::<u8>(place, count)?)),
        TexelFormat::Rgb8 => made(LevelTexels::Rgb8(&blocks.take::<[u8; 3]>(place, count)?)),
        TexelFormat::Rgba8 => made(LevelTexels::Rgba8(&blocks.take::<[u8; 4]>(place, count)?)),
        TexelFormat::Rgba16 => made(LevelTexels::Rgba16(&blocks.take::<[u16; 4]>(place, count)?)),
        TexelFormat::Rgb32 => {
            let texels = blocks.take::<[f32; 3]>(place, count)?;
            if !is_finite(texels.as_flattened()) {
                return Err(blocks.damaged(not_finite));
            }
            made(LevelTexels::Rgb32(&texels))
        }
        TexelFormat::Rgba32 => {
            let texels = blocks.take::<[f32; 4]>(place, count)?;
            if !is_finite(texels.as_flattened()) {
                return Err(blocks.damaged(not_finite));
            }
            made(LevelTexels::Rgba32(&texels))
        }
    })
}

fn read_medium(blocks: &mut Blocks<'_>, place: &str, medium: MediumDescription<'_>) -> Result<Medium, SceneError> {
    let variation = match medium.variation {
        Some(variation) => Some(Arc::new(read_variation(blocks, place, variation)?)),
        None => None,
    };
    Ok(Medium { variation, ..medium.medium.into_owned() })
}
