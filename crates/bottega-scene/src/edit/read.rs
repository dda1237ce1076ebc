//! Editing of a scene that was read from a file.

use std::collections::HashMap;
use std::sync::Arc;

use super::keyed_list::KeyedList;
use super::mesh_parts::MeshParts;
use super::object::PlacedObject;
use super::{EditedLight, EditedMesh, EditedSphere, SceneEditor};
use crate::medium::MediumId;
use crate::model::{Instance, Scene};
use crate::motion::TransformKey;
use crate::texture::ImageId;

impl SceneEditor {
    /// Returns an editor of a scene. Keys are the names of the file, made unique by a number (`lamp`, `lamp.1`); a part
    /// without a name is called by its kind. An unchanged scene renders to the same bits as the file.
    ///
    /// - `scene`: a scene that [`Scene::validate`] accepts.
    ///
    /// # Panics
    /// If the scene has an index out of range.
    pub fn of(scene: Scene) -> Self {
        let mut editor = Self::new();
        let Scene { meshes, instances, spheres, materials, lights, cameras, .. } = &scene;
        let material_keys = put_all(&mut editor.materials, materials, |material| (&material.name, material.clone()));
        put_all(&mut editor.lights, lights, |light| {
            let motion = light.motion.clone();
            (&light.name, EditedLight { visibility: light.visibility, motion, ..EditedLight::from(light.kind) })
        });
        put_all(&mut editor.cameras, cameras, |camera| (&camera.name, camera.clone()));
        let (images, media) = (scene.images.iter(), scene.media.iter());
        for (image, number) in images.zip(0..) {
            let key = editor.images.fresh_key(&image.name);
            editor.images.put(&key, ImageId(number));
        }
        for (medium, number) in media.zip(0..) {
            let key = editor.media.fresh_key(&medium.name);
            editor.media.put(&key, MediumId(number));
        }
        let key_of = |material: u32| material_keys[material as usize].clone();
        let mesh_keys = put_all(&mut editor.meshes, meshes.shared(), |mesh| {
            let parts = MeshParts::of(vec![(0, Arc::clone(mesh))]);
            (&mesh.name, EditedMesh { parts, materials: vec![key_of(mesh.material)] })
        });
        // Successive instances of a mesh with the same material are one object, so that their order stays
        let mut runs: Vec<Vec<&Instance>> = Vec::new();
        for instance in instances {
            match runs.last_mut() {
                Some(run) if is_alike(run[0], instance) => run.push(instance),
                _ => runs.push(vec![instance]),
            }
        }
        let mut counts: HashMap<u32, u32> = HashMap::new();
        for run in runs {
            let instance = run[0];
            let transforms = run.iter().map(|it| it.world_from_object).collect();
            let key = |(index, key): (usize, &TransformKey)| {
                (key.time, run.iter().map(|it| it.motion[index].transform).collect())
            };
            let motion = instance.motion.iter().enumerate().map(key).collect();
            let mesh = mesh_keys[instance.mesh as usize].clone();
            // Number the objects of a mesh from the second on
            let count = counts.entry(instance.mesh).or_default();
            let name = if *count == 0 { mesh.clone() } else { format!("{mesh}.{count}") };
            *count += 1;
            let key = editor.objects.fresh_key(&name);
            let materials = instance.material.map(key_of).into_iter().collect();
            let visibility = instance.visibility;
            let object = PlacedObject {
                mesh,
                transforms,
                motion,
                materials,
                instance_materials: Vec::new(),
                hidden: false,
                visibility,
            };
            editor.objects.put(&key, object);
        }
        put_all(&mut editor.spheres, spheres, |sphere| {
            let material = key_of(sphere.material);
            ("", EditedSphere { sphere: sphere.clone(), material, hidden: false })
        });
        editor.base = Scene {
            meshes: Default::default(),
            instances: Vec::new(),
            spheres: Vec::new(),
            materials: Vec::new(),
            lights: Vec::new(),
            cameras: Vec::new(),
            ..scene
        };
        editor
    }
}

/// Returns true if two instances differ in their place alone, and move at the same times.
fn is_alike(a: &Instance, b: &Instance) -> bool {
    (a.mesh, a.material, a.visibility) == (b.mesh, b.material, b.visibility)
        && a.motion.iter().map(|key| key.time).eq(b.motion.iter().map(|key| key.time))
}

/// Puts values into a list under keys made of their names. Returns the keys.
fn put_all<'a, T, U>(list: &mut KeyedList<U>, values: &'a [T], of: impl Fn(&'a T) -> (&'a str, U)) -> Vec<String>
where
    T: 'a,
{
    let mut keys = Vec::with_capacity(values.len());
    for value in values {
        let (name, made) = of(value);
        let key = list.fresh_key(name);
        list.put(&key, made);
        keys.push(key);
    }
    keys
}
