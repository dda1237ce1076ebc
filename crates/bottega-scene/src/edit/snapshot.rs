//! The scene of an editor as a scene to render.

use std::collections::HashMap;
use std::sync::Arc;

use super::mesh_parts::MeshParts;
use super::object::{PlacedObject, mirrors, unmirrored};
use super::{EditedLight, EditedLightKind, SceneEditor};
use crate::camera::Camera;
use crate::light::Light;
use crate::material::Material;
use crate::model::{Instance, Mesh, Scene};
use crate::motion::{SphereKey, TransformKey};
use crate::shaped_light::ShapedLight;

/// A scene while it is filled from an editor.
struct SceneFiller<'a> {
    editor: &'a SceneEditor,
    scene: Scene,
    material_numbers: HashMap<&'a str, u32>,
    mesh_numbers: HashMap<*const Mesh, u32>,
    /// The material of surfaces without one, once it is needed.
    plain: Option<u32>,
}

impl SceneEditor {
    /// Returns the scene as it is now, without what is hidden. Meshes and images are shared with the editor, not
    /// copied; equal contents in equal order give scenes whose pictures have the same bits, whatever the edits before.
    pub fn snapshot(&self) -> Scene {
        let scene = Scene {
            materials: self.materials.iter().map(|(key, it)| Material { name: key.to_owned(), ..it.clone() }).collect(),
            cameras: self.cameras.iter().map(|(key, it)| Camera { name: key.to_owned(), ..it.clone() }).collect(),
            ..self.base.clone()
        };
        let material_numbers = self.materials.keys().zip(0..).collect();
        let mut filler =
            SceneFiller { editor: self, scene, material_numbers, mesh_numbers: HashMap::new(), plain: None };
        for (key, light) in self.lights.iter().filter(|(_, light)| !light.hidden) {
            filler.add_light(key, light);
        }
        for (_, object) in self.objects.iter().filter(|(_, object)| !object.hidden) {
            filler.place(object);
        }
        for (_, sphere) in self.spheres.iter().filter(|(_, sphere)| !sphere.hidden) {
            let material = filler.material(Some(&sphere.material));
            filler.scene.spheres.push(crate::model::Sphere { material, ..sphere.sphere.clone() });
        }
        filler.scene
    }
}

impl<'a> SceneFiller<'a> {
    /// Places all instances of an object.
    fn place(&mut self, object: &'a PlacedObject) {
        let Some(mesh) = self.editor.meshes.find(&object.mesh) else { return };
        // Find mesh and material of each slot, for upright and for mirrored instances
        let own = |slot: u32| object.materials.get(slot as usize).or_else(|| mesh.materials.get(slot as usize));
        let slots = mesh.parts.parts.iter().map(|&(slot, _)| slot);
        let materials: Vec<u32> = slots.map(|slot| self.material(own(slot).map(|key| &**key))).collect();
        let palette: Vec<u32> = object.materials.iter().map(|key| self.material(Some(key))).collect();
        let upright: Vec<u32> = mesh.parts.parts.iter().map(|(_, mesh)| self.mesh(mesh)).collect();
        let mut mirrored: Option<Vec<u32>> = None;
        for (index, transform) in object.transforms.iter().enumerate() {
            let (meshes, world_from_object) = if mirrors(transform) {
                (&*mirrored.get_or_insert_with(|| self.mirrored(&mesh.parts)), unmirrored(transform))
            } else {
                (&upright, *transform)
            };
            let motion: Vec<TransformKey> = (object.motion.iter())
                .filter_map(|(time, transforms)| {
                    let transform = transforms.get(index)?;
                    let transform = if mirrors(transform) { unmirrored(transform) } else { *transform };
                    Some(TransformKey { time: *time, transform })
                })
                .collect();
            let choice = object.instance_materials.get(index).map(|&choice| palette[choice as usize]);
            for (&mesh, &material) in meshes.iter().zip(&materials) {
                let material = choice.unwrap_or(material);
                let is_own = self.scene.meshes[mesh as usize].material == material;
                let material = (!is_own).then_some(material);
                let visibility = object.visibility;
                let motion = motion.clone();
                self.scene.instances.push(Instance { mesh, material, world_from_object, visibility, motion });
            }
        }
    }

    fn add_light(&mut self, key: &str, light: &EditedLight) {
        let shape = match &light.kind {
            EditedLightKind::Plain(kind) => {
                self.scene.lights.push(Light {
                    visibility: light.visibility,
                    motion: light.motion.clone(),
                    ..Light::new(key, *kind)
                });
                return;
            }
            EditedLightKind::Sphere(light) => ShapedLight::Sphere(light),
            EditedLightKind::Area(light) => ShapedLight::Area(light),
        };
        let counts = (self.scene.spheres.len(), self.scene.instances.len());
        self.scene.push_shaped_light(key, &shape, light.visibility);
        // The surface of the light moves with it
        for sphere in &mut self.scene.spheres[counts.0..] {
            let key = |key: &TransformKey| SphereKey {
                time: key.time,
                center: key.transform.transform_point3(sphere.center),
                radius: sphere.radius,
                world_from_object: sphere.world_from_object,
            };
            sphere.motion = light.motion.iter().map(key).collect();
        }
        for instance in &mut self.scene.instances[counts.1..] {
            let place = instance.world_from_object;
            let key = |key: &TransformKey| TransformKey { transform: key.transform * place, ..*key };
            instance.motion = light.motion.iter().map(key).collect();
        }
    }

    fn mirrored(&mut self, parts: &MeshParts) -> Vec<u32> {
        parts.mirrored().iter().map(|mesh| self.mesh(mesh)).collect()
    }

    /// Returns the number of a mesh in the scene, which it gets when it is first placed.
    fn mesh(&mut self, mesh: &Arc<Mesh>) -> u32 {
        *self.mesh_numbers.entry(Arc::as_ptr(mesh)).or_insert_with(|| {
            self.scene.meshes.push_shared(Arc::clone(mesh));
            self.scene.meshes.len() as u32 - 1
        })
    }

    /// Returns the number of a material; of a plain gray one without a key.
    fn material(&mut self, key: Option<&str>) -> u32 {
        if let Some(&number) = key.and_then(|key| self.material_numbers.get(key)) {
            return number;
        }
        let scene = &mut self.scene;
        *self.plain.get_or_insert_with(|| scene.push_material(Material::matte(crate::color::Spectrum::splat(0.8))))
    }
}
