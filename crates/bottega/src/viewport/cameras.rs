//! The cameras of a scene as poses for a viewport.

use bottega_scene::{Camera, Projection};
use glam::{DVec3, Vec3};
use schemars::JsonSchema;
use serde::Serialize;

use crate::{loaded_scene::LoadedScene, request::CameraPose};

/// A camera of the scene in a viewport.
#[derive(Clone, Debug, PartialEq, Serialize, JsonSchema)]
pub struct ViewportCamera {
    /// Name of the camera in the file; may be empty.
    pub name: String,
    /// The pose of the camera; the target lies ahead, at the distance of the scene's center.
    pub pose: CameraPose,
}

/// Returns the cameras of a scene, each with a target.
pub(super) fn cameras(subject: &LoadedScene) -> Vec<ViewportCamera> {
    let scene = subject.scene();
    let (low, high) = scene.bounds();
    let (center, radius) = (0.5 * (low + high), 0.5 * (high - low).length());
    let known = |camera: &Camera| ViewportCamera {
        name: camera.name.clone(),
        pose: pose_of(camera, scene.origin, (center, radius)),
    };
    subject.cameras().iter().map(known).collect()
}

fn pose_of(camera: &Camera, origin: DVec3, (center, radius): (Vec3, f32)) -> CameraPose {
    let eye = Vec3::from(camera.world_from_camera.translation);
    let ahead = Vec3::from(-camera.world_from_camera.matrix3.z_axis).normalize_or(Vec3::NEG_Z);
    // Put the target at the distance of the scene's center, if that lies ahead, so that orbits turn about it.
    let middle = (center - eye).dot(ahead);
    let distance = if middle.is_finite() { middle.max(0.1 * radius) } else { 1.0 }.max(f32::MIN_POSITIVE);
    let in_file = |place: Vec3| (place.as_dvec3() + origin).to_array();
    CameraPose {
        eye: in_file(eye),
        target: in_file(eye + distance * ahead),
        up: Vec3::from(camera.world_from_camera.matrix3.y_axis).as_dvec3().to_array(),
        fov: match camera.projection {
            Projection::Perspective { vertical_fov } if camera.lenses.is_none() => Some(vertical_fov.to_degrees()),
            _ => None,
        },
    }
}
