//! The neutral description of scenes for comparing renderers: a JSON file that names PLY meshes of flat triangles.

use std::{collections::HashMap, fs, path::Path};

use bottega_scene::{Camera, Environment, Layered, Material, Mesh, Projection, Scene, Sides};
use glam::{Affine3A, Vec3};
use serde_json::Value;

use crate::error::Error;

/// A scene for comparing renderers.
pub(crate) struct NeutralScene {
    pub(crate) scene: Scene,
    /// The size of the image, in pixels.
    pub(crate) width: u32,
    pub(crate) height: u32,
    /// The maximum number of bounces after the first surface; 0: direct light only.
    pub(crate) max_bounces: u32,
}

/// The parsed value, or a description of the error.
type ParseResult<T> = Result<T, String>;

pub(crate) fn load(path: &Path) -> Result<NeutralScene, Error> {
    let bytes = fs::read(path).map_err(|source| bottega::Error::Read { path: path.to_owned(), source })?;
    let folder = path.parent().unwrap_or(Path::new("."));
    let parsed = serde_json::from_slice(&bytes).map_err(|error| error.to_string());
    let scene = parsed.and_then(|value| read(&value, folder));
    scene.map_err(|problem| Error::NeutralScene { path: path.to_owned(), problem })
}

fn read(value: &Value, folder: &Path) -> ParseResult<NeutralScene> {
    let mut scene = Scene { cameras: vec![camera(&value["camera"])?], ..Scene::default() };
    if value["env"].is_array() {
        scene.environment = Some(Environment::uniform(vector(&value["env"])?));
    }
    let mut indices = HashMap::new();
    for (name, description) in value["materials"].as_object().ok_or("no `materials`")? {
        indices.insert(name.as_str(), scene.push_material(material(description)?));
    }
    for entry in value["meshes"].as_array().ok_or("no `meshes`")? {
        let name = text(entry, "material")?;
        let mut index = *indices.get(name).ok_or_else(|| format!("no material `{name}`"))?;
        if entry["emission"].is_array() {
            let mut shining = scene.materials[index as usize].clone();
            shining.emission = vector(&entry["emission"])?.into();
            index = scene.push_material(shining);
        }
        let ply = folder.join(text(entry, "ply")?);
        let mesh = read_ply(&ply).map_err(|problem| format!("{}: {problem}", ply.display()))?;
        scene.push_surface(Mesh { material: index, ..mesh });
    }
    let whole = |key: &str| -> ParseResult<u32> {
        value[key].as_u64().and_then(|number| number.try_into().ok()).ok_or_else(|| format!("no whole number `{key}`"))
    };
    Ok(NeutralScene { scene, width: whole("width")?, height: whole("height")?, max_bounces: whole("max_bounces")? })
}

fn text<'a>(value: &'a Value, key: &str) -> ParseResult<&'a str> {
    value[key].as_str().ok_or_else(|| format!("no text `{key}`"))
}

fn number(value: &Value) -> ParseResult<f32> {
    value.as_f64().map(|number| number as f32).ok_or_else(|| format!("{value} is not a number"))
}

fn vector(value: &Value) -> ParseResult<Vec3> {
    Ok(Vec3::new(number(&value[0])?, number(&value[1])?, number(&value[2])?))
}

/// Parses a camera from `origin` to `target`; `fov` is the angle between the left and the right edge of a square image.
fn camera(value: &Value) -> ParseResult<Camera> {
    let (eye, target, up) = (vector(&value["origin"])?, vector(&value["target"])?, vector(&value["up"])?);
    let back = (eye - target).try_normalize().ok_or("the camera looks nowhere")?;
    let right = up.cross(back).try_normalize().ok_or("the camera looks straight up")?;
    Ok(Camera {
        world_from_camera: Affine3A::from_cols(right.into(), back.cross(right).into(), back.into(), eye.into()),
        projection: Projection::Perspective { vertical_fov: number(&value["fov"])?.to_radians() },
        ..Camera::default()
    })
}

fn material(value: &Value) -> ParseResult<Material> {
    let smooth = |layered: Layered| Layered { roughness: 0.0.into(), ..layered }.into();
    Ok(match text(value, "type")? {
        "diffuse" => Material { emission_sides: Sides::Front, ..Material::matte(vector(&value["reflectance"])?) },
        "mirror" => {
            let base_color = vector(&value["reflectance"])?.into();
            smooth(Layered { base_color, metallic: 1.0.into(), ..Layered::default() })
        }
        "dielectric" => smooth(Layered { ior: number(&value["ior"])?, transmission: 1.0.into(), ..Layered::default() }),
        other => return Err(format!("no material is of type `{other}`")),
    })
}

/// Reads a little-endian PLY file with positions (x, y, z) and triangles only.
fn read_ply(path: &Path) -> ParseResult<Mesh> {
    const END: &[u8] = b"end_header\n";
    const VERTEX_BYTES: usize = 12;
    const TRIANGLE_BYTES: usize = 13;
    let bytes = fs::read(path).map_err(|error| error.to_string())?;
    let start = bytes.windows(END.len()).position(|window| window == END).ok_or("no end of the header")? + END.len();
    let header = std::str::from_utf8(&bytes[..start]).map_err(|error| error.to_string())?;
    let count = |element: &str| -> ParseResult<usize> {
        let line = header.lines().find_map(|line| line.strip_prefix(element)).ok_or_else(|| format!("no {element}"))?;
        line.trim().parse().map_err(|_| format!("{element} has no number"))
    };
    let is_whole = |count: usize, size: usize, body: usize| count.checked_mul(size).is_some_and(|size| size <= body);
    let body = &bytes[start..];
    let (vertex_count, triangle_count) = (count("element vertex")?, count("element face")?);
    if !header.contains("binary_little_endian") || !is_whole(vertex_count, VERTEX_BYTES, body.len()) {
        return Err("not positions and triangles alone, little-endian".to_owned());
    }
    let (vertices, faces) = body.split_at(vertex_count * VERTEX_BYTES);
    if !is_whole(triangle_count, TRIANGLE_BYTES, faces.len()) {
        return Err("it ends before its last triangle".to_owned());
    }
    let word = |bytes: &[u8], at: usize| [bytes[at], bytes[at + 1], bytes[at + 2], bytes[at + 3]];
    let float = |bytes: &[u8], at: usize| f32::from_le_bytes(word(bytes, at));
    let index = |bytes: &[u8], at: usize| u32::from_le_bytes(word(bytes, at));
    let positions = vertices.chunks_exact(VERTEX_BYTES).map(|v| Vec3::new(float(v, 0), float(v, 4), float(v, 8)));
    // A face is one byte for the number of corners, and three indices.
    let triangles = faces.chunks_exact(TRIANGLE_BYTES).map(|f| [index(f, 1), index(f, 5), index(f, 9)]);
    Ok(Mesh { positions: positions.collect(), triangles: triangles.take(triangle_count).collect(), ..Mesh::default() })
}
