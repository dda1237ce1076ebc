//! Normals by maps of normals and of heights.

use bottega_scene::{ScalarParam, Scene, TextureMap};
use glam::{Vec2, Vec3};

use super::Interaction;

/// The normal of the surface lifted by `height` along `ns`. Outward like `ns`.
///
/// Source: Blinn 1978, Simulation of Wrinkled Surfaces, eq. 3, without the term of the surface's own curvature (as Mitsuba
/// has it). Heights are compared half a texel apart on either side, or half the width of the beam where that is more.
pub(super) fn bumped_normal(
    scene: &Scene,
    height: &ScalarParam,
    point: &Interaction,
    ns: Vec3,
    derivatives: impl Fn(u8) -> Option<[Vec3; 2]>,
) -> Vec3 {
    let Some((map, _)) = &height.texture else { return ns };
    let Some(along) = derivatives(map.uv_set) else { return ns };
    let (width, rows) = scene.images[map.image.0 as usize].size();
    let scale = map.picture_from_uv.matrix2;
    let texels = Vec2::new(scale.x_axis.length() * width as f32, scale.y_axis.length() * rows as f32);
    let step = (0.5 / texels.max(Vec2::splat(1e-3))).max(Vec2::splat(0.5 * point.footprint));
    let at = |shift: Vec2| height.eval(scene, point.uvs.map(|uv| uv + shift), point.footprint);
    let rise = |step: Vec2| (at(step) - at(-step)) / (2.0 * step.length());
    let rises = [rise(Vec2::new(step.x, 0.0)), rise(Vec2::new(0.0, step.y))];
    let [u, v] = [0, 1].map(|i| along[i] + ns * (rises[i] - ns.dot(along[i])));
    let normal = u.cross(v).normalize_or(ns);
    if normal.dot(ns) < 0.0 { -normal } else { normal }
}

/// The normal that a normal map tells of. Outward like `ns`.
pub(super) fn mapped_normal(
    scene: &Scene,
    map: &TextureMap,
    scale: f32,
    point: &Interaction,
    ns: Vec3,
    tangent: (Vec3, f32),
) -> Vec3 {
    let uv = point.uvs[usize::from(map.uv_set & 1)];
    let texel = scene.images[map.image.0 as usize].eval(map, uv, point.footprint).truncate();
    let bent = (texel * 2.0 - 1.0) * Vec3::new(scale, scale, 1.0);
    let t = tangent.0 - ns * ns.dot(tangent.0);
    let Some(t) = t.try_normalize() else { return ns };
    let b = ns.cross(t) * tangent.1;
    (t * bent.x + b * bent.y + ns * bent.z).normalize_or(ns)
}
