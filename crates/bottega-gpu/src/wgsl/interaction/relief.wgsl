// Twin: `bottega-render/src/interaction/relief.rs`.
//
// Normals from normal maps and height maps.

// Returns the normal of a surface raised by heights along `ns`; on the side of `ns`. `along_u`, `along_v`: derivatives of the
// point along the map's coordinates.
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

// Returns the normal of a normal map; on the side of `ns`. `tangent`: along increasing u of the map's coordinates, with the sign
// of its bitangent.
fn relief_mapped_normal(map: u32, scale: f32, uv: vec2f, footprint: f32, ns: vec3f, tangent: vec4f) -> vec3f {
    let bent = (image_eval(map, uv, footprint).xyz * 2.0 - 1.0) * vec3f(scale, scale, 1.0);
    let along = tangent.xyz - ns * dot(ns, tangent.xyz);
    if dot(along, along) < 1e-30 {
        return ns;
    }
    let t = normalize(along);
    return math_normalize_or(t * bent.x + cross(ns, t) * tangent.w * bent.y + ns * bent.z, ns);
}
