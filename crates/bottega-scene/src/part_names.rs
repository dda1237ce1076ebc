//! Names of the parts of a scene, by which masks find them.

use std::collections::{HashMap, HashSet};

use crate::Scene;

/// The names of all parts of a scene. They depend only on the scene file: parts without a name get one with their
/// number in it.
///
/// The *asset* is the mesh, as scenes keep no groups. The *object* is an instance of it: its name is that of the asset,
/// with the number of the instance behind it if the asset is placed more than once.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct PartNames {
    /// Object and asset of each of [`Scene::instances`].
    pub instances: Vec<[String; 2]>,
    /// Object and asset of each of [`Scene::spheres`].
    pub spheres: Vec<[String; 2]>,
    /// Name of each of [`Scene::materials`]. A mask does not tell apart materials of the same name.
    pub materials: Vec<String>,
}

impl PartNames {
    /// Returns the names of the parts of a scene, in the order of the scene's lists.
    ///
    /// # Panics
    ///
    /// If an instance places a mesh that does not exist.
    pub fn new(scene: &Scene) -> Self {
        let or_number = |name: &str, kind: &str, number: usize| {
            if name.is_empty() { format!("{kind}.{number}") } else { name.to_owned() }
        };
        let meshes: Vec<String> =
            scene.meshes.iter().enumerate().map(|(number, mesh)| or_number(&mesh.name, "mesh", number)).collect();
        // Count the instances of each name
        let mut counts: HashMap<&str, usize> = HashMap::new();
        for instance in &scene.instances {
            *counts.entry(&meshes[instance.mesh as usize]).or_default() += 1;
        }
        // Number those of names that occur more than once, past names that are taken
        let mut taken: HashSet<String> = meshes.iter().cloned().collect();
        let mut next: HashMap<&str, usize> = HashMap::new();
        let mut object = |asset: &str, number: &mut usize| loop {
            let name = format!("{asset}.{number}");
            *number += 1;
            if taken.insert(name.clone()) {
                return name;
            }
        };
        let mut instances = Vec::with_capacity(scene.instances.len());
        for instance in &scene.instances {
            let asset = &meshes[instance.mesh as usize];
            let is_only = counts[asset.as_str()] == 1;
            let name = if is_only { asset.clone() } else { object(asset, next.entry(asset).or_default()) };
            instances.push([name, asset.clone()]);
        }
        let mut number = 0;
        let spheres = scene.spheres.iter().map(|_| object("sphere", &mut number)).map(|name| [name.clone(), name]);
        let spheres = spheres.collect();
        let materials = scene.materials.iter().enumerate();
        let materials = materials.map(|(number, material)| or_number(&material.name, "material", number)).collect();
        Self { instances, spheres, materials }
    }
}

#[cfg(test)]
mod tests {
    use glam::Affine3A;

    use super::*;
    use crate::{Instance, Material, Mesh};

    #[test]
    fn parts_have_the_names_of_the_file_and_numbers_where_it_has_none() {
        let mesh = |name: &str| Mesh { name: name.to_owned(), ..Mesh::default() };
        let material = |name: &str| Material { name: name.to_owned(), ..Material::default() };
        let scene = Scene {
            meshes: vec![mesh("tree"), mesh(""), mesh("tree.1")].into(),
            instances: [0, 0, 1, 2, 0].map(|mesh| Instance::new(mesh, Affine3A::IDENTITY)).to_vec(),
            materials: vec![material("bark"), material("")],
            ..Scene::default()
        };
        let names = PartNames::new(&scene);
        let objects: Vec<&str> = names.instances.iter().map(|[object, _]| object.as_str()).collect();
        assert_eq!(objects, ["tree.0", "tree.2", "mesh.1", "tree.1", "tree.3"]);
        let assets: Vec<&str> = names.instances.iter().map(|[_, asset]| asset.as_str()).collect();
        assert_eq!(assets, ["tree", "tree", "mesh.1", "tree.1", "tree"]);
        assert_eq!(names.materials, ["bark", "material.1"]);
    }
}
