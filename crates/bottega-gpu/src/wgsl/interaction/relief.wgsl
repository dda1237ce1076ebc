// Twin: `bottega-render/src/interaction/relief.rs`.
//
// Normals by maps of normals and of heights.

// The normal of the surface lifted by heights along `ns`; outward like `ns`. `along_u`, `along_v`: how the point moves with the
// coordinates of the map's set.
fn relief_bumped_normal(
    map: u32, scale: f32, uv: vec2f, footprint: f32, ns: vec3f, along_u: vec3f, along_v: vec3f,
) -> vec3f {
    let slopes = image_slopes(map, uv, footprint);
    let channel = vec4f(vec4u(CHANNEL_R, CHANNEL_G, CHANNEL_B, CHANNEL_A) == vec4u(map & CHANNEL_MASK));
    let u = along_u + ns * (scale * dot(slopes.u, channel) - dot(ns, along_u));
    let v = along_v + ns * (scale * dot(slopes.v, channel) - dot(ns, along_v));
    let normal = math_normalize_or(cross(u, v), ns);
    return select(normal, -normal, dot(normal, ns) < 0.0);
}

// The normal that a normal map tells of; outward like `ns`. `tangent`: of increasing u of the map's set of coordinates, with
// the sign of its bitangent.
fn relief_mapped_normal(map: u32, scale: f32, uv: vec2f, footprint: f32, ns: vec3f, tangent: vec4f) -> vec3f {
    let bent = (image_eval(map, uv, footprint).xyz * 2.0 - 1.0) * vec3f(scale, scale, 1.0);
    let along = tangent.xyz - ns * dot(ns, tangent.xyz);
    if dot(along, along) < 1e-30 {
        return ns;
    }
    let t = normalize(along);
    return math_normalize_or(t * bent.x + cross(ns, t) * tangent.w * bent.y + ns * bent.z, ns);
}
