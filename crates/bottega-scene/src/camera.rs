//! Cameras.

use glam::Affine3A;

/// How a camera projects the scene onto its picture.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Projection {
    /// A pinhole, or a thin lens where [`Camera::lens_radius`] is above 0.
    Perspective {
        /// Full angle between the upper and the lower edge of the picture, in radians.
        vertical_fov: f32,
    },
    /// Parallel projection.
    Orthographic {
        /// Distance between the upper and the lower edge of the picture, in scene units.
        height: f32,
    },
}

/// A camera. It looks along its own −z, +y is up and +x to the right.
#[derive(Clone, Debug, PartialEq)]
pub struct Camera {
    /// The name in the file; may be empty.
    pub name: String,
    /// Where it stands: camera space to world space, without scale.
    pub world_from_camera: Affine3A,
    /// How it projects.
    pub projection: Projection,
    /// Width over height as the file wants it; `None`: as the picture has it.
    pub aspect: Option<f32>,
    /// Radius of the thin lens in scene units; 0: everything is sharp.
    pub lens_radius: f32,
    /// Distance of the plane in focus, in scene units.
    pub focus_distance: f32,
}
