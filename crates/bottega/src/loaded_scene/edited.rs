//! Another state of a scene in memory, for which only what has changed is prepared again.

use std::{sync::Arc, time::Instant};

use bottega_render::{PrepareOptions, PreparedScene, SceneGeometry, View, build_accel};
use bottega_scene::{Camera, Loaded, Mesh, Scene, SharedList};

use super::{LoadedScene, aimed, displace_meshes, no_camera, size, turn_environment};
use crate::{devices::threads, error::Error, request::Request};

/// Largest number of triangles of meshes that are compared by content if they are not shared. Each state of a scene has its
/// own meshes for area lights.
const COMPARED_MAX: usize = 4096;

/// The parts of a prepared scene that another one may share with it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Likeness {
    /// Everything but the cameras.
    AllButCameras,
    /// All shapes and their places: materials, lights or the environment differ.
    Shapes,
    /// All shapes, some of which have moved.
    MovedShapes,
    /// Nothing that saves work.
    Nothing,
}

impl LoadedScene {
    /// Prepares another state of the same scene; the picture is bit-identical to that of a scene prepared from the start. Cameras
    /// are exchanged, other changes keep the acceleration structure, and where things have only moved it is refitted.
    ///
    /// - `scene`: a valid state of the scene, such as [`bottega_scene::SceneEditor::snapshot`] returns.
    ///
    /// # Errors
    /// The scene has no camera or not the requested one, or cannot be prepared; the lens or pose of the request does not suit the
    /// camera, or the picture is too large.
    pub fn edited(self, scene: impl Into<Loaded>, request: &Request) -> Result<Self, Error> {
        let Loaded { mut scene, mut warnings, hints, files, .. } = scene.into();
        displace_meshes(&mut scene, request, &mut warnings);
        if scene.cameras.is_empty() {
            return Err(no_camera());
        }
        turn_environment(&mut scene, request);
        let cameras = scene.cameras.clone();
        let (camera, aimed) = aimed(&cameras, scene.origin, &request.view)?;
        let [width, height] = size(request, &hints, &aimed)?;
        scene.cameras[camera] = aimed.clone();
        let mut hints = hints;
        hints.crop = hints.crop.filter(|_| request.film.size.is_none());
        let kind = likeness(self.scene(), &scene);
        let prepared = if kind == Likeness::AllButCameras && self.has_alike(&aimed) {
            self.prepared
        } else {
            prepared_again(self.prepared, scene, kind, request)?
        };
        let view = View { camera: Arc::new(aimed), width, height };
        let loaded = Instant::now();
        Ok(Self { prepared, prepass: Arc::default(), view, camera, cameras, warnings, hints, files, loaded })
    }

    /// Returns true if the scene was prepared for a camera in the same medium that sees the same things.
    fn has_alike(&self, camera: &Camera) -> bool {
        let is_alike = |other: &Camera| other.medium == camera.medium && other.hides_emitters == camera.hides_emitters;
        self.scene().cameras.iter().any(is_alike)
    }
}

/// Prepares a scene that is like a prepared one.
fn prepared_again(
    before: Arc<PreparedScene>,
    scene: Scene,
    kind: Likeness,
    request: &Request,
) -> Result<Arc<PreparedScene>, Error> {
    let options = PrepareOptions { threads: threads(request), ..PrepareOptions::default() };
    let mut accel = before.shared_accel();
    drop(before);
    let is_kept = match kind {
        Likeness::AllButCameras | Likeness::Shapes => true,
        // If rays are still traced in the structure, another one is built.
        Likeness::MovedShapes => Arc::get_mut(&mut accel).is_some_and(|accel| {
            let SceneGeometry { meshes, instances, spheres } = SceneGeometry::of(&scene);
            accel.refit(&meshes, &instances, &spheres).is_ok()
        }),
        Likeness::Nothing => false,
    };
    if !is_kept {
        accel = Arc::new(build_accel(&scene, &options)?);
    }
    Ok(Arc::new(PreparedScene::with_accel(Arc::new(scene), accel, &options)))
}

/// Compares two scenes. Large meshes and images are the same if they are shared.
fn likeness(before: &Scene, after: &Scene) -> Likeness {
    let has_same_counts = before.meshes.len() == after.meshes.len()
        && before.spheres.len() == after.spheres.len()
        && before.instances.len() == after.instances.len()
        && before.instances.iter().zip(&after.instances).all(|(a, b)| a.mesh == b.mesh);
    if !has_same_counts {
        return Likeness::Nothing;
    }
    let mut meshes = before.meshes.shared().iter().zip(after.meshes.shared()).map(|(a, b)| mesh_likeness(a, b));
    let Some(has_moved_vertices) = meshes.try_fold(false, |any, likeness| match likeness {
        MeshLikeness::Same => Some(any),
        MeshLikeness::Moved => Some(true),
        MeshLikeness::Other => None,
    }) else {
        return Likeness::Nothing;
    };
    let mut instances = before.instances.iter().zip(&after.instances);
    let mut spheres = before.spheres.iter().zip(&after.spheres);
    let is_unmoved = !has_moved_vertices
        && (before.shutter == after.shutter || !before.has_motion())
        && instances.all(|(a, b)| a.world_from_object == b.world_from_object && a.motion == b.motion)
        && spheres.all(|(a, b)| (a.center, a.radius) == (b.center, b.radius) && a.motion == b.motion);
    if !is_unmoved {
        // The structure of moving shapes cannot be refitted.
        let moves = before.has_motion() || after.has_motion();
        return if moves { Likeness::Nothing } else { Likeness::MovedShapes };
    }
    let is_alike = before.instances == after.instances
        && before.spheres == after.spheres
        && before.materials == after.materials
        && before.media == after.media
        && is_shared(&before.images, &after.images)
        && before.mappings == after.mappings
        && before.lights == after.lights
        && before.environment == after.environment;
    if is_alike { Likeness::AllButCameras } else { Likeness::Shapes }
}

enum MeshLikeness {
    Same,
    /// The same triangles, some vertices of which have moved.
    Moved,
    Other,
}

fn mesh_likeness(before: &Arc<Mesh>, after: &Arc<Mesh>) -> MeshLikeness {
    if Arc::ptr_eq(before, after) {
        return MeshLikeness::Same;
    }
    let is_small = before.triangles.len() <= COMPARED_MAX && before.positions.len() <= 3 * COMPARED_MAX;
    if !is_small || before.triangles != after.triangles || before.positions.len() != after.positions.len() {
        MeshLikeness::Other
    } else if before == after {
        MeshLikeness::Same
    } else if before.positions != after.positions && (has_empty_triangle(before) || has_empty_triangle(after)) {
        // Triangles without area are not in the acceleration structure.
        MeshLikeness::Other
    } else {
        MeshLikeness::Moved
    }
}

fn has_empty_triangle(mesh: &Mesh) -> bool {
    mesh.triangles.iter().any(|corners| {
        let [a, b, c] = corners.map(|corner| mesh.positions[corner as usize]);
        let area = (b - a).cross(c - a).length_squared();
        area.is_nan() || area <= 0.0
    })
}

fn is_shared<T>(a: &SharedList<T>, b: &SharedList<T>) -> bool {
    a.len() == b.len() && a.shared().iter().zip(b.shared()).all(|(a, b)| Arc::ptr_eq(a, b))
}

#[cfg(test)]
mod tests {
    use bottega_scene::{Instance, Material};
    use glam::{Affine3A, Vec3};

    use super::*;

    /// A triangle with its corner at a height.
    fn scene(height: f32) -> Scene {
        let positions = vec![Vec3::ZERO, Vec3::X, Vec3::new(0.0, height, 0.0)];
        let mesh = Mesh { positions, triangles: vec![[0, 1, 2]], ..Mesh::default() };
        let materials = vec![Material::default()];
        let mut scene = Scene { materials, ..Scene::default() };
        scene.meshes.push(mesh);
        scene.instances.push(Instance::new(0, Affine3A::IDENTITY));
        scene
    }

    #[test]
    fn meshes_of_area_lights_are_made_again_without_another_structure() {
        assert_eq!(likeness(&scene(1.0), &scene(1.0)), Likeness::AllButCameras, "equal meshes, not shared");
        assert_eq!(likeness(&scene(1.0), &scene(2.0)), Likeness::MovedShapes);
        let brighter = Scene { materials: vec![Material::emitter(Vec3::ONE)], ..scene(1.0) };
        assert_eq!(likeness(&scene(1.0), &brighter), Likeness::Shapes);
    }

    #[test]
    fn a_triangle_that_gets_an_area_needs_another_structure() {
        assert_eq!(likeness(&scene(0.0), &scene(1.0)), Likeness::Nothing);
        assert_eq!(likeness(&scene(1.0), &scene(0.0)), Likeness::Nothing);
    }
}
