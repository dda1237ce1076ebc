//! Another state of a scene in memory, for which only what has changed is prepared again.

use std::{sync::Arc, time::Instant};

use bottega_render::{PrepareOptions, PreparedScene, SceneGeometry, View, build_accel};
use bottega_scene::{Camera, Loaded, Scene, SharedList};

use super::{LoadedScene, aimed, no_camera, size, turn_environment};
use crate::{devices::threads, error::Error, request::Request};

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
    /// - `scene`: a sound state of the scene, such as [`bottega_scene::SceneEditor::snapshot`] returns.
    ///
    /// # Errors
    /// The scene has no camera or not the requested one, or cannot be prepared.
    pub fn edited(self, scene: impl Into<Loaded>, request: &Request) -> Result<Self, Error> {
        let Loaded { mut scene, warnings, hints, files, .. } = scene.into();
        if scene.cameras.is_empty() {
            return Err(no_camera());
        }
        turn_environment(&mut scene, request);
        let cameras = scene.cameras.clone();
        let (camera, aimed) = aimed(&cameras, scene.origin, &request.view)?;
        let [width, height] = size(request, &hints, &aimed)?;
        scene.cameras[camera] = aimed;
        let mut hints = hints;
        hints.crop = hints.crop.filter(|_| request.film.size.is_none());
        let kind = likeness(self.scene(), &scene);
        let (prepared, camera_number) = if kind == Likeness::AllButCameras && self.has_alike(&scene.cameras[camera]) {
            let number = self.prepared.add_camera(scene.cameras[camera].clone());
            // Remove the old camera, so that a long interactive session does not collect them.
            self.prepared.remove_camera(self.view.camera);
            (self.prepared, number)
        } else {
            (prepared_again(self.prepared, scene, kind, request)?, camera)
        };
        let view = View { camera: camera_number, width, height };
        let loaded = Instant::now();
        Ok(Self { prepared, prepass: Arc::default(), view, camera, cameras, warnings, hints, files, loaded })
    }

    /// Returns true if the scene was prepared for a camera in the same medium that sees the same things.
    fn has_alike(&self, camera: &Camera) -> bool {
        let is_alike = |it: &Camera| it.medium == camera.medium && it.hides_emitters == camera.hides_emitters;
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

/// Compares two scenes. Meshes and images are the same if they are shared.
fn likeness(before: &Scene, after: &Scene) -> Likeness {
    // Structures of moving shapes are not refitted
    let has_same_shapes = !before.has_motion()
        && !after.has_motion()
        && is_shared(&before.meshes, &after.meshes)
        && before.spheres.len() == after.spheres.len()
        && before.instances.len() == after.instances.len()
        && before.instances.iter().zip(&after.instances).all(|(a, b)| a.mesh == b.mesh);
    if !has_same_shapes {
        return Likeness::Nothing;
    }
    let mut instances = before.instances.iter().zip(&after.instances);
    let mut spheres = before.spheres.iter().zip(&after.spheres);
    let is_unmoved = instances.all(|(a, b)| a.world_from_object == b.world_from_object)
        && spheres.all(|(a, b)| (a.center, a.radius) == (b.center, b.radius));
    if !is_unmoved {
        return Likeness::MovedShapes;
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

fn is_shared<T>(a: &SharedList<T>, b: &SharedList<T>) -> bool {
    a.len() == b.len() && a.shared().iter().zip(b.shared()).all(|(a, b)| Arc::ptr_eq(a, b))
}
