//! One ray through all surfaces of a system of lenses.

use glam::Vec3;

use super::description::LensSurface;

/// Traces a ray from the film through all surfaces. Returns its last point and its direction from there; `None`: an
/// opening's edge blocks it, it misses a surface, or it is reflected as a whole.
///
/// - `surfaces`: from the scene to the film.
pub(super) fn through(surfaces: &[LensSurface], film: Vec3, towards: Vec3) -> Option<(Vec3, Vec3)> {
    let (mut origin, mut direction) = (film, towards.normalize());
    // Position of the current surface's vertex on the axis
    let mut vertex = 0.0;
    for (index, surface) in surfaces.iter().enumerate().rev() {
        vertex -= surface.thickness;
        // Find the point on the surface
        if surface.radius == 0.0 {
            origin += direction * ((vertex - origin.z) / direction.z);
        } else {
            origin += direction * distance_to_sphere(origin, direction, vertex + surface.radius, surface.radius)?;
        }
        if origin.truncate().length_squared() > surface.aperture_radius * surface.aperture_radius {
            return None;
        }
        // Refract the ray into the space before the surface
        let before = index.checked_sub(1).map_or(1.0, |previous| surfaces[previous].eta);
        if surface.radius != 0.0 && surface.eta != before {
            let outward = (origin - Vec3::new(0.0, 0.0, vertex + surface.radius)) / surface.radius;
            let normal = if outward.dot(direction) > 0.0 { -outward } else { outward };
            direction = refracted(direction, normal, surface.eta / before)?;
        }
    }
    (direction.z < 0.0).then_some((origin, direction))
}

/// Returns the distance at which a ray towards the scene meets a sphere around a point of the axis, on the side of its
/// vertex. `None`: it misses the sphere.
///
/// - `radius`: above 0 if the centre lies towards the film, from the vertex.
fn distance_to_sphere(origin: Vec3, direction: Vec3, center: f32, radius: f32) -> Option<f32> {
    let from_center = origin - Vec3::new(0.0, 0.0, center);
    let half_b = from_center.dot(direction);
    let c = from_center.length_squared() - radius * radius;
    let discriminant = half_b * half_b - c;
    if discriminant < 0.0 {
        return None;
    }
    let root = discriminant.sqrt();
    // The vertex of a surface that bulges towards the scene is the farther one
    let distance = if radius > 0.0 { -half_b + root } else { -half_b - root };
    (distance >= 0.0).then_some(distance)
}

/// Refracts a direction of unit length by Snell's law. `None`: total reflection.
///
/// - `normal`: of unit length, against the direction.
/// - `eta`: refractive index before the surface over that behind it, as the ray travels.
fn refracted(direction: Vec3, normal: Vec3, eta: f32) -> Option<Vec3> {
    let cos = -direction.dot(normal);
    let sin_squared = eta * eta * (1.0 - cos * cos).max(0.0);
    (sin_squared < 1.0).then(|| (direction * eta + normal * (eta * cos - (1.0 - sin_squared).sqrt())).normalize())
}
