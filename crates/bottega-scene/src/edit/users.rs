//! Searches for something that refers to a part of the scene.

use super::{EditedLightKind, EntryKind, SceneEditor};
use crate::light::LightKind;
use crate::texture::ImageId;

impl SceneEditor {
    /// Returns a description of something that refers to a part of the scene; `None`: nothing does.
    pub(super) fn user_of(&self, kind: EntryKind, key: &str) -> Option<String> {
        match kind {
            EntryKind::Image => self.images.find(key).and_then(|&image| self.user_of_image(image)),
            EntryKind::Medium => {
                let medium = Some(*self.media.find(key)?);
                let mut materials = self.materials.iter();
                let material = materials.find(|(_, it)| it.interior == medium || it.exterior == medium);
                let camera = || self.cameras.iter().find(|(_, camera)| camera.medium == medium);
                material
                    .map(|(key, _)| named(EntryKind::Material, key))
                    .or_else(|| camera().map(|(key, _)| named(EntryKind::Camera, key)))
            }
            EntryKind::Material => {
                let has_it = |keys: &[String]| keys.iter().any(|material| material == key);
                let mesh = self.meshes.iter().find(|(_, mesh)| has_it(&mesh.materials));
                let object = || self.objects.iter().find(|(_, object)| has_it(&object.materials));
                let sphere = || self.spheres.iter().find(|(_, sphere)| sphere.material == key);
                mesh.map(|(key, _)| named(EntryKind::Mesh, key))
                    .or_else(|| object().map(|(key, _)| named(EntryKind::Object, key)))
                    .or_else(|| sphere().map(|(key, _)| named(EntryKind::Sphere, key)))
            }
            EntryKind::Mesh => {
                let object = self.objects.iter().find(|(_, object)| object.mesh == key);
                object.map(|(key, _)| named(EntryKind::Object, key))
            }
            EntryKind::Object | EntryKind::Sphere | EntryKind::Light | EntryKind::Camera => None,
        }
    }

    fn user_of_image(&self, image: ImageId) -> Option<String> {
        let mut materials = self.materials.iter();
        if let Some((key, _)) = materials.find(|(_, it)| it.uses_image(image)) {
            return Some(named(EntryKind::Material, key));
        }
        let is_lit_by = |kind: &EditedLightKind| match kind {
            EditedLightKind::Plain(LightKind::Projector { picture, .. }) => picture.image == image,
            EditedLightKind::Plain(LightKind::Goniometric { image: of, .. }) => *of == image,
            EditedLightKind::Area(light) => {
                light.texture.is_some_and(|map| map.image == image)
                    || light.profile.is_some_and(|picture| picture.image == image)
            }
            EditedLightKind::Sphere(light) => light.profile.is_some_and(|picture| picture.image == image),
            _ => false,
        };
        if let Some((key, _)) = self.lights.iter().find(|(_, it)| is_lit_by(&it.kind)) {
            return Some(named(EntryKind::Light, key));
        }
        let environment = self.base.environment.as_ref()?;
        (environment.image == Some(image)).then(|| "environment".to_owned())
    }
}

fn named(kind: EntryKind, key: &str) -> String {
    format!("{kind} `{key}`")
}
