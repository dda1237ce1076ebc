//! A scene that is changed part by part: everything has a key, and is added, replaced, moved, hidden and removed by it.
//!
//! An edit either holds as a whole or is refused with an [`EditError`] and changes nothing. [`SceneEditor::snapshot`] makes a
//! [`Scene`] of the present state, which shares meshes and images with the editor, so sessions and later edits do not
//! disturb each other.

pub(crate) mod corner_mesh;
mod curve_strands;
mod entries;
mod error;
mod keyed_list;
pub(crate) mod mesh_parts;
mod object;
mod read;
mod snapshot;
mod users;

use std::sync::Arc;

use glam::{Affine3A, Vec3};
use serde::{Deserialize, Serialize};

pub use self::{
    corner_mesh::CornerMesh,
    curve_strands::CurveStrands,
    error::{EditError, EntryKind},
    keyed_list::PutMode,
    object::{MatrixRows, PlacedObject},
};
use self::{keyed_list::KeyedList, mesh_parts::MeshParts, object::check_transforms};
use crate::camera::Camera;
use crate::image::Image;
use crate::keys::check_transform_keys;
use crate::light::LightKind;
use crate::material::Material;
use crate::medium::MediumId;
use crate::model::{Mesh, Scene, Sphere};
use crate::motion::{Shutter, SphereKey, TransformKey};
use crate::shaped_light::{AreaLight, SphereLight};
use crate::texture::ImageId;
use crate::validate::check_sphere;
use crate::visibility::Visibility;

/// A scene whose parts have keys, by which they are added, replaced, moved, hidden and removed. An edit that returns an
/// error changes nothing.
#[derive(Clone, Debug)]
pub struct SceneEditor {
    /// Images, media, mappings, environment and origin; everything else is in the lists.
    base: Scene,
    images: KeyedList<ImageId>,
    media: KeyedList<MediumId>,
    materials: KeyedList<Material>,
    meshes: KeyedList<EditedMesh>,
    objects: KeyedList<PlacedObject>,
    spheres: KeyedList<EditedSphere>,
    lights: KeyedList<EditedLight>,
    cameras: KeyedList<Camera>,
}

/// A mesh and the keys of its materials by slot.
#[derive(Clone, Debug)]
struct EditedMesh {
    parts: MeshParts,
    materials: Vec<String>,
}

/// A sphere with the key of its material.
#[derive(Clone, Debug)]
struct EditedSphere {
    sphere: Sphere,
    material: String,
    hidden: bool,
}

/// A light of a [`SceneEditor`]: its kind, the rays that it reaches, and its motion.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct EditedLight {
    /// The kind, position and strength of the light.
    pub kind: EditedLightKind,
    /// Kinds of ray that the light reaches.
    #[serde(default)]
    pub visibility: Visibility,
    /// Keys of a transformation of the light from where [`Self::kind`] puts it, world space to world space, if it moves.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub motion: Vec<TransformKey>,
    #[serde(skip)]
    hidden: bool,
}

/// The kind of an [`EditedLight`], with its position and strength.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum EditedLightKind {
    /// A sphere: a point or spot light with a radius.
    Sphere(SphereLight),
    /// A rectangle or ellipse.
    Area(AreaLight),
    /// A light without extent, or at infinity.
    #[serde(untagged)]
    Plain(LightKind),
}

impl From<LightKind> for EditedLight {
    fn from(kind: LightKind) -> Self {
        Self { kind: EditedLightKind::Plain(kind), visibility: Visibility::ALL, motion: Vec::new(), hidden: false }
    }
}

impl Default for SceneEditor {
    fn default() -> Self {
        Self::new()
    }
}

impl SceneEditor {
    /// Returns an editor of an empty scene.
    pub fn new() -> Self {
        Self {
            base: Scene::default(),
            images: KeyedList::new(EntryKind::Image),
            media: KeyedList::new(EntryKind::Medium),
            materials: KeyedList::new(EntryKind::Material),
            meshes: KeyedList::new(EntryKind::Mesh),
            objects: KeyedList::new(EntryKind::Object),
            spheres: KeyedList::new(EntryKind::Sphere),
            lights: KeyedList::new(EntryKind::Light),
            cameras: KeyedList::new(EntryKind::Camera),
        }
    }

    /// Adds or replaces an image. Its name becomes `key`.
    ///
    /// # Errors
    /// The key is empty or, with [`PutMode::New`], taken.
    pub fn put_image(&mut self, key: &str, image: Image, mode: PutMode) -> Result<(), EditError> {
        self.images.check(key, mode)?;
        let mut image = image;
        key.clone_into(&mut image.name);
        let image = Arc::new(image);
        match self.images.find(key) {
            Some(id) => self.base.images.set_shared(id.0 as usize, image),
            None => {
                self.images.put(key, ImageId(self.base.images.len() as u32));
                self.base.images.push_shared(image);
            }
        }
        Ok(())
    }

    /// Adds or replaces a mesh. Objects that place it are changed with it.
    ///
    /// - `materials`: keys of its materials by slot. Empty: all slots are gray.
    ///
    /// # Errors
    /// The key is empty or, with [`PutMode::New`], taken; an array is wrong; a material does not exist; a triangle has
    /// a slot beyond `materials`, unless these are empty; or an object that places the mesh has a matrix that moves it
    /// out of reach.
    pub fn put_mesh(
        &mut self,
        key: &str,
        mesh: &CornerMesh<'_>,
        materials: Vec<String>,
        mode: PutMode,
    ) -> Result<(), EditError> {
        self.meshes.check(key, mode)?;
        self.check_materials(&materials)?;
        let parts = MeshParts::new(key, mesh, materials.len())?;
        self.put_parts(key, parts, materials)
    }

    /// Adds or replaces a mesh whose vertices move.
    ///
    /// - `mesh`: the mesh when the shutter opens.
    /// - `keys`: times, ascending, in the unit of the shutter's times, each with the mesh at that time, which differs
    ///   from `mesh` in positions and normals alone.
    /// - `materials`: as for [`Self::put_mesh`].
    ///
    /// # Errors
    /// The same as [`Self::put_mesh`]; the times are not finite, do not ascend or are more than 4096; or a key has
    /// other triangles than the mesh.
    pub fn put_moving_mesh(
        &mut self,
        key: &str,
        mesh: &CornerMesh<'_>,
        keys: &[(f64, CornerMesh<'_>)],
        materials: Vec<String>,
        mode: PutMode,
    ) -> Result<(), EditError> {
        self.meshes.check(key, mode)?;
        self.check_materials(&materials)?;
        let mut parts = MeshParts::new(key, mesh, materials.len())?;
        let keys = keys.iter().map(|(time, mesh)| Ok((*time, MeshParts::new(key, mesh, materials.len())?)));
        parts = parts.moving(&keys.collect::<Result<Vec<_>, EditError>>()?)?;
        self.put_parts(key, parts, materials)
    }

    /// Adds or replaces a mesh of curves, with one material slot. Objects that place it are changed with it.
    ///
    /// - `materials`: the key of the material, or none: gray.
    ///
    /// # Errors
    /// The key is empty or, with [`PutMode::New`], taken; an array is wrong; a curve has no length, unless these are
    /// left out; the material does not exist; or an object that places the mesh has a matrix that moves it out of
    /// reach.
    pub fn put_curves(
        &mut self,
        key: &str,
        curves: &CurveStrands<'_>,
        materials: Vec<String>,
        mode: PutMode,
    ) -> Result<(), EditError> {
        self.meshes.check(key, mode)?;
        self.check_materials(&materials)?;
        let parts = curves.parts(key)?;
        self.put_parts(key, parts, materials)
    }

    fn put_parts(&mut self, key: &str, parts: MeshParts, materials: Vec<String>) -> Result<(), EditError> {
        for (_, object) in self.objects.iter().filter(|(_, object)| object.mesh == key) {
            check_transforms(&object.transforms, parts.bounds)?;
            object.check_motion(parts.bounds)?;
        }
        self.meshes.put(key, EditedMesh { parts, materials });
        Ok(())
    }

    /// Returns the parts of a mesh, one for each material slot in use, in the order of the slots, and the keys of its
    /// materials by slot.
    ///
    /// # Errors
    /// There is no such mesh.
    pub fn mesh(&self, key: &str) -> Result<(Vec<&Mesh>, &[String]), EditError> {
        let mesh = self.meshes.get(key)?;
        Ok((mesh.parts.parts.iter().map(|(_, mesh)| &**mesh).collect(), &mesh.materials))
    }

    /// Replaces the materials of a mesh.
    ///
    /// - `materials`: keys by slot; slots beyond them are gray.
    ///
    /// # Errors
    /// There is no such mesh, or a material does not exist.
    pub fn set_mesh_materials(&mut self, key: &str, materials: Vec<String>) -> Result<(), EditError> {
        self.meshes.get(key)?;
        self.check_materials(&materials)?;
        self.meshes.get_mut(key)?.materials = materials;
        Ok(())
    }

    /// Adds or replaces an object: a mesh placed in the world, once or many times.
    ///
    /// # Errors
    /// The key is empty or, with [`PutMode::New`], taken; the mesh or a material does not exist; a matrix is singular
    /// or moves the mesh out of reach; the keys of its motion are wrong, as for [`Self::set_object_motion`]; or the
    /// materials by instance are not one per instance, or not among the object's materials.
    pub fn put_object(&mut self, key: &str, object: PlacedObject, mode: PutMode) -> Result<(), EditError> {
        self.objects.check(key, mode)?;
        let bounds = self.meshes.get(&object.mesh)?.parts.bounds;
        check_transforms(&object.transforms, bounds)?;
        object.check_motion(bounds)?;
        self.check_materials(&object.materials)?;
        object.check_choice()?;
        self.objects.put(key, object);
        Ok(())
    }

    /// Returns the object with a key.
    ///
    /// # Errors
    /// There is no such object.
    pub fn object(&self, key: &str) -> Result<&PlacedObject, EditError> {
        self.objects.get(key)
    }

    /// Places an object elsewhere; its motion, if any, is removed.
    ///
    /// - `transforms`: object space to world space of each instance.
    ///
    /// # Errors
    /// There is no such object; a matrix is singular or moves the mesh out of reach; or the object has materials by
    /// instance for another number of instances. Put the object again to change that number.
    pub fn move_object(&mut self, key: &str, transforms: Vec<Affine3A>) -> Result<(), EditError> {
        let object = self.objects.get(key)?;
        check_transforms(&transforms, self.meshes.get(&object.mesh)?.parts.bounds)?;
        if !object.instance_materials.is_empty() && object.instance_materials.len() != transforms.len() {
            let problem = format!(
                "there are {}, and the object has materials by instance for {}",
                transforms.len(),
                object.instance_materials.len()
            );
            return Err(EditError::argument("transforms", problem, "put the object again, with both"));
        }
        let object = self.objects.get_mut(key)?;
        (object.transforms, object.motion) = (transforms, Vec::new());
        Ok(())
    }

    /// Sets the path of an object while the shutter is open.
    ///
    /// - `motion`: times, ascending, in the unit of the shutter's times, each with one matrix from object space to
    ///   world space per instance. Empty: the object stands still.
    ///
    /// # Errors
    /// There is no such object; the times are not finite, do not ascend or are more than 4096; a key has another number
    /// of matrices than the object has instances; or a matrix is singular, moves the mesh out of reach, or mirrors
    /// where others do not.
    pub fn set_object_motion(&mut self, key: &str, motion: Vec<(f64, Vec<Affine3A>)>) -> Result<(), EditError> {
        let object = PlacedObject { motion, ..self.objects.get(key)?.clone() };
        object.check_motion(self.meshes.get(&object.mesh)?.parts.bounds)?;
        self.objects.put(key, object);
        Ok(())
    }

    /// Sets the path of a camera or a light while the shutter is open.
    ///
    /// - `motion`: keys, with times that ascend. Those of a camera are its matrices; those of a light move it, in world
    ///   space, from where it was put. Empty: it stands still.
    ///
    /// # Errors
    /// There is no such thing; it is neither a camera nor a light; the times are not finite, do not ascend or are more
    /// than 4096; or a matrix is singular, out of reach, or mirrors where others do not.
    pub fn set_motion(&mut self, kind: EntryKind, key: &str, motion: Vec<TransformKey>) -> Result<(), EditError> {
        check_transform_keys(&motion).map_err(|problem| EditError::value(kind, key, &problem))?;
        match kind {
            EntryKind::Camera => {
                let camera = Camera { motion, ..self.cameras.get(key)?.clone() };
                self.cameras.put(key, camera);
            }
            EntryKind::Light => self.lights.get_mut(key)?.motion = motion,
            _ => return Err(EditError::value(kind, key, &"it is neither a camera nor a light")),
        }
        Ok(())
    }

    /// Sets the path of a sphere while the shutter is open.
    ///
    /// - `motion`: times, ascending, in the unit of the shutter's times, each with the centre in world space and the
    ///   radius in scene units. Empty: the sphere stands still.
    ///
    /// # Errors
    /// There is no such sphere; the times are not finite, do not ascend or are more than 4096; a centre is out of
    /// reach; or a radius is not above 0 and at most [`COORDINATE_MAX`](crate::COORDINATE_MAX).
    pub fn set_sphere_motion(&mut self, key: &str, motion: Vec<(f64, Vec3, f32)>) -> Result<(), EditError> {
        let sphere = &self.spheres.get(key)?.sphere;
        let world_from_object = sphere.world_from_object;
        let keys =
            motion.into_iter().map(|(time, center, radius)| SphereKey { time, center, radius, world_from_object });
        let moving = Sphere { motion: keys.collect(), ..sphere.clone() };
        check_sphere(&moving).map_err(|problem| EditError::value(EntryKind::Sphere, key, &problem))?;
        self.spheres.get_mut(key)?.sphere = moving;
        Ok(())
    }

    /// Sets the span of time that pictures show, and the light that the shutter lets pass in the course of it.
    ///
    /// # Errors
    /// It closes before it opens, a time is not finite, or its ramp is not from 0 to 0.5.
    pub fn set_shutter(&mut self, shutter: Shutter) -> Result<(), EditError> {
        if !shutter.is_sound() {
            let problem =
                format!("it opens at {}, closes at {} and has a ramp of {}", shutter.open, shutter.close, shutter.ramp);
            let remedy = "finite times in order are needed, and a ramp from 0 to 0.5";
            return Err(EditError::argument("shutter", problem, remedy));
        }
        self.base.shutter = shutter;
        Ok(())
    }

    /// Returns the span of time that pictures show.
    pub fn shutter(&self) -> Shutter {
        self.base.shutter
    }

    /// Sets the kinds of ray for which an object exists. Rays of other kinds pass through it.
    ///
    /// # Errors
    /// There is no such object.
    pub fn set_object_visibility(&mut self, key: &str, visibility: Visibility) -> Result<(), EditError> {
        self.objects.get_mut(key)?.visibility = visibility;
        Ok(())
    }

    /// Hides an object, a sphere or a light (`hidden`), or shows it again (`!hidden`). A hidden thing keeps its key,
    /// and is not in the picture.
    ///
    /// # Errors
    /// There is no such thing, or its kind cannot be hidden.
    pub fn hide(&mut self, kind: EntryKind, key: &str, hidden: bool) -> Result<(), EditError> {
        self.check_exists(kind, key)?;
        match kind {
            EntryKind::Object => self.objects.get_mut(key)?.hidden = hidden,
            EntryKind::Sphere => self.spheres.get_mut(key)?.hidden = hidden,
            EntryKind::Light => self.lights.get_mut(key)?.hidden = hidden,
            _ => return Err(EditError::value(kind, key, &"it cannot be hidden: remove it")),
        }
        Ok(())
    }

    /// Returns true if an object, a sphere or a light is hidden; false for the other kinds, which cannot be hidden.
    ///
    /// # Errors
    /// There is no such object, sphere or light.
    pub fn is_hidden(&self, kind: EntryKind, key: &str) -> Result<bool, EditError> {
        Ok(match kind {
            EntryKind::Object => self.objects.get(key)?.hidden,
            EntryKind::Sphere => self.spheres.get(key)?.hidden,
            EntryKind::Light => self.lights.get(key)?.hidden,
            _ => false,
        })
    }

    /// Sorts the entries of a kind by a list of keys, as if they had been added in this order. Entries without one of
    /// these keys follow, in their order. A picture depends on the order.
    ///
    /// # Errors
    /// A key does not exist; nothing has changed then.
    pub fn arrange(&mut self, kind: EntryKind, keys: &[String]) -> Result<(), EditError> {
        match kind {
            EntryKind::Image => self.images.arrange(keys),
            EntryKind::Medium => self.media.arrange(keys),
            EntryKind::Material => self.materials.arrange(keys),
            EntryKind::Mesh => self.meshes.arrange(keys),
            EntryKind::Object => self.objects.arrange(keys),
            EntryKind::Sphere => self.spheres.arrange(keys),
            EntryKind::Light => self.lights.arrange(keys),
            EntryKind::Camera => self.cameras.arrange(keys),
        }
    }

    /// Returns the keys of all entries of a kind, also of hidden ones, in the order in which they were added or
    /// [arranged](Self::arrange).
    pub fn keys(&self, kind: EntryKind) -> Vec<&str> {
        match kind {
            EntryKind::Image => self.images.keys().collect(),
            EntryKind::Medium => self.media.keys().collect(),
            EntryKind::Material => self.materials.keys().collect(),
            EntryKind::Mesh => self.meshes.keys().collect(),
            EntryKind::Object => self.objects.keys().collect(),
            EntryKind::Sphere => self.spheres.keys().collect(),
            EntryKind::Light => self.lights.keys().collect(),
            EntryKind::Camera => self.cameras.keys().collect(),
        }
    }

    /// Returns the number of entries of a kind, with hidden ones.
    pub fn count(&self, kind: EntryKind) -> usize {
        match kind {
            EntryKind::Image => self.images.len(),
            EntryKind::Medium => self.media.len(),
            EntryKind::Material => self.materials.len(),
            EntryKind::Mesh => self.meshes.len(),
            EntryKind::Object => self.objects.len(),
            EntryKind::Sphere => self.spheres.len(),
            EntryKind::Light => self.lights.len(),
            EntryKind::Camera => self.cameras.len(),
        }
    }

    /// Returns true if an entry of a kind has this key.
    pub fn contains(&self, kind: EntryKind, key: &str) -> bool {
        self.check_exists(kind, key).is_ok()
    }

    fn check_exists(&self, kind: EntryKind, key: &str) -> Result<(), EditError> {
        match kind {
            EntryKind::Image => self.images.get(key).map(|_| ()),
            EntryKind::Medium => self.media.get(key).map(|_| ()),
            EntryKind::Material => self.materials.get(key).map(|_| ()),
            EntryKind::Mesh => self.meshes.get(key).map(|_| ()),
            EntryKind::Object => self.objects.get(key).map(|_| ()),
            EntryKind::Sphere => self.spheres.get(key).map(|_| ()),
            EntryKind::Light => self.lights.get(key).map(|_| ()),
            EntryKind::Camera => self.cameras.get(key).map(|_| ()),
        }
    }

    /// Removes an entry by its key.
    ///
    /// # Errors
    /// There is no such entry, or something else refers to it.
    pub fn remove(&mut self, kind: EntryKind, key: &str) -> Result<(), EditError> {
        self.check_exists(kind, key)?;
        if let Some(user) = self.user_of(kind, key) {
            return Err(EditError::InUse { kind, key: key.to_owned(), user });
        }
        match kind {
            // Numbers of images and media stay: others hold them. What was removed takes no memory.
            EntryKind::Image => {
                let id = self.images.remove(key)?;
                self.base.images.set_shared(id.0 as usize, Arc::new(Image::missing("removed")));
            }
            EntryKind::Medium => {
                let id = self.media.remove(key)?;
                self.base.media[id.0 as usize] = crate::medium::Medium::absorbing(crate::color::Spectrum::ZERO);
            }
            EntryKind::Material => drop(self.materials.remove(key)?),
            EntryKind::Mesh => drop(self.meshes.remove(key)?),
            EntryKind::Object => drop(self.objects.remove(key)?),
            EntryKind::Sphere => drop(self.spheres.remove(key)?),
            EntryKind::Light => {
                self.lights.remove(key)?;
            }
            EntryKind::Camera => drop(self.cameras.remove(key)?),
        }
        Ok(())
    }

    fn check_materials(&self, keys: &[String]) -> Result<(), EditError> {
        keys.iter().try_for_each(|key| self.materials.get(key).map(|_| ()))
    }
}
