//! Cryptomatte identities of the parts of a scene.

use bottega_image::identity;
use bottega_kernels::Hit;
use bottega_scene::{PartNames, Scene};

/// The identities of all parts of a scene, by their indices.
#[derive(Debug)]
pub(crate) struct Identities {
    /// Object and asset of each instance.
    instances: Vec<[f32; 2]>,
    /// Object and asset of each sphere.
    spheres: Vec<[f32; 2]>,
    materials: Vec<f32>,
}

impl Identities {
    /// Computes the identities of a scene.
    pub(crate) fn new(scene: &Scene) -> Self {
        let names = PartNames::new(scene);
        let pair = |[object, asset]: &[String; 2]| [identity(object), identity(asset)];
        Self {
            instances: names.instances.iter().map(pair).collect(),
            spheres: names.spheres.iter().map(pair).collect(),
            materials: names.materials.iter().map(|name| identity(name)).collect(),
        }
    }

    /// Returns the identities of object, material and asset at a hit.
    pub(crate) fn of(&self, hit: &Hit, material: u32) -> [f32; 3] {
        let [object, asset] = match hit.sphere() {
            Some(sphere) => self.spheres[sphere as usize],
            None => self.instances[hit.instance as usize],
        };
        [object, self.materials[material as usize], asset]
    }
}
