//! Camera rays: perspective and orthographic cameras with a thin lens or a system of lenses, fisheyes, panoramas.

mod eyes;
mod opening;
mod panorama;
mod place;

use bottega_kernels::{MovingTransform, math};
use bottega_scene::{Aperture, Camera, Clip, LensSystem, Panorama, Projection};
use glam::{Affine3A, Vec2, Vec3};
use std::{f32::consts::PI, sync::Arc};

use self::{
    eyes::Eyes,
    opening::LensOpening,
    panorama::{Fisheye, direction_of_panorama},
};

/// The width of a path's beam, which limits the detail that it can resolve; after Akenine-Möller et al. 2021, *Improved
/// Shader and Texture Level of Detail Using Ray Cones*.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct RayCone {
    /// Width at the ray's origin, in scene units.
    pub width: f32,
    /// Growth of the width per unit of distance.
    pub spread: f32,
}

impl RayCone {
    /// Returns the cone at a distance along its ray, in scene units.
    #[must_use]
    #[inline(always)]
    pub fn at(self, distance: f32) -> Self {
        Self { width: self.width + self.spread * distance, spread: self.spread }
    }
}

/// Width of a camera ray's beam in pixels. The film's filter averages over the pixel by many samples; textures filtered
/// by a full pixel are blurred twice, and lose detail at grazing angles.
pub(crate) const BEAM: f32 = 0.125;

/// A ray from the camera, with the part of the scene that it can see.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CameraRay {
    /// Origin in world space.
    pub origin: Vec3,
    /// Direction, unit length, world space.
    pub direction: Vec3,
    /// Cone of the pixel's share that the ray represents.
    pub cone: RayCone,
    /// Distance of the origin from the camera's position: to the near plane.
    pub start: f32,
    /// Distance from the origin up to which surfaces are visible: to the far plane.
    pub reach: f32,
    /// Factor of the light along the ray; 0: lenses block it, or the place lies beyond the rim of a fisheye.
    pub weight: f32,
}

/// A generator of camera rays for one camera and one picture size.
#[derive(Clone, Debug)]
pub struct CameraRays {
    /// Transformation from camera to world space.
    pub(crate) world_from_camera: Affine3A,
    /// Half the picture's width and height: at distance 1 for a perspective, in scene units for a parallel projection.
    pub(crate) half_extent: Vec2,
    /// Position of the axis in the picture, in halves of its width and height.
    pub(crate) lens_shift: Vec2,
    /// Two over the picture's size in pixels.
    pub(crate) double_pixel: Vec2,
    pub(crate) kind: ProjectionKind,
    /// The lenses of [`ProjectionKind::Lenses`].
    pub(crate) lenses: Option<LensSystem>,
    /// The eyes of a stereo picture.
    pub(crate) eyes: Option<Eyes>,
    /// The opening of the thin lens; a point: a pinhole.
    pub(crate) lens: LensOpening,
    /// Distance of the plane in focus, in scene units.
    pub(crate) focus_distance: f32,
    /// Ray cone at the camera.
    pub(crate) cone: RayCone,
    /// Distances of the near and the far plane.
    pub(crate) clip: Clip,
    /// The path of the camera while the shutter is open; `None`: it stands still.
    pub(crate) motion: Option<Arc<MovingTransform>>,
}

/// The kind of projection.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum ProjectionKind {
    /// Rays from a point.
    Perspective,
    /// Parallel rays.
    Parallel,
    /// Rays through a system of lenses.
    Lenses,
    /// Rays from a point, in a circle.
    Fisheye(Fisheye),
    /// Rays in all directions from a point.
    Panorama(Panorama),
}

impl CameraRays {
    /// Creates the generator of a camera that stands still. The extent along the camera's
    /// [`FovAxis`](bottega_scene::FovAxis) is kept for any shape of the picture.
    ///
    /// - `width`, `height`: size of the whole picture in pixels; 0 counts as 1.
    pub fn new(camera: &Camera, width: u32, height: u32) -> Self {
        let whole = Vec2::new(width.max(1) as f32, height.max(1) as f32);
        let (eyes, size) = camera.stereo.map_or((None, whole), |stereo| {
            let (eyes, size) = Eyes::new(stereo, whole);
            (Some(eyes), size)
        });
        let (mut half_height, kind) = match camera.projection {
            Projection::Perspective { vertical_fov } => {
                let kind = if camera.lenses.is_some() { ProjectionKind::Lenses } else { ProjectionKind::Perspective };
                (math::tan(0.5 * vertical_fov), kind)
            }
            Projection::Orthographic { height } => (0.5 * height, ProjectionKind::Parallel),
            Projection::Fisheye { mapping, field_of_view, height } => {
                (height, ProjectionKind::Fisheye(Fisheye::new(mapping, field_of_view)))
            }
            Projection::Panorama(panorama) => (0.0, ProjectionKind::Panorama(panorama)),
        };
        // Width over height of the visible extent; differs from the picture's for pixels that are not square
        let shown = size.x / size.y * camera.pixel_aspect;
        if let Some(aspect) = camera.aspect {
            let wanted = aspect * camera.pixel_aspect;
            half_height *= camera.fov_axis.over_height(wanted) / camera.fov_axis.over_height(shown);
        }
        let pixel = 2.0 * half_height / size.y;
        let beam = pixel * BEAM;
        let cone = match kind {
            ProjectionKind::Perspective | ProjectionKind::Lenses => RayCone { width: 0.0, spread: beam },
            ProjectionKind::Parallel => RayCone { width: beam, spread: 0.0 },
            ProjectionKind::Fisheye(fisheye) => RayCone { width: 0.0, spread: beam * fisheye.rim() },
            // Square root of the mean solid angle of a pixel
            ProjectionKind::Panorama(_) => RayCone { width: 0.0, spread: (4.0 * PI / (size.x * size.y)).sqrt() * BEAM },
        };
        let half_extent = match &camera.lenses {
            // The film has the shape of the picture
            Some(lenses) if kind == ProjectionKind::Lenses => {
                Vec2::new(shown, 1.0).normalize() * (0.5 * lenses.description().film_diagonal)
            }
            _ => Vec2::new(half_height * shown, half_height),
        };
        let is_flat = matches!(kind, ProjectionKind::Perspective | ProjectionKind::Parallel);
        let lens_radius = if is_flat { camera.lens_radius } else { 0.0 };
        Self {
            world_from_camera: camera.world_from_camera,
            half_extent,
            lens_shift: camera.lens_shift,
            double_pixel: 2.0 / size,
            kind,
            lenses: camera.lenses.clone(),
            eyes,
            lens: LensOpening::new(lens_radius, camera.aperture),
            focus_distance: camera.focus_distance,
            cone,
            clip: if is_flat { camera.clip } else { Clip::NONE },
            motion: None,
        }
    }

    /// Returns these rays for a camera that moves.
    pub(crate) fn moving(self, motion: Option<MovingTransform>) -> Self {
        Self { motion: motion.map(Arc::new), ..self }
    }

    /// Returns the ray through a position of the picture.
    ///
    /// - `place`: position in pixels from the upper left corner; the centre of pixel (x, y) is (x + ½, y + ½).
    /// - `lens`: uniform random numbers in [0, 1) for the position on the lens, if it has a radius.
    #[inline(always)]
    pub fn ray(&self, place: Vec2, lens: [f32; 2]) -> CameraRay {
        self.ray_of_pixel(place, Vec2::ZERO, lens)
    }

    /// Returns the ray through a position near the centre of a pixel. The centre decides on the eye of a stereo picture
    /// and on the face of a cube.
    ///
    /// - `center`: position of the centre, in pixels; see [`Self::ray`].
    /// - `offset`: distance from there along x and y, in pixels.
    /// - `lens`: uniform random numbers in [0, 1), as for [`Self::ray`].
    #[inline(always)]
    pub fn ray_of_pixel(&self, center: Vec2, offset: Vec2, lens: [f32; 2]) -> CameraRay {
        self.ray_from(&self.world_from_camera, center, offset, lens)
    }

    /// Returns the ray through a position near the centre of a pixel at a time of the shutter, from 0 to 1; see
    /// [`Self::ray_of_pixel`].
    pub(crate) fn ray_at(&self, center: Vec2, offset: Vec2, lens: [f32; 2], time: f32) -> CameraRay {
        match &self.motion {
            None => self.ray_of_pixel(center, offset, lens),
            Some(motion) => self.ray_from(&motion.at(time), center, offset, lens),
        }
    }

    #[inline(always)]
    fn ray_from(&self, world_from_camera: &Affine3A, center: Vec2, offset: Vec2, lens: [f32; 2]) -> CameraRay {
        let (eye, center) = match &self.eyes {
            None => (0.0, center),
            Some(eyes) => eyes.of_pixel(center),
        };
        let place = center + offset;
        let shifted = place * self.double_pixel - 1.0;
        let film = (Vec2::new(shifted.x, -shifted.y) - self.lens_shift) * self.half_extent;
        // Map the film position to a ray in camera space
        let mut weight = 1.0;
        let (mut origin, mut direction) = match self.kind {
            ProjectionKind::Perspective => (Vec3::ZERO, film.extend(-1.0)),
            ProjectionKind::Parallel => (film.extend(0.0), Vec3::NEG_Z),
            ProjectionKind::Lenses | ProjectionKind::Fisheye(_) => {
                let Some((origin, direction, factor)) = self.bent(film, lens) else {
                    return self.blocked(world_from_camera);
                };
                weight = factor;
                (origin, direction)
            }
            ProjectionKind::Panorama(panorama) => {
                let half_pixel = 0.5 * self.double_pixel;
                (Vec3::ZERO, direction_of_panorama(panorama, center * half_pixel, place * half_pixel))
            }
        };
        if let Some(eyes) = &self.eyes {
            match self.kind {
                ProjectionKind::Perspective | ProjectionKind::Parallel => {
                    eyes.beside_axis(eye, &mut origin, &mut direction);
                }
                ProjectionKind::Fisheye(_) => (origin, direction) = eyes.on_sphere(eye, false, direction),
                ProjectionKind::Panorama(_) => (origin, direction) = eyes.on_sphere(eye, true, direction),
                // A whole camera per eye
                ProjectionKind::Lenses => origin.x += eye,
            }
        }
        if !self.lens.is_point() {
            // All rays of one position meet in the plane of focus
            let focus = origin + direction * self.focus_distance;
            origin += self.lens.sample(lens).extend(0.0);
            direction = focus - origin;
        }
        let (mut start, mut reach) = (0.0, f32::INFINITY);
        if self.clip != Clip::NONE {
            // The optical axis is −z; oblique rays reach a plane at a larger distance
            let slant = direction.length() / -direction.z;
            (start, reach) = (self.clip.near * slant, (self.clip.far - self.clip.near) * slant);
            origin += direction * (self.clip.near / -direction.z);
        }
        CameraRay {
            origin: world_from_camera.transform_point3(origin),
            direction: world_from_camera.transform_vector3(direction).normalize(),
            cone: self.cone,
            start,
            reach,
            weight,
        }
    }

    /// Returns origin, direction and factor of a ray through lenses or a fisheye, in camera space. `None`: there is none.
    fn bent(&self, film: Vec2, lens: [f32; 2]) -> Option<(Vec3, Vec3, f32)> {
        if let ProjectionKind::Fisheye(fisheye) = &self.kind {
            return fisheye.direction(film).map(|direction| (Vec3::ZERO, direction, 1.0));
        }
        // Lenses turn the picture upside down
        let ray = self.lenses.as_ref()?.ray(-film, lens)?;
        Some((ray.origin, ray.direction, ray.weight))
    }

    /// Returns a ray that meets nothing and counts for nothing.
    #[cold]
    fn blocked(&self, world_from_camera: &Affine3A) -> CameraRay {
        CameraRay {
            origin: world_from_camera.translation.into(),
            direction: world_from_camera.transform_vector3(Vec3::NEG_Z).normalize(),
            cone: self.cone,
            start: 0.0,
            reach: 0.0,
            weight: 0.0,
        }
    }
}

/// Returns true if devices can generate the rays of a camera: perspective, orthographic or a panorama other than a
/// cube, with a round lens at most; not a system of lenses, a fisheye or a stereo camera.
pub fn is_camera_for_devices(camera: &Camera) -> bool {
    let is_known = match camera.projection {
        Projection::Perspective { .. } | Projection::Orthographic { .. } => true,
        Projection::Panorama(panorama) => panorama != Panorama::Cube,
        Projection::Fisheye { .. } => false,
    };
    let has_round_lens = camera.lens_radius == 0.0 || camera.aperture == Aperture::default();
    is_known && has_round_lens && camera.lenses.is_none() && camera.stereo.is_none()
}

#[cfg(test)]
mod tests;
