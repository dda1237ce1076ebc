//! The intersection of a ray and a sphere.

use crate::Ray;
use crate::tree::Sphere;

/// Returns where the ray enters and leaves the sphere, ascending; NaN for a miss. A grazing touch is a miss.
///
/// Computed in double precision, by the distance of the center from the ray instead of the textbook's b² − 4ac, whose
/// difference cancels for small and for huge spheres (Haines et al. 2019, Ray Tracing Gems, chapter 7).
pub(crate) fn roots(sphere: &Sphere, ray: &Ray) -> [f32; 2] {
    let d = ray.direction.to_array().map(f64::from);
    let to_center: [f64; 3] = std::array::from_fn(|i| f64::from(sphere.center[i]) - f64::from(ray.origin[i]));
    let dot = |a: [f64; 3], b: [f64; 3]| a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
    let squared = dot(d, d);
    let middle = dot(to_center, d) / squared;
    let off_axis: [f64; 3] = std::array::from_fn(|i| to_center[i] - d[i] * middle);
    let radius = f64::from(sphere.radius);
    let discriminant = radius * radius - dot(off_axis, off_axis);
    if !(discriminant > 0.0 && squared > 0.0) {
        return [f32::NAN; 2];
    }
    let half = (discriminant / squared).sqrt();
    let (enter, leave) = (middle - half, middle + half);
    // Compute the root nearer to the origin from the product of both, to avoid cancellation.
    let product = (dot(to_center, to_center) - radius * radius) / squared;
    let (enter, leave) = if middle > 0.0 { (product / leave, leave) } else { (enter, product / enter) };
    [enter as f32, leave as f32]
}
