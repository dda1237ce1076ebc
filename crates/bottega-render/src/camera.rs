//! Camera rays: perspective and orthographic cameras with thin lens, panoramas.

use bottega_kernels::{MovingTransform, math};
use bottega_scene::{Camera, Clip, Panorama, Projection};
use glam::{Affine3A, Vec2, Vec3};
use std::{f32::consts::PI, sync::Arc};

use crate::{lights::direction_of_square, sampling::uniform_disk};

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
    /// Returns the cone at a distance along its ray.
    #[must_use]
    #[inline(always)]
    pub fn at(self, distance: f32) -> Self {
        Self { width: self.width + self.spread * distance, spread: self.spread }
    }
}

/// Width of a camera ray's beam in pixels. The film's filter averages over the pixel by many samples; textures filtered
/// by a full pixel are blurred twice, and lose detail at grazing angles.
pub(crate) const BEAM: f32 = 0.125;

/// A ray from the camera.
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
    /// Radius of the lens, in scene units; 0: a pinhole.
    pub(crate) lens_radius: f32,
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
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum ProjectionKind {
    /// Rays from a point.
    Perspective,
    /// Parallel rays.
    Parallel,
    /// Rays in all directions from a point.
    Panorama(Panorama),
}

impl CameraRays {
    /// Creates the generator. The extent along the camera's [`FovAxis`](bottega_scene::FovAxis) is kept for any shape of
    /// the picture.
    pub fn new(camera: &Camera, width: u32, height: u32) -> Self {
        let size = Vec2::new(width.max(1) as f32, height.max(1) as f32);
        let (mut half_height, kind) = match camera.projection {
            Projection::Perspective { vertical_fov } => (math::tan(0.5 * vertical_fov), ProjectionKind::Perspective),
            Projection::Orthographic { height } => (0.5 * height, ProjectionKind::Parallel),
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
            ProjectionKind::Perspective => RayCone { width: 0.0, spread: beam },
            ProjectionKind::Parallel => RayCone { width: beam, spread: 0.0 },
            // Square root of the mean solid angle of a pixel
            ProjectionKind::Panorama(_) => RayCone { width: 0.0, spread: (4.0 * PI / (size.x * size.y)).sqrt() * BEAM },
        };
        Self {
            world_from_camera: camera.world_from_camera,
            half_extent: Vec2::new(half_height * shown, half_height),
            lens_shift: camera.lens_shift,
            double_pixel: 2.0 / size,
            kind,
            lens_radius: if matches!(kind, ProjectionKind::Panorama(_)) { 0.0 } else { camera.lens_radius },
            focus_distance: camera.focus_distance,
            cone,
            clip: if matches!(kind, ProjectionKind::Panorama(_)) { Clip::NONE } else { camera.clip },
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
    /// - `lens`: random numbers for the position on the lens, if it has a radius.
    #[inline(always)]
    pub fn ray(&self, place: Vec2, lens: [f32; 2]) -> CameraRay {
        self.ray_from(&self.world_from_camera, place, lens)
    }

    /// Returns the ray through a position of the picture at a time of the shutter, from 0 to 1; see [`Self::ray`].
    pub(crate) fn ray_at(&self, place: Vec2, lens: [f32; 2], time: f32) -> CameraRay {
        match &self.motion {
            None => self.ray(place, lens),
            Some(motion) => self.ray_from(&motion.at(time), place, lens),
        }
    }

    #[inline(always)]
    fn ray_from(&self, world_from_camera: &Affine3A, place: Vec2, lens: [f32; 2]) -> CameraRay {
        let offset = place * self.double_pixel - 1.0;
        let film = (Vec2::new(offset.x, -offset.y) - self.lens_shift) * self.half_extent;
        // Map the film position to a ray in camera space
        let (mut origin, mut direction) = match self.kind {
            ProjectionKind::Perspective => (Vec3::ZERO, film.extend(-1.0)),
            ProjectionKind::Parallel => (film.extend(0.0), Vec3::NEG_Z),
            ProjectionKind::Panorama(panorama) => (Vec3::ZERO, around(panorama, 0.5 * place * self.double_pixel)),
        };
        if self.lens_radius > 0.0 {
            // All rays of one position meet in the plane of focus
            let focus = origin + direction * self.focus_distance;
            let shift = self.lens_radius * uniform_disk(lens);
            origin += shift.extend(0.0);
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
        }
    }
}

/// Returns the direction at a position of a panorama, both coordinates from 0 to 1. Filters may ask beyond the edges,
/// where the sphere continues.
fn around(panorama: Panorama, place: Vec2) -> Vec3 {
    match panorama {
        Panorama::Equirectangular => {
            let ((sin_theta, cos_theta), (sin_phi, cos_phi)) =
                (math::sin_cos(PI * place.y), math::sin_cos(2.0 * PI * place.x));
            Vec3::new(sin_theta * cos_phi, cos_theta, -sin_theta * sin_phi)
        }
        Panorama::EqualArea => {
            let mut place = place;
            // Beyond an edge, the picture is mirrored along it
            for (axis, other) in [(0, 1), (1, 0)] {
                if !(0.0..=1.0).contains(&place[axis]) {
                    let edge = if place[axis] < 0.0 { 0.0 } else { 2.0 };
                    place[axis] = edge - place[axis];
                    place[other] = 1.0 - place[other];
                }
            }
            let square = direction_of_square(place);
            Vec3::new(square.x, square.z, -square.y)
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn camera(projection: Projection, lens_radius: f32) -> Camera {
        Camera {
            world_from_camera: Affine3A::from_translation(Vec3::new(1.0, 2.0, 3.0)),
            projection,
            lens_radius,
            focus_distance: 4.0,
            ..Camera::default()
        }
    }

    #[test]
    fn the_edges_of_a_perspective_picture_are_half_the_angle_away() {
        let fov = 1.0_f32;
        let rays = CameraRays::new(&camera(Projection::Perspective { vertical_fov: fov }, 0.0), 40, 20);
        let middle = rays.ray(Vec2::new(20.0, 10.0), [0.0; 2]);
        assert!((middle.direction - Vec3::NEG_Z).length() < 1e-6);
        assert_eq!(middle.origin, Vec3::new(1.0, 2.0, 3.0));
        let upper = rays.ray(Vec2::new(20.0, 0.0), [0.0; 2]).direction;
        assert!((upper - Vec3::new(0.0, 0.5_f32.sin(), -0.5_f32.cos())).length() < 1e-6);
        let right = rays.ray(Vec2::new(40.0, 10.0), [0.0; 2]).direction;
        assert!((right.x / -right.z - 2.0 * 0.5_f32.tan()).abs() < 1e-5);
    }

    #[test]
    fn pictures_of_another_shape_keep_the_extent_that_the_axis_names() {
        use bottega_scene::FovAxis;
        // Half extents of a picture twice as high as wide, for a camera made for twice as wide as high
        let cases = [
            (FovAxis::X, Vec2::new(2.0, 4.0)),
            (FovAxis::Y, Vec2::new(0.5, 1.0)),
            (FovAxis::Diagonal, Vec2::new(1.0, 2.0)),
            (FovAxis::Smaller, Vec2::new(1.0, 2.0)),
            (FovAxis::Larger, Vec2::new(1.0, 2.0)),
        ];
        for projection in [
            Projection::Perspective { vertical_fov: std::f32::consts::FRAC_PI_2 },
            Projection::Orthographic { height: 2.0 },
        ] {
            for (fov_axis, expected) in cases {
                let camera = Camera { aspect: Some(2.0), fov_axis, ..camera(projection, 0.0) };
                let extent = CameraRays::new(&camera, 10, 20).half_extent;
                assert!((extent - expected).length() < 1e-5, "{fov_axis:?}: {extent}");
                assert_eq!(CameraRays::new(&camera, 20, 10).half_extent, CameraRays::new(&camera, 40, 20).half_extent);
            }
        }
    }

    #[test]
    fn pixels_need_not_be_square() {
        use bottega_scene::FovAxis;
        for projection in [
            Projection::Perspective { vertical_fov: std::f32::consts::FRAC_PI_2 },
            Projection::Orthographic { height: 2.0 },
        ] {
            for fov_axis in [FovAxis::X, FovAxis::Y, FovAxis::Diagonal, FovAxis::Smaller, FovAxis::Larger] {
                let camera = Camera { aspect: Some(2.0), pixel_aspect: 1.5, fov_axis, ..camera(projection, 0.0) };
                let extent = CameraRays::new(&camera, 40, 20).half_extent;
                assert!((extent - Vec2::new(3.0, 1.0)).length() < 1e-5, "{fov_axis:?}: {extent}");
            }
        }
    }

    #[test]
    fn parallel_rays_are_parallel_and_a_picture_height_apart() {
        let rays = CameraRays::new(&camera(Projection::Orthographic { height: 6.0 }, 0.0), 10, 10);
        let upper = rays.ray(Vec2::new(0.0, 0.0), [0.0; 2]);
        let lower = rays.ray(Vec2::new(10.0, 10.0), [0.0; 2]);
        assert_eq!(upper.direction, lower.direction);
        assert!((upper.origin - lower.origin - Vec3::new(-6.0, 6.0, 0.0)).length() < 1e-5);
    }

    #[test]
    fn a_panorama_sees_all_around_as_pbrts_does() {
        let rays = |panorama| CameraRays::new(&camera(Projection::Panorama(panorama), 0.5), 200, 100);
        let close = |a: Vec3, b: Vec3| assert!((a - b).length() < 1e-5, "{a} {b}");
        let round = rays(Panorama::Equirectangular);
        // pbrt's z is the reverse of ours
        let at = |x, y| round.ray(Vec2::new(x, y), [0.3; 2]);
        assert_eq!(at(17.0, 33.0).origin, Vec3::new(1.0, 2.0, 3.0));
        close(at(50.0, 50.0).direction, Vec3::NEG_Z);
        close(at(0.0, 50.0).direction, Vec3::X);
        close(at(100.0, 50.0).direction, Vec3::NEG_X);
        close(at(77.0, 0.0).direction, Vec3::Y);
        close(at(77.0, 100.0).direction, Vec3::NEG_Y);
        let square = rays(Panorama::EqualArea);
        let at = |x, y| square.ray(Vec2::new(x, y), [0.3; 2]).direction;
        close(at(100.0, 50.0), Vec3::Y);
        close(at(200.0, 50.0), Vec3::X);
        close(at(100.0, 100.0), Vec3::NEG_Z);
        close(at(0.0, 0.0), Vec3::NEG_Y);
        close(at(200.0, 100.0), Vec3::NEG_Y);
        // Beyond an edge, the sphere continues
        for (inside, beyond) in [((0.1, 30.0), (-0.1, 70.0)), ((60.0, 99.9), (140.0, 100.1))] {
            close(at(inside.0, inside.1), at(beyond.0, beyond.1));
        }
        close(
            round.ray(Vec2::new(30.0, -0.5), [0.0; 2]).direction,
            round.ray(Vec2::new(130.0, 0.5), [0.0; 2]).direction,
        );
    }

    #[test]
    fn a_panorama_of_equal_areas_has_equal_areas() {
        let rays = CameraRays::new(&camera(Projection::Panorama(Panorama::EqualArea), 0.0), 64, 64);
        // Great circles halve the sphere, and second moments are a third
        let mut moments = glam::Mat3::ZERO;
        for i in 0..64 * 64 {
            let d = rays.ray(Vec2::new((i % 64) as f32 + 0.5, (i / 64) as f32 + 0.5), [0.0; 2]).direction;
            moments += glam::Mat3::from_cols(d * d.x, d * d.y, d * d.z) * (1.0 / 4096.0);
        }
        assert!(moments.abs_diff_eq(glam::Mat3::IDENTITY * (1.0 / 3.0), 1e-3), "{moments}");
    }

    #[test]
    fn rays_go_from_the_near_plane_to_the_far_one() {
        let clip = Clip { near: 2.0, far: 7.0 };
        for (projection, lens_radius) in [
            (Projection::Perspective { vertical_fov: 1.2 }, 0.0),
            (Projection::Perspective { vertical_fov: 1.2 }, 0.5),
            (Projection::Orthographic { height: 3.0 }, 0.0),
            (Projection::Orthographic { height: 3.0 }, 0.5),
        ] {
            let plain = camera(projection, lens_radius);
            let rays = [plain.clone(), Camera { clip, ..plain }].map(|camera| CameraRays::new(&camera, 8, 6));
            for (place, lens) in [(Vec2::new(4.0, 3.0), [0.5; 2]), (Vec2::new(0.5, 5.0), [0.9, 0.2])] {
                let [whole, cut] = [&rays[0], &rays[1]].map(|rays| rays.ray(place, lens));
                assert_eq!(whole.direction, cut.direction);
                assert_eq!((whole.start, whole.reach), (0.0, f32::INFINITY));
                assert!((cut.origin - whole.origin - whole.direction * cut.start).length() < 1e-5);
                let depth = |distance: f32| 3.0 - (cut.origin + cut.direction * distance).z;
                assert!((depth(0.0) - 2.0).abs() < 1e-5 && (depth(cut.reach) - 7.0).abs() < 1e-5, "{projection:?}");
            }
        }
        let around = Camera { clip, ..camera(Projection::Panorama(Panorama::EqualArea), 0.0) };
        let ray = CameraRays::new(&around, 8, 8).ray(Vec2::new(1.0, 6.0), [0.5; 2]);
        assert_eq!((ray.origin, ray.start, ray.reach), (Vec3::new(1.0, 2.0, 3.0), 0.0, f32::INFINITY));
    }

    #[test]
    fn rays_through_a_lens_meet_in_the_plane_in_focus() {
        let rays = CameraRays::new(&camera(Projection::Perspective { vertical_fov: 0.7 }, 0.3), 8, 8);
        let meet = |lens| {
            let ray = rays.ray(Vec2::new(2.0, 7.0), lens);
            ray.origin + ray.direction * (4.0 / -ray.direction.z)
        };
        let (a, b) = (meet([0.1, 0.2]), meet([0.9, 0.6]));
        assert!((a - b).length() < 1e-5, "{a} {b}");
        let ray = rays.ray(Vec2::new(2.0, 7.0), [0.9, 0.6]);
        assert!((ray.origin - Vec3::new(1.0, 2.0, 3.0)).length() <= 0.3);
    }
}
