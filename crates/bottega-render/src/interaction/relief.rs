//! Shading normals from normal maps and height maps.

use bottega_scene::{ScalarParam, Scene, TextureMap, Uvs};
use glam::Vec3;

use crate::mapping::{TexturePlace, gradients};

/// Returns the normal of the surface displaced by `height` along `ns`, on the side of `ns`.
///
/// Source: Blinn 1978, Simulation of Wrinkled Surfaces, eq. 3, without the term of the surface's own curvature (as in
/// Mitsuba). Heights between texels are interpolated by the texture and filtered over `footprint`.
pub(super) fn bumped_normal(
    scene: &Scene,
    height: &ScalarParam,
    place: TexturePlace,
    footprint: f32,
    ns: Vec3,
    derivatives: impl Fn(u8) -> Option<[Vec3; 2]>,
) -> Vec3 {
    let Some((map, channel)) = &height.texture else { return ns };
    let (uv, footprint) = place.of(scene, map, footprint);
    let slopes = scene.images[map.image.0 as usize].slopes(map, uv, footprint);
    if let Some(mapping) = map.mapping(scene) {
        let [u, v] = gradients(mapping, &place.mapping_point);
        let slope = (u * slopes[0][*channel as usize] + v * slopes[1][*channel as usize]) * height.factor;
        return (ns - (slope - ns * ns.dot(slope))).normalize_or(ns);
    }
    let Some(along) = derivatives(map.uv_set) else { return ns };
    let [u, v] = [0, 1].map(|i| along[i] + ns * (height.factor * slopes[i][*channel as usize] - ns.dot(along[i])));
    let normal = u.cross(v).normalize_or(ns);
    if normal.dot(ns) < 0.0 { -normal } else { normal }
}

/// Returns the normal of a normal map filtered over `footprint`, on the side of `ns`.
pub(super) fn mapped_normal(
    scene: &Scene,
    (map, scale): (&TextureMap, f32),
    place: TexturePlace,
    footprint: f32,
    ns: Vec3,
    tangent: (Vec3, f32),
) -> Vec3 {
    let (uv, footprint) = place.of(scene, map, footprint);
    let texel = scene.images[map.image.0 as usize].eval(map, uv, footprint).truncate();
    let bent = (texel * 2.0 - 1.0) * Vec3::new(scale, scale, 1.0);
    let t = tangent.0 - ns * ns.dot(tangent.0);
    let Some(t) = t.try_normalize() else { return ns };
    let b = ns.cross(t) * tangent.1;
    (t * bent.x + b * bent.y + ns * bent.z).normalize_or(ns)
}
