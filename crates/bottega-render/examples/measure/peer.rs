//! Reads the neutral description of the scenes that other engines were measured with: a JSON file that names PLY meshes.

use std::{collections::HashMap, error::Error, fs, path::Path};

use bottega_scene::{Camera, Environment, Layered, Material, Mesh, Projection, Scene, Sides};
use glam::{Affine3A, Vec3};
use serde_json::Value;

type Outcome<T> = Result<T, Box<dyn Error>>;

pub(crate) fn load(path: &Path) -> Outcome<Scene> {
    let value: Value = serde_json::from_slice(&fs::read(path)?)?;
    let folder = path.parent().ok_or("a file lies in a folder")?;
    let mut scene = Scene { cameras: vec![camera(&value["camera"])?], ..Scene::default() };
    if value["env"].is_array() {
        scene.environment = Some(Environment::uniform(vector(&value["env"])?));
    }
    let mut indices = HashMap::new();
    for (name, description) in value["materials"].as_object().ok_or("no materials")? {
        indices.insert(name.as_str(), scene.materials.len() as u32);
        scene.materials.push(material(description)?);
    }
    for entry in value["meshes"].as_array().ok_or("no meshes")? {
        let name = entry["material"].as_str().ok_or("no material")?;
        let mut index = *indices.get(name).ok_or("unknown material")?;
        if entry["emission"].is_array() {
            let mut shining = scene.materials[index as usize].clone();
            shining.emission = vector(&entry["emission"])?.into();
            index = scene.push_material(shining);
        }
        let mesh = read_ply(&folder.join(entry["ply"].as_str().ok_or("no ply")?))?;
        scene.push_surface(Mesh { material: index, ..mesh });
    }
    Ok(scene)
}

fn vector(value: &Value) -> Outcome<Vec3> {
    let number = |i: usize| value[i].as_f64().map(|v| v as f32).ok_or("not a vector");
    Ok(Vec3::new(number(0)?, number(1)?, number(2)?))
}

fn camera(value: &Value) -> Outcome<Camera> {
    let (eye, target, up) = (vector(&value["origin"])?, vector(&value["target"])?, vector(&value["up"])?);
    let fov = value["fov"].as_f64().ok_or("no fov")? as f32;
    let (z, x) = ((eye - target).normalize(), up.cross(eye - target).normalize());
    Ok(Camera {
        world_from_camera: Affine3A::from_cols(x.into(), z.cross(x).into(), z.into(), eye.into()),
        projection: Projection::Perspective { vertical_fov: fov.to_radians() },
        ..Camera::default()
    })
}

fn material(value: &Value) -> Outcome<Material> {
    Ok(match value["type"].as_str() {
        Some("diffuse") => Material { emission_sides: Sides::Front, ..Material::matte(vector(&value["reflectance"])?) },
        Some("mirror") => Layered {
            base_color: vector(&value["reflectance"])?.into(),
            metallic: 1.0.into(),
            roughness: 0.0.into(),
            ..Layered::default()
        }
        .into(),
        Some("dielectric") => Layered {
            ior: value["ior"].as_f64().ok_or("no ior")? as f32,
            transmission: 1.0.into(),
            roughness: 0.0.into(),
            ..Layered::default()
        }
        .into(),
        _ => return Err("unknown material".into()),
    })
}

fn read_ply(path: &Path) -> Outcome<Mesh> {
    let bytes = fs::read(path)?;
    let marker = b"end_header\n";
    let end = bytes.windows(marker.len()).position(|window| window == marker).ok_or("no end of header")?;
    let header = std::str::from_utf8(&bytes[..end])?;
    let count = |element: &str| -> Outcome<usize> {
        let line = header.lines().find_map(|line| line.strip_prefix(&format!("element {element} ")));
        Ok(line.ok_or("no such element")?.parse()?)
    };
    let body = &bytes[end + marker.len()..];
    let (vertices, faces) = body.split_at_checked(12 * count("vertex")?).ok_or("too short")?;
    let word = |bytes: &[u8], i: usize| [bytes[i], bytes[i + 1], bytes[i + 2], bytes[i + 3]];
    let float = |bytes: &[u8], i: usize| f32::from_le_bytes(word(bytes, i));
    let index = |bytes: &[u8], i: usize| u32::from_le_bytes(word(bytes, i));
    let positions = vertices.chunks_exact(12).map(|v| Vec3::new(float(v, 0), float(v, 4), float(v, 8))).collect();
    let triangles = faces.chunks_exact(13).map(|f| [index(f, 1), index(f, 5), index(f, 9)]).collect();
    Ok(Mesh { positions, triangles, ..Mesh::default() })
}
