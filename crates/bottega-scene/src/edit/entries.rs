//! Materials, media, lights, cameras, spheres and the environment of an editor.

use std::borrow::Cow;

use glam::Mat3;

use super::{EditError, EditedLight, EditedLightKind, EditedSphere, EntryKind, PutMode, SceneEditor};
use crate::camera::Camera;
use crate::keys::check_transform_keys;
use crate::light::Environment;
use crate::material::Material;
use crate::medium::{Medium, MediumId};
use crate::model::Sphere;
use crate::texture::ImageId;

/// Greatest deviation of the product of a camera's axes from that of a rotation.
const ROTATION_TOLERANCE: f32 = 1e-3;

impl SceneEditor {
    /// Adds or replaces a material.
    ///
    /// - `material`: refers to images and media by numbers of this editor; see [`Self::image_id`] and
    ///   [`Self::medium_id`].
    ///
    /// # Errors
    /// The key is empty or, with [`PutMode::New`], taken; a value is out of range; or an image, a medium or a set of
    /// texture coordinates does not exist.
    pub fn put_material(&mut self, key: &str, material: Material, mode: PutMode) -> Result<(), EditError> {
        self.materials.check(key, mode)?;
        let checked = self.base.check_parameters(&material);
        checked.map_err(|problem| EditError::value(EntryKind::Material, key, &problem))?;
        self.materials.put(key, material);
        Ok(())
    }

    /// Returns the material with a key.
    ///
    /// # Errors
    /// There is no such material.
    pub fn material(&self, key: &str) -> Result<&Material, EditError> {
        self.materials.get(key)
    }

    /// Adds or replaces a medium. Its name becomes `key`.
    ///
    /// # Errors
    /// The key is empty or, with [`PutMode::New`], taken; or a value is out of range.
    pub fn put_medium(&mut self, key: &str, medium: Medium, mode: PutMode) -> Result<(), EditError> {
        self.media.check(key, mode)?;
        crate::validate::check_medium(&medium).map_err(|problem| EditError::value(EntryKind::Medium, key, &problem))?;
        let medium = Medium { name: key.to_owned(), ..medium };
        match self.media.find(key) {
            Some(id) => self.base.media[id.0 as usize] = medium,
            None => self.media.put(key, self.base.push_medium(medium)),
        }
        Ok(())
    }

    /// Returns the medium with a key.
    ///
    /// # Errors
    /// There is no such medium.
    pub fn medium(&self, key: &str) -> Result<&Medium, EditError> {
        Ok(&self.base.media[self.media.get(key)?.0 as usize])
    }

    /// Adds or replaces a light. A hidden light stays hidden.
    ///
    /// # Errors
    /// The key is empty or, with [`PutMode::New`], taken; a value is out of range; an image does not exist; or the keys
    /// of its motion are wrong, as for [`Self::set_motion`].
    pub fn put_light(&mut self, key: &str, light: impl Into<EditedLight>, mode: PutMode) -> Result<(), EditError> {
        self.lights.check(key, mode)?;
        let light = light.into();
        let checked = match &light.kind {
            EditedLightKind::Plain(kind) => self.base.check_light(kind).map_err(|problem| problem.0),
            EditedLightKind::Sphere(light) => {
                light.material().map_err(Cow::from).and_then(|it| self.check_emitter(&it))
            }
            EditedLightKind::Area(light) => light.material().map_err(Cow::from).and_then(|it| self.check_emitter(&it)),
        };
        checked.map_err(|problem| EditError::value(EntryKind::Light, key, &problem))?;
        check_transform_keys(&light.motion).map_err(|problem| EditError::value(EntryKind::Light, key, &problem))?;
        let hidden = self.lights.find(key).is_some_and(|before| before.hidden);
        self.lights.put(key, EditedLight { hidden, ..light });
        Ok(())
    }

    /// Checks the material of a light with a shape.
    fn check_emitter(&self, material: &Material) -> Result<(), Cow<'static, str>> {
        self.base.check_parameters(material).map_err(|problem| problem.0)
    }

    /// Returns the light with a key.
    ///
    /// # Errors
    /// There is no such light.
    pub fn light(&self, key: &str) -> Result<&EditedLight, EditError> {
        self.lights.get(key)
    }

    /// Adds or replaces a camera. Pictures for which no camera is named show the first one.
    ///
    /// # Errors
    /// The key is empty or, with [`PutMode::New`], taken; or the errors of [`Self::check_camera`].
    pub fn put_camera(&mut self, key: &str, camera: Camera, mode: PutMode) -> Result<(), EditError> {
        self.cameras.check(key, mode)?;
        self.check_camera(key, &camera)?;
        self.cameras.put(key, camera);
        Ok(())
    }

    /// Checks that the scene can be seen through a camera. Changes nothing.
    ///
    /// - `key`: names the camera in the error; it need not exist.
    ///
    /// # Errors
    /// A value is out of range; the matrix scales or shears; the medium does not exist; or the keys of its motion are
    /// wrong, as for [`Self::set_motion`].
    pub fn check_camera(&self, key: &str, camera: &Camera) -> Result<(), EditError> {
        let checked = self.base.check_camera(camera);
        checked.map_err(|problem| EditError::value(EntryKind::Camera, key, &problem))?;
        let axes = Mat3::from(camera.world_from_camera.matrix3);
        if !(axes * axes.transpose()).abs_diff_eq(Mat3::IDENTITY, ROTATION_TOLERANCE) {
            let problem = "its matrix scales or shears; normalize its first three columns";
            return Err(EditError::value(EntryKind::Camera, key, &problem));
        }
        Ok(())
    }

    /// Returns the camera with a key.
    ///
    /// # Errors
    /// There is no such camera.
    pub fn camera(&self, key: &str) -> Result<&Camera, EditError> {
        self.cameras.get(key)
    }

    /// Adds or replaces a sphere. A hidden one stays hidden.
    ///
    /// - `material`: the key of its material; the number in `sphere` has no meaning.
    ///
    /// # Errors
    /// The key is empty or, with [`PutMode::New`], taken; a value is out of range; the material does not exist; or the
    /// keys of its motion are wrong, as for [`Self::set_sphere_motion`].
    pub fn put_sphere(&mut self, key: &str, sphere: Sphere, material: String, mode: PutMode) -> Result<(), EditError> {
        self.spheres.check(key, mode)?;
        crate::validate::check_sphere(&sphere).map_err(|problem| EditError::value(EntryKind::Sphere, key, &problem))?;
        self.materials.get(&material)?;
        let hidden = self.spheres.find(key).is_some_and(|before| before.hidden);
        self.spheres.put(key, EditedSphere { sphere, material, hidden });
        Ok(())
    }

    /// Returns the sphere with a key, and the key of its material. The number of the material in the sphere has no
    /// meaning.
    ///
    /// # Errors
    /// There is no such sphere.
    pub fn sphere(&self, key: &str) -> Result<(&Sphere, &str), EditError> {
        self.spheres.get(key).map(|it| (&it.sphere, &*it.material))
    }

    /// Sets the environment, the light from infinitely far away; `None`: it is black.
    ///
    /// # Errors
    /// A value is out of range, its image does not exist, its orientation is not a rotation, or a portal is not a
    /// rectangle.
    pub fn set_environment(&mut self, environment: Option<Environment>) -> Result<(), EditError> {
        if let Some(environment) = &environment {
            let checked = self.base.check_environment(environment);
            checked.map_err(|problem| EditError::Environment { problem: problem.to_string() })?;
        }
        self.base.environment = environment;
        Ok(())
    }

    /// Returns the environment, the light from infinitely far away; `None`: it is black.
    pub fn environment(&self) -> Option<&Environment> {
        self.base.environment.as_ref()
    }

    /// Returns the number by which textures refer to an image. It stays until the image is removed.
    ///
    /// # Errors
    /// There is no such image.
    pub fn image_id(&self, key: &str) -> Result<ImageId, EditError> {
        self.images.get(key).copied()
    }

    /// Returns the key of the image with this number; `None`: there is no such image.
    pub fn image_key(&self, id: ImageId) -> Option<&str> {
        self.images.iter().find(|(_, number)| **number == id).map(|(key, _)| key)
    }

    /// Returns the number of columns and the number of rows of an image, in texels.
    ///
    /// # Errors
    /// There is no such image.
    pub fn image_size(&self, key: &str) -> Result<(u32, u32), EditError> {
        Ok(self.base.images[self.images.get(key)?.0 as usize].size())
    }

    /// Returns the number by which materials and cameras refer to a medium. It stays until the medium is removed.
    ///
    /// # Errors
    /// There is no such medium.
    pub fn medium_id(&self, key: &str) -> Result<MediumId, EditError> {
        self.media.get(key).copied()
    }

    /// Returns the key of the medium with this number; `None`: there is no such medium.
    pub fn medium_key(&self, id: MediumId) -> Option<&str> {
        self.media.iter().find(|(_, number)| **number == id).map(|(key, _)| key)
    }
}
