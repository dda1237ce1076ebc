//! Tests of candidate hits: kinds of rays, and the surfaces that exist for them.

use bottega_kernels::{Hit, Ray};
use bottega_scene::{Scene, Visibility};

use super::opacity::opacity_of;
use crate::surfaces::Surfaces;

/// Bit of the key of a surface's random number that is set for shadow rays, so that they get another number than paths.
pub const ASKS_AS_SHADOW: u32 = 1 << 31;

/// The kind of ray that tests if a surface is opaque at a hit.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum SurfaceQuery {
    /// A camera ray, up to the path's first vertex.
    Camera,
    /// A later ray of a path, if no surface exists for one kind of event and not for another.
    Path,
    /// A later ray of a path, by the kind of event that it leaves.
    Bounce(Visibility),
    /// The first ray of a photon. It meets the surfaces that shadow rays meet.
    Photon,
    /// A shadow ray. Its random numbers are independent of those of the path's previous segment, as both may cross one
    /// surface.
    Shadow,
}

impl SurfaceQuery {
    /// Returns the kind of the next ray of a path that has this number of vertices.
    #[inline(always)]
    pub(crate) fn of_vertex(self, vertices: u32) -> Self {
        if self == Self::Path && vertices == 0 { Self::Camera } else { self }
    }

    /// Returns the kind of ray as surfaces distinguish it.
    fn ray(self) -> Visibility {
        match self {
            Self::Camera => Visibility::CAMERA,
            Self::Path => Visibility::DIFFUSE,
            Self::Bounce(kind) => kind,
            Self::Photon | Self::Shadow => Visibility::SHADOW,
        }
    }

    /// Returns the key of a surface's random number; it differs between entering and leaving a sphere.
    fn number_of(self, hit: &Hit, is_left: bool) -> u64 {
        let kind_bit = if self == Self::Shadow { u64::from(ASKS_AS_SHADOW) } else { 0 };
        u64::from(hit.instance) << 32 | u64::from(hit.primitive) ^ kind_bit ^ u64::from(is_left)
    }
}

/// Returns the kinds of ray for which the surface that was hit exists.
fn visibility_of(scene: &Scene, hit: &Hit) -> Visibility {
    match hit.sphere() {
        Some(sphere) => scene.spheres[sphere as usize].visibility,
        None => scene.instances[hit.instance as usize].visibility,
    }
}

/// Returns true if the surface of a candidate hit exists for this kind of ray and is opaque.
///
/// - `chance`: returns a random number in [0, 1) for the key of a half-transparent surface; equal keys must get equal
///   numbers.
pub(crate) fn is_there(
    surfaces: &Surfaces,
    ray: &Ray,
    time: f32,
    hit: &Hit,
    query: SurfaceQuery,
    chance: impl FnOnce(u64) -> f32,
) -> bool {
    if surfaces.has_visibility() && !visibility_of(surfaces.scene(), hit).has(query.ray()) {
        return false;
    }
    if query == SurfaceQuery::Camera && surfaces.culls_backs() && is_culled(surfaces, ray, time, hit) {
        return false;
    }
    let (opacity, is_left) = opacity_of(surfaces, ray, time, hit);
    opacity >= 1.0 || (opacity > 0.0 && chance(query.number_of(hit, is_left)) < opacity)
}

/// Returns true if a candidate hit is the back of a surface that is invisible to the camera from there.
fn is_culled(surfaces: &Surfaces, ray: &Ray, time: f32, hit: &Hit) -> bool {
    let scene = &**surfaces.scene();
    if let Some(index) = hit.sphere() {
        let moved = surfaces.moved_sphere(index, time);
        let sphere = moved.as_ref().unwrap_or(&scene.spheres[index as usize]);
        let ng = ray.origin + hit.t * ray.direction - sphere.center;
        return scene.materials[sphere.material as usize].culls_back && ng.dot(ray.direction) > 0.0;
    }
    if !scene.materials[surfaces.material_of(hit.instance) as usize].culls_back {
        return false;
    }
    let world_from_object = surfaces.world_from_object(hit.instance, time);
    let corners = surfaces.corners(hit.instance, hit.primitive, time);
    let [a, b, c] = corners.map(|corner| world_from_object.transform_point3(corner));
    (b - a).cross(c - a).dot(ray.direction) > 0.0
}
