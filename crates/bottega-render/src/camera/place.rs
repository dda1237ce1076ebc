//! The place in the picture at which a camera sees a point: the inverse of camera rays.

use std::f32::consts::PI;

use bottega_kernels::math;
use bottega_scene::{FisheyeMapping, Panorama};
use glam::{Affine3A, DMat3, DVec2, DVec3, Vec2, Vec3};

use super::{
    CameraRays, ProjectionKind,
    panorama::{Fisheye, place_on_face},
};
use crate::lights::square_of;

/// Returns a point in camera space, in double precision: places are compared with each other.
fn in_camera(world_from_camera: &Affine3A, p: Vec3) -> DVec3 {
    let linear = DMat3::from_cols(
        Vec3::from(world_from_camera.matrix3.x_axis).as_dvec3(),
        Vec3::from(world_from_camera.matrix3.y_axis).as_dvec3(),
        Vec3::from(world_from_camera.matrix3.z_axis).as_dvec3(),
    );
    linear.inverse() * (p.as_dvec3() - Vec3::from(world_from_camera.translation).as_dvec3())
}

impl CameraRays {
    /// Returns the vector between the places at which the camera sees two points, in pixels to the right and up; 0 if it
    /// does not see one of them. The thin lens counts as a pinhole, and a system of lenses as the pinhole that images as
    /// large near the axis.
    ///
    /// - `center`: centre of the pixel, in pixels: it decides on the eye of a stereo picture and on the face of a cube.
    /// - `from`, `to`: points in world space, each with its time of the shutter, from 0 to 1.
    pub(crate) fn vector_between(&self, center: Vec2, from: (Vec3, f32), to: (Vec3, f32)) -> Vec2 {
        let place = |(p, time)| self.place_of(center, p, time);
        let (Some(from), Some(to)) = (place(from), place(to)) else { return Vec2::ZERO };
        let mut vector = to - from;
        if self.kind == ProjectionKind::Panorama(Panorama::Equirectangular) {
            // The left edge continues at the right one
            let width = 2.0 / f64::from(self.double_pixel.x);
            vector.x -= (vector.x / width).round() * width;
        }
        DVec2::new(vector.x, -vector.y).as_vec2()
    }

    /// Returns the place at which the camera sees a point at a time, in pixels from the upper left corner of the picture
    /// of one eye. `None`: it does not.
    fn place_of(&self, center: Vec2, p: Vec3, time: f32) -> Option<DVec2> {
        let p = match &self.motion {
            None => in_camera(&self.world_from_camera, p),
            Some(motion) => in_camera(&motion.at(time), p),
        };
        let (eye, center) = match &self.eyes {
            None => (0.0, center),
            Some(eyes) => eyes.of_pixel(center),
        };
        let half_pixel = 0.5 * self.double_pixel;
        let film = match self.kind {
            ProjectionKind::Perspective | ProjectionKind::Parallel | ProjectionKind::Lenses => {
                let depth = -p.z;
                let is_parallel = self.kind == ProjectionKind::Parallel;
                if depth <= 0.0 && !is_parallel {
                    return None;
                }
                // Both eyes see a point at the distance of convergence at the same place
                let (offset, slant) = match &self.eyes {
                    Some(eyes) if self.kind != ProjectionKind::Lenses => (f64::from(eye), f64::from(eyes.slant(eye))),
                    _ => (f64::from(eye), 0.0),
                };
                let across = DVec2::new(p.x - offset, p.y);
                match &self.lenses {
                    _ if is_parallel => across + DVec2::X * (slant * depth),
                    Some(lenses) => across / depth * f64::from(lenses.image_distance()),
                    None => across / depth + DVec2::X * slant,
                }
            }
            ProjectionKind::Fisheye(fisheye) => {
                let p = p.as_vec3() - self.eye_on_sphere(eye, false, p.as_vec3());
                fisheye.film_of(p).as_dvec2()
            }
            ProjectionKind::Panorama(panorama) => {
                let p = p.as_vec3();
                let direction = (p - self.eye_on_sphere(eye, true, p)).try_normalize()?;
                let place = match panorama {
                    Panorama::Equirectangular => Vec2::new(
                        0.5 + math::atan2(direction.x, -direction.z) / (2.0 * PI),
                        math::atan2(Vec2::new(direction.x, direction.z).length(), direction.y) / PI,
                    ),
                    Panorama::EqualArea => square_of(Vec3::new(direction.x, -direction.z, direction.y)),
                    Panorama::Cube => place_on_face(center.x * half_pixel.x, direction)?,
                };
                return Some((place / half_pixel).as_dvec2());
            }
        };
        let shifted = film / self.half_extent.as_dvec2() + self.lens_shift.as_dvec2();
        Some(DVec2::new(shifted.x + 1.0, 1.0 - shifted.y) / self.double_pixel.as_dvec2())
    }

    /// Returns the origin of the eye that sees a point of a fisheye or panorama, in camera space.
    fn eye_on_sphere(&self, offset: f32, turns: bool, p: Vec3) -> Vec3 {
        match &self.eyes {
            Some(eyes) if p != Vec3::ZERO => eyes.on_sphere(offset, turns, p).0,
            _ => Vec3::ZERO,
        }
    }
}

impl Fisheye {
    /// Returns the position on the film at which a direction is seen, in radii of the rim; beyond the rim, more than 1.
    ///
    /// - `direction`: of any length.
    fn film_of(&self, direction: Vec3) -> Vec2 {
        let across = direction.truncate();
        let sine = across.length();
        if sine == 0.0 {
            return Vec2::ZERO;
        }
        let angle = math::atan2(sine, -direction.z);
        let radius = match self.mapping() {
            FisheyeMapping::Equidistant => angle / self.rim(),
            FisheyeMapping::Equisolid => math::sin(0.5 * angle) / math::sin(0.5 * self.rim()),
        };
        across * (radius / sine)
    }
}

#[cfg(test)]
mod tests {
    use bottega_scene::{Camera, Clip, LensDescription, LensSurface, LensSystem, Projection, Stereo, StereoLayout};

    use super::*;

    /// Largest distance in pixels between a place and that of a point on its ray.
    fn error(camera: &Camera) -> f32 {
        let size = Vec2::new(96.0, 64.0);
        let rays = CameraRays::new(camera, size.x as u32, size.y as u32);
        let mut largest = 0.0f32;
        for (center, distance) in [([20.5, 40.5], 3.0), ([70.5, 12.5], 0.7), ([50.5, 32.5], 40.0)] {
            let (center, offset) = (Vec2::from(center), Vec2::new(0.3, -0.2));
            let [here, moved] = [Vec2::ZERO, offset].map(|offset| {
                let ray = rays.ray_of_pixel(center, offset, [0.5; 2]);
                (ray.origin + ray.direction * distance, 0.0)
            });
            let vector = rays.vector_between(center, here, moved);
            largest = largest.max((vector - Vec2::new(offset.x, -offset.y)).length());
        }
        largest
    }

    #[test]
    fn a_point_is_seen_where_its_ray_left() {
        let base = Camera {
            world_from_camera: Camera::looking(Vec3::new(0.5, 1.0, 2.0), Vec3::new(-1.0, 0.2, 0.3), Vec3::Y).unwrap(),
            lens_shift: Vec2::new(0.1, -0.2),
            clip: Clip { near: 0.1, ..Clip::NONE },
            ..Camera::default()
        };
        let fisheye = |mapping| Projection::Fisheye { mapping, field_of_view: 2.5, height: 0.5 };
        let projections = [
            Projection::Perspective { vertical_fov: 0.8 },
            Projection::Orthographic { height: 2.0 },
            fisheye(FisheyeMapping::Equidistant),
            fisheye(FisheyeMapping::Equisolid),
            Projection::Panorama(Panorama::Equirectangular),
            Projection::Panorama(Panorama::EqualArea),
            Projection::Panorama(Panorama::Cube),
        ];
        let stereo = Stereo { layout: StereoLayout::SideBySide, eye_distance: 0.06, convergence: 2.0 };
        for projection in projections {
            let camera = Camera { projection, ..base.clone() };
            assert!(error(&camera) < 0.002, "{projection:?}: {}", error(&camera));
            let camera = Camera { stereo: Some(stereo), ..camera };
            // On spheres, convergence shifts both places nearly alike
            let allowed = if matches!(projection, Projection::Perspective { .. } | Projection::Orthographic { .. }) {
                0.002
            } else {
                0.1
            };
            assert!(error(&camera) < allowed, "stereo, {projection:?}: {}", error(&camera));
        }
        let surfaces = vec![LensSurface { radius: 0.0, thickness: 0.05, eta: 1.0, aperture_radius: 0.001 }];
        let description = LensDescription { surfaces, film_diagonal: 0.03, focus_distance: None };
        let camera = Camera { lenses: Some(LensSystem::new(description).unwrap()), ..base };
        // The middle of the exit pupil is not at the same place for all pixels: some hundredths of a millimeter here
        assert!(error(&camera) < 0.05, "lenses: {}", error(&camera));
    }
}
