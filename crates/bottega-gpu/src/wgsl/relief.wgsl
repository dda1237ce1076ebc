// Normals by maps of normals and of heights, and the direction in which highlights are stretched: what turns a frame.

const RELIEF_NONE: u32 = 0u;
const RELIEF_NORMALS: u32 = 1u;
const RELIEF_HEIGHTS: u32 = 2u;

struct MaterialRelief {
    kind: u32,
    // Handle of its texture, with a channel in the lowest bits; 0: none.
    map: u32,
    // Of the x and y of normals, or of heights.
    scale: f32,
    // Mitsuba's rule, and what it says; else the normal is bent until it is seen.
    mitsuba: bool,
    turns: bool,
    shadows: bool,
    mirrored: bool,
}

fn material_relief(material: u32) -> MaterialRelief {
    let head = material_head(material);
    let bits = material_words[head + 20u];
    return MaterialRelief(bits & 3u, material_words[head + 21u], material_f32(head + 22u), (bits & 16u) != 0u,
        (bits & 32u) != 0u, (bits & 64u) != 0u, (bits & 128u) != 0u);
}

// The normal that a normal map tells of; outward like `ns`. `tangent`: of increasing u of the map's set of coordinates, with
// the sign of its bitangent.
fn relief_mapped(map: u32, scale: f32, uv: vec2f, footprint: f32, ns: vec3f, tangent: vec4f) -> vec3f {
    let bent = (texture_eval(map, uv, footprint).xyz * 2.0 - 1.0) * vec3f(scale, scale, 1.0);
    let along = tangent.xyz - ns * dot(ns, tangent.xyz);
    if dot(along, along) < 1e-30 {
        return ns;
    }
    let t = normalize(along);
    return math_normalize_or(t * bent.x + cross(ns, t) * tangent.w * bent.y + ns * bent.z, ns);
}

// The normal of the surface lifted by heights along `ns`; outward like `ns`. `along_u`, `along_v`: how the point moves with the
// coordinates of the map's set.
fn relief_bumped(
    map: u32, scale: f32, uv: vec2f, footprint: f32, ns: vec3f, along_u: vec3f, along_v: vec3f,
) -> vec3f {
    let slopes = texture_slopes(map, uv, footprint);
    let channel = vec4f(vec4u(0u, 1u, 2u, 3u) == vec4u(map & 7u));
    let u = along_u + ns * (scale * dot(slopes.u, channel) - dot(ns, along_u));
    let v = along_v + ns * (scale * dot(slopes.v, channel) - dot(ns, along_v));
    let normal = math_normalize_or(cross(u, v), ns);
    return select(normal, -normal, dot(normal, ns) < 0.0);
}

// The map of the normals of the clear coat (0: it has the smooth normal of the surface), and its scale.
fn material_coat_map(material: u32) -> u32 {
    return material_words[material_head(material) + 23u];
}

fn material_coat_scale(material: u32) -> f32 {
    return material_f32(material_head(material) + 24u);
}

// Where highlights are stretched to, in the tangent frame (x along u, y up the picture).
fn material_anisotropy_way(material: u32, uv0: vec2f, uv1: vec2f, footprint: f32) -> vec2f {
    let head = material_head(material);
    let handle = material_words[head + 25u];
    var way = vec2f(1.0, 0.0);
    if handle != 0u {
        let texel = texture_eval(handle, select(uv0, uv1, texture_uv_set(handle) == 1u), footprint);
        let drawn = 2.0 * texel.xy - 1.0;
        if dot(drawn, drawn) > 1e-30 {
            way = normalize(drawn);
        }
    }
    let turn = vec2f(material_f32(head + 26u), material_f32(head + 27u));
    return vec2f(turn.x * way.x - turn.y * way.y, turn.y * way.x + turn.x * way.y);
}

// How a relief of Mitsuba's turned the frame: for `SurfacePoint.lifted`. `normal`: of the surface without relief, in the local
// frame of the lifted one.
fn relief_lifted(normal: vec3f, shadows: bool) -> vec4f {
    return vec4f(normal, select(0.0, min(0.125 * relief_slope_squared(normal.z), 1.0), shadows));
}

fn relief_slope_squared(cosine: f32) -> f32 {
    let squared = cosine * cosine;
    return max(1.0 - squared, 0.0) / max(squared, 1e-12);
}

// What scattering towards `wi` is multiplied by.
fn relief_factor(lifted: vec4f, wi: vec3f) -> f32 {
    let cosine = dot(lifted.xyz, wi);
    if cosine * wi.z <= 0.0 {
        return 0.0;
    }
    if lifted.w == 0.0 {
        return 1.0;
    }
    return 2.0 / (1.0 + sqrt(1.0 + lifted.w * relief_slope_squared(cosine)));
}
