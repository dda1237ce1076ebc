//! Where a ray must start that leaves a surface, so that it does not hit that surface again.

use glam::Vec3;

/// Moves a point that was found on a surface off it, to the side where `direction` points.
///
/// - `p`: the hit point in world space, best as the barycentric mean of the vertices (the error of
///   `origin + t · direction` grows with the length of the ray).
/// - `ng`: the geometric normal, unit length, on either side.
/// - `direction`: where the new ray goes.
///
/// The step is a fixed number of units in the last place of each coordinate, so that it fits scenes of any size and
/// needs no constant chosen by a user; near a coordinate plane, where such units vanish, it is a small fixed length.
/// Source of the idea: Wächter and Binder, "A Fast and Robust Method for Avoiding Self-Intersection", Ray Tracing
/// Gems (2019), chapter 6. Here the step is taken in floats, which gives the same without bit casts.
#[inline]
pub fn offset_ray_origin(p: Vec3, ng: Vec3, direction: Vec3) -> Vec3 {
    /// 256 units in the last place, relative to a coordinate at the lower end of its binade.
    const RELATIVE: f32 = 256.0 / 8_388_608.0;
    /// Below this size of a coordinate the step no longer shrinks with it.
    const SMALL: f32 = 1.0 / 32.0;
    let n = if ng.dot(direction) < 0.0 { -ng } else { ng };
    let size = p.abs().max(Vec3::splat(SMALL.min(p.abs().max_element())));
    p + n * (size * RELATIVE)
}
