//! A summary of a scene for display.

use glam::Vec3;

use crate::camera::{Camera, Projection};
use crate::hints::Metadata;
use crate::light::LightKind;
use crate::load::Loaded;
use crate::material::Material;
use crate::model::{Instance, Scene};

/// A summary of a scene for display: counts, bounds and names.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct SceneSummary {
    /// Metadata of the scene file.
    pub metadata: Metadata,
    /// BLAKE3 of all bytes that were read and of the options chosen, hexadecimal.
    pub digest: String,
    /// Number of meshes.
    pub mesh_count: usize,
    /// Number of placed meshes.
    pub instance_count: usize,
    /// Number of triangles of all instances.
    pub triangle_count: u64,
    /// Number of triangles in memory: those of an instanced mesh count once.
    pub stored_triangle_count: u64,
    /// Number of spheres that are not triangulated.
    pub sphere_count: usize,
    /// Number of placed meshes, spheres, lights and cameras that have keys of motion; keys of vertices count for each
    /// placed mesh.
    pub moving_count: usize,
    /// Times at which the shutter opens and is closed, in the unit of the file.
    pub shutter: [f64; 2],
    /// Least and greatest coordinates of all shapes, at all keys, world space; both 0 if there are none.
    pub bounds: (Vec3, Vec3),
    /// Memory of meshes, instances, spheres, pictures and grids, in bytes.
    pub memory_bytes: usize,
    /// Name and projection of each camera.
    pub cameras: Vec<(String, &'static str)>,
    /// Name of each material, with a trailing `*` if it emits light.
    pub materials: Vec<String>,
    /// Name and kind of each light; emissive surfaces are in [`materials`](Self::materials).
    pub lights: Vec<(String, &'static str)>,
    /// Name, columns, rows and bytes of each picture.
    pub images: Vec<(String, u32, u32, usize)>,
    /// Name of the environment's picture, empty without one; `None`: no environment.
    pub environment: Option<String>,
}

impl SceneSummary {
    /// Returns the summary of a scene.
    ///
    /// - `metadata`: of the file that the scene was read from.
    ///
    /// # Panics
    ///
    /// If the scene has an index out of range, which [`Scene::validate`] excludes.
    pub fn new(scene: &Scene, metadata: &Metadata) -> Self {
        let environment = scene.environment.as_ref().map(|environment| {
            environment.image.map(|image| scene.images[image.0 as usize].name.clone()).unwrap_or_default()
        });
        let camera_kind = |camera: &Camera| match camera.projection {
            Projection::Perspective { .. } if camera.lenses.is_some() => "perspective with lenses",
            Projection::Perspective { .. } => "perspective",
            Projection::Orthographic { .. } => "orthographic",
            Projection::Fisheye { .. } => "fisheye",
            Projection::Panorama(_) => "panoramic",
        };
        let light_kind = |kind: &LightKind| match kind {
            LightKind::Point { .. } => "point",
            LightKind::Spot { .. } => "spot",
            LightKind::Goniometric { .. } => "goniometric",
            LightKind::Directional { .. } => "directional",
            LightKind::Projector { .. } => "projector",
        };
        let material_name = |(index, material): (usize, &Material)| {
            let name = if material.name.is_empty() { format!("material {index}") } else { material.name.clone() };
            if material.is_emissive() { name + "*" } else { name }
        };
        Self {
            metadata: metadata.clone(),
            digest: scene.digest.clone(),
            mesh_count: scene.meshes.len(),
            instance_count: scene.instances.len(),
            triangle_count: scene.triangle_count(),
            stored_triangle_count: scene.meshes.iter().map(|mesh| mesh.triangles.len() as u64).sum(),
            sphere_count: scene.spheres.len(),
            moving_count: moving_count(scene),
            shutter: [scene.shutter.open, scene.shutter.close],
            bounds: scene.bounds(),
            memory_bytes: scene.memory_bytes(),
            cameras: scene.cameras.iter().map(|c| (c.name.clone(), camera_kind(c))).collect(),
            materials: scene.materials.iter().enumerate().map(material_name).collect(),
            lights: scene.lights.iter().map(|light| (light.name.clone(), light_kind(&light.kind))).collect(),
            images: (scene.images.iter())
                .map(|image| (image.name.clone(), image.size().0, image.size().1, image.memory_bytes()))
                .collect(),
            environment,
        }
    }
}

/// Counts the parts of a scene that have keys.
fn moving_count(scene: &Scene) -> usize {
    let moves =
        |instance: &&Instance| !instance.motion.is_empty() || !scene.meshes[instance.mesh as usize].motion.is_empty();
    scene.instances.iter().filter(moves).count()
        + scene.spheres.iter().filter(|sphere| !sphere.motion.is_empty()).count()
        + scene.lights.iter().filter(|light| !light.motion.is_empty()).count()
        + scene.cameras.iter().filter(|camera| !camera.motion.is_empty()).count()
}

impl Loaded {
    /// Returns the summary of the loaded scene and its file.
    pub fn summary(&self) -> SceneSummary {
        SceneSummary::new(&self.scene, &self.metadata)
    }
}
