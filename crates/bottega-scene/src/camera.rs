//! Cameras: projection, lens, clip planes and position.

use glam::{Affine3A, Vec2, Vec3};
use serde::{Deserialize, Serialize};

use crate::lenses::LensSystem;
use crate::medium::MediumId;
use crate::motion::TransformKey;

/// The projection of a camera: the law that maps directions or positions in front of it to places on the picture.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Projection {
    /// A pinhole, or a thin lens if [`Camera::lens_radius`] is above 0.
    Perspective {
        /// Full angle between the upper and the lower edge of a picture of the camera's aspect, in radians.
        vertical_fov: f32,
    },
    /// A parallel projection along the camera's axis.
    Orthographic {
        /// Distance between the upper and the lower edge of a picture of the camera's aspect, in scene units.
        height: f32,
    },
    /// A circle around the axis, whose radius grows with the angle between direction and axis. The lens has no effect.
    Fisheye {
        /// The law by which the radius grows.
        mapping: FisheyeMapping,
        /// Angle between opposite directions on the rim, above 0 and at most 2π, in radians. Beyond the rim the picture
        /// is black and transparent.
        field_of_view: f32,
        /// Height of a picture of the camera's aspect, as a multiple of the circle's diameter; above 0.
        height: f32,
    },
    /// The whole sphere of directions, stretched over the picture. Lens, shift, aspects and [`Camera::fov_axis`] have
    /// no effect.
    Panorama(Panorama),
}

/// The law of a fisheye: the distance of a direction from the centre of the fisheye's circle, for an angle θ between
/// direction and axis.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum FisheyeMapping {
    /// In proportion to θ.
    Equidistant,
    /// In proportion to sin(θ ∕ 2): equal areas of the picture cover equal solid angles. With a field of view of 2π it
    /// is the picture in a mirror ball, seen from far away.
    Equisolid,
}

/// The layout of directions on a panoramic picture, in camera space.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Panorama {
    /// Longitude along the rows, with −z at the centre and +x to the right of it; latitude down the columns, from +y.
    Equirectangular,
    /// Equal areas of the picture cover equal solid angles (Clarberg 2008): +y is the centre, the lower hemisphere is
    /// folded into the corners, +x points right and −z down.
    EqualArea,
    /// Six square pictures side by side, as seen by cameras of 90° towards +x, −x, +y, −y, +z and −z. Their upper edges
    /// lie towards +y; that of +y lies towards +z, that of −y towards −z.
    Cube,
}

/// The maximum of [`Aperture::blades`].
pub const BLADES_MAX: u32 = 1000;

/// The shape of a lens's opening, which highlights out of focus take on. It lies within the circle of the lens's
/// radius, before it is stretched.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Aperture {
    /// Number of corners of a regular polygon, 3 or more; 0: a circle.
    pub blades: u32,
    /// Rotation of the polygon, counterclockwise as seen by the camera, in radians.
    pub rotation: f32,
    /// Height over width, above 0: above 1 for the narrow highlights of anamorphic lenses.
    pub ratio: f32,
}

impl Default for Aperture {
    /// Returns a circle.
    fn default() -> Self {
        Self { blades: 0, rotation: 0.0, ratio: 1.0 }
    }
}

/// The eyes of a stereo picture. The camera is between them.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Stereo {
    /// The places of the two pictures, or the eye whose picture it is.
    pub layout: StereoLayout,
    /// Distance between the eyes, in scene units, 0 or more. In panoramas it falls to 0 towards the poles.
    pub eye_distance: f32,
    /// Distance at which the two pictures agree, in scene units, above 0: of a plane, or the radius of a sphere for
    /// panoramas. Infinite: the eyes look in parallel.
    #[serde(with = "crate::numbers::maybe_infinite")]
    pub convergence: f32,
}

/// The places of both eyes' pictures within a stereo picture, or the single eye that it shows.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum StereoLayout {
    /// The left eye's picture is the left half.
    SideBySide,
    /// The left eye's picture is the upper half.
    TopBottom,
    /// The picture is the left eye's.
    Left,
    /// The picture is the right eye's.
    Right,
}

/// The extent of the picture that a camera's field of view measures. It stays the same in a picture of another aspect.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum FovAxis {
    /// From the left to the right edge.
    X,
    /// From the lower to the upper edge.
    #[default]
    Y,
    /// From corner to corner.
    Diagonal,
    /// The shorter of width and height.
    Smaller,
    /// The longer of width and height.
    Larger,
}

impl FovAxis {
    /// Returns this extent divided by the picture's height.
    ///
    /// - `aspect`: width over height of the visible area.
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

/// A camera: position, projection, lens and film. It looks along its own −z; +y is up and +x to the right.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Camera {
    /// The name in the file; may be empty.
    pub name: String,
    /// Camera space to world space, without scale; may mirror.
    #[serde(with = "crate::numbers")]
    pub world_from_camera: Affine3A,
    /// The projection and its field of view.
    pub projection: Projection,
    /// Width over height of the picture in pixels, as given by the file; `None`: follow the picture.
    pub aspect: Option<f32>,
    /// Width over height of one pixel; 1: square.
    pub pixel_aspect: f32,
    /// The extent that stays the same in a picture of another aspect than [`Self::aspect`].
    pub fov_axis: FovAxis,
    /// Radius of the thin lens in scene units; 0: pinhole, everything is sharp.
    pub lens_radius: f32,
    /// Distance of the plane in focus, in scene units, above 0.
    pub focus_distance: f32,
    /// Offset of the optical axis from the centre of the picture: right and up, in halves of its width and height.
    #[serde(with = "crate::numbers")]
    pub lens_shift: Vec2,
    /// The medium around the camera; `None`: vacuum.
    pub medium: Option<MediumId>,
    /// The clip planes.
    pub clip: Clip,
    /// The shape of the lens's opening.
    #[serde(default)]
    pub aperture: Aperture,
    /// The lenses that replace field of view and thin lens of a perspective camera; `None`: it has a thin lens.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub lenses: Option<LensSystem>,
    /// The eyes of a stereo picture; `None`: one eye.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub stereo: Option<Stereo>,
    /// Share of the shutter's time for which each row is exposed, from 0 to 1; the rows are exposed one after another, from
    /// the upper edge down. `None`: all rows at the same time.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub rolling_shutter: Option<f32>,
    /// `true`: the camera does not see emitters. Emissive surfaces let camera rays pass and the environment is black,
    /// but both still light the scene (Mitsuba's `hide_emitters`).
    pub hides_emitters: bool,
    /// Keys of [`Self::world_from_camera`], if the camera moves; empty: it stands still.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub motion: Vec<TransformKey>,
}

/// The near and far clip planes of a camera; distances along its axis, in scene units. A camera ray starts at the near
/// plane, and if it hits nothing before the far plane it sees the environment. Other rays ignore them. They have no
/// effect with fisheyes, panoramas and [`Camera::lenses`].
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Clip {
    /// Distance of the near plane, 0 or more.
    pub near: f32,
    /// Distance of the far plane, above [`Self::near`]; may be infinite.
    #[serde(with = "crate::numbers::maybe_infinite")]
    pub far: f32,
}

/// The distances of invalid clip planes.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
#[error("there is nothing between clip planes in the distances {near} and {far}")]
pub(crate) struct ClipError {
    near: f64,
    far: f64,
}

impl Clip {
    /// No clipping: everything in front of the camera is visible.
    pub const NONE: Self = Self { near: 0.0, far: f32::INFINITY };

    /// Returns planes at these distances.
    pub(crate) fn new(near: f64, far: f64) -> Result<Self, ClipError> {
        let clip = Self { near: near as f32, far: far as f32 };
        if clip.near >= 0.0 && clip.near.is_finite() && clip.far > clip.near {
            Ok(clip)
        } else {
            Err(ClipError { near, far })
        }
    }
}

impl Camera {
    /// Returns the camera-to-world transformation of a camera at `eye` that looks at `target`, with its upper edge
    /// towards `up`. `None` if `eye` is `target` or the view is parallel to `up`.
    pub fn looking(eye: Vec3, target: Vec3, up: Vec3) -> Option<Affine3A> {
        let back = (eye - target).try_normalize()?;
        let right = up.cross(back).try_normalize()?;
        Some(Affine3A::from_cols(right.into(), back.cross(right).into(), back.into(), eye.into()))
    }
}

impl Default for Camera {
    /// Returns a pinhole at the origin that looks along −z, with a vertical field of view of 0.7 radians.
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
            aperture: Aperture::default(),
            lenses: None,
            stereo: None,
            rolling_shutter: None,
            hides_emitters: false,
            motion: Vec::new(),
        }
    }
}
