//! Cameras.

use glam::{Affine3A, Vec2, Vec3};

use crate::MediumId;

/// The projection of a camera.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Projection {
    /// A pinhole, or a thin lens where [`Camera::lens_radius`] is above 0.
    Perspective {
        /// Full angle between the upper and the lower edge of a picture of the camera's aspect, in radians.
        vertical_fov: f32,
    },
    /// Parallel projection.
    Orthographic {
        /// Distance between the upper and the lower edge of a picture of the camera's aspect, in scene units.
        height: f32,
    },
    /// All around: the picture is the whole sphere of directions, whatever its shape. Lens, shift, aspects and
    /// [`Camera::fov_axis`] do not matter.
    Panorama(Panorama),
}

/// How directions lie on the picture of a camera that sees all around. Its centre and its edges are as in pbrt: seen from
/// within, the right is on the left edge of the picture, what is ahead a quarter of its width from there.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Panorama {
    /// Longitude along the rows, from +x over −z; latitude down the columns, from +y.
    Equirectangular,
    /// Equal areas of the picture see equal solid angles (Clarberg 2008): +y is the centre, the lower hemisphere folded
    /// into the corners, +x to the right and −z down.
    EqualArea,
}

/// Which extent of the picture a camera's projection is about: it stays as it is in a picture of another shape.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum FovAxis {
    /// From the left to the right edge.
    X,
    /// From the lower to the upper edge.
    #[default]
    Y,
    /// From corner to corner.
    Diagonal,
    /// The shorter of both.
    Smaller,
    /// The longer of both.
    Larger,
}

impl FovAxis {
    /// This extent over the picture's height.
    ///
    /// - `aspect`: width over height of what the picture shows.
    pub fn over_height(self, aspect: f32) -> f32 {
        match self {
            Self::X => aspect,
            Self::Y => 1.0,
            Self::Diagonal => (1.0 + aspect * aspect).sqrt(),
            Self::Smaller => aspect.min(1.0),
            Self::Larger => aspect.max(1.0),
        }
    }
}

/// A camera. It looks along its own −z, +y is up and +x to the right.
#[derive(Clone, Debug, PartialEq)]
pub struct Camera {
    /// The name in the file; may be empty.
    pub name: String,
    /// Where it stands: camera space to world space, without scale; it may mirror.
    pub world_from_camera: Affine3A,
    /// How it projects.
    pub projection: Projection,
    /// Width over height of the picture, in pixels, as the file wants it; `None`: as the picture has it.
    pub aspect: Option<f32>,
    /// Width over height of what a pixel shows. 1: it is square.
    pub pixel_aspect: f32,
    /// Which extent stays as it is in a picture of another shape than [`Self::aspect`].
    pub fov_axis: FovAxis,
    /// Radius of the thin lens in scene units; 0: everything is sharp.
    pub lens_radius: f32,
    /// Distance of the plane in focus, in scene units.
    pub focus_distance: f32,
    /// Where the axis meets the picture: to the right and up from its centre, in halves of its width and height.
    pub lens_shift: Vec2,
    /// What it stands in; `None`: vacuum.
    pub medium: Option<MediumId>,
    /// Which part of its rays shows the scene.
    pub clip: Clip,
    /// Whether it does not see what shines: surfaces that emit are as if they were not there, and the environment is black,
    /// though their light comes to all else (Mitsuba's `hide_emitters`).
    pub hides_emitters: bool,
}

/// Planes across a camera's line of sight, between which surfaces are seen; distances along that line, in scene units. A ray
/// begins in the near plane, and what it does not meet before the far one is what lies behind everything: the environment.
/// Light takes no notice of them. Cameras that see all around have none.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Clip {
    /// Of the near plane, 0 or more.
    pub near: f32,
    /// Of the far plane, above [`Self::near`]; may be infinite.
    pub far: f32,
}

impl Clip {
    /// All that lies before the camera is seen.
    pub const NONE: Self = Self { near: 0.0, far: f32::INFINITY };

    /// Planes in these distances, or what is wrong with them.
    pub(crate) fn new(near: f64, far: f64) -> Result<Self, String> {
        let clip = Self { near: near as f32, far: far as f32 };
        if clip.near >= 0.0 && clip.near.is_finite() && clip.far > clip.near {
            Ok(clip)
        } else {
            Err(format!("there is nothing between clip planes in the distances {near} and {far}"))
        }
    }
}

impl Camera {
    /// Where a camera stands that looks from `eye` at `target`: camera space to world space, its upper edge towards `up`.
    /// `None`: there is no direction, or it is that of `up`.
    pub fn looking(eye: Vec3, target: Vec3, up: Vec3) -> Option<Affine3A> {
        let back = (eye - target).try_normalize()?;
        let right = up.cross(back).try_normalize()?;
        Some(Affine3A::from_cols(right.into(), back.cross(right).into(), back.into(), eye.into()))
    }
}

impl Default for Camera {
    /// A pinhole at the origin.
    fn default() -> Self {
        Self {
            name: String::new(),
            world_from_camera: Affine3A::IDENTITY,
            projection: Projection::Perspective { vertical_fov: 0.7 },
            aspect: None,
            pixel_aspect: 1.0,
            fov_axis: FovAxis::Y,
            lens_radius: 0.0,
            focus_distance: 1.0,
            lens_shift: Vec2::ZERO,
            medium: None,
            clip: Clip::NONE,
            hides_emitters: false,
        }
    }
}
