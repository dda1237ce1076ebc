// What a path knows of a point on a surface: from the hit to the shading frame (`bottega_render::interaction`).

// Distance that a new ray keeps from the surface, relative to the sizes of the numbers that its place was computed from.
const CLEARANCE: f32 = 64.0 / 8388608.0;
// Least cosine between the direction of who looks and the shading normal.
const COSINE_MIN: f32 = 1e-3;

struct Interaction {
    p: vec3<f32>,
    clearance: f32,
    // Where rays start that stay on the side of wo.
    p_outside: vec3<f32>,
    footprint: f32,
    // Geometric normal, on the front side.
    ng: vec3<f32>,
    material: u32,
    // Shading frame; n is on the side of wo.
    s: vec3<f32>,
    is_in_front: bool,
    t: vec3<f32>,
    flags: u32,
    n: vec3<f32>,
    coat_normal: vec3<f32>,
    wo: vec3<f32>,
    uv0: vec2<f32>,
    uv1: vec2<f32>,
    color: vec4<f32>,
    lifted: vec4<f32>,
}

fn to_local(point: ptr<function, Interaction>, w: vec3<f32>) -> vec3<f32> {
    return vec3(dot(w, (*point).s), dot(w, (*point).t), dot(w, (*point).n));
}

fn to_world(point: ptr<function, Interaction>, w: vec3<f32>) -> vec3<f32> {
    return (*point).s * w.x + (*point).t * w.y + (*point).n * w.z;
}

// Whether a direction is on the side of wo of the real surface.
fn is_reflection(point: ptr<function, Interaction>, wi: vec3<f32>) -> bool {
    return (dot(wi, (*point).ng) > 0.0) == (*point).is_in_front;
}

fn ray_origin(point: ptr<function, Interaction>, wi: vec3<f32>) -> vec3<f32> {
    let p = select((*point).p, (*point).p_outside, is_reflection(point, wi));
    return p + (*point).ng * with_sign((*point).clearance, dot(wi, (*point).ng));
}

// Makes the shading frame around ns, which may be on either side: turned to that of wo, and bent so that wo sees it.
fn set_frame(point: ptr<function, Interaction>, ns: vec3<f32>) {
    let upright = select(ns, -ns, dot(ns, (*point).ng) < 0.0);
    var n = select(-upright, upright, (*point).is_in_front);
    let cosine = dot(n, (*point).wo);
    if cosine < COSINE_MIN {
        n = normalize(n + (*point).wo * (COSINE_MIN - cosine));
    }
    set_basis(point, n);
}

fn set_basis(point: ptr<function, Interaction>, n: vec3<f32>) {
    let basis = basis_of(n);
    (*point).s = basis.s;
    (*point).t = basis.t;
    (*point).n = n;
}

// How far a point of a facet lies below the curved surface that its vertex normals tell of (Hanika 2021).
fn lift_off_facets(mesh: u32, corners: vec3<u32>, weights: vec3<f32>, is_in_front: bool) -> vec3<f32> {
    let positions = scene_words[mesh + POSITIONS];
    let normals = scene_words[mesh + NORMALS];
    let p0 = vec3_at(positions + 3u * corners.x);
    let p1 = vec3_at(positions + 3u * corners.y);
    let p2 = vec3_at(positions + 3u * corners.z);
    let p = p0 + (p1 - p0) * weights.y + (p2 - p0) * weights.z;
    let side = select(-1.0, 1.0, is_in_front);
    let n0 = vec3_at(normals + 3u * corners.x);
    let n1 = vec3_at(normals + 3u * corners.y);
    let n2 = vec3_at(normals + 3u * corners.z);
    return -side * (n0 * (weights.x * min(side * dot(p - p0, n0), 0.0))
        + n1 * (weights.y * min(side * dot(p - p1, n1), 0.0))
        + n2 * (weights.z * min(side * dot(p - p2, n2), 0.0)));
}

// Width of a beam in texture coordinates.
fn footprint_of(mesh: u32, corners: vec3<u32>, double_area: f32, width: f32, cosine: f32) -> f32 {
    let at = scene_words[mesh + UVS];
    if at == NONE || !(double_area > 0.0) {
        return 0.0;
    }
    let a = vec2_at(at + 2u * corners.x);
    let b = vec2_at(at + 2u * corners.y) - a;
    let c = vec2_at(at + 2u * corners.z) - a;
    return width * sqrt(abs(b.x * c.y - b.y * c.x) / (double_area * max(abs(cosine), 0.01)));
}

fn on_sphere(shape: Shape, origin: vec3<f32>, direction: vec3<f32>, t: f32, width: f32) -> Interaction {
    let sphere = sphere_at(shape.instance & ~SPHERE);
    let center = shape.p0;
    let radius = shape.p1.x;
    var point: Interaction;
    point.ng = direction_or(origin + t * direction - center, -direction);
    point.material = scene_words[sphere + 8u];
    point.flags = material_flags(point.material);
    point.p = center + radius * point.ng;
    point.p_outside = point.p;
    point.clearance = CLEARANCE * (math_max3(abs(center)) + radius);
    point.wo = -direction;
    point.is_in_front = dot(direction, point.ng) < 0.0;
    point.color = vec4<f32>(1.0);
    point.coat_normal = vec3(0.0, 0.0, 1.0);
    point.lifted = vec4(0.0, 0.0, 1.0, -1.0);
    if (point.flags & MATERIAL_TEXTURED) != 0u {
        point.uv0 = sphere_uv(sphere, point.ng);
        point.uv1 = point.uv0;
        // One turn of u around the equator.
        point.footprint = width / (2.0 * PI * radius);
    }
    if (point.flags & MATERIAL_NEEDS_TANGENTS) == 0u {
        set_frame(&point, point.ng);
    } else {
        set_textured_frame(&point, point.ng, sphere_sides(sphere, radius, point.ng));
    }
    return point;
}

fn on_triangle(shape: Shape, uv: vec2<f32>, direction: vec3<f32>, width: f32) -> Interaction {
    let instance = instance_at(shape.instance);
    let mesh = scene_words[instance + INSTANCE_MESH];
    let weights = weights_of(uv);
    let e1 = shape.p1 - shape.p0;
    let e2 = shape.p2 - shape.p0;
    let area_vector = cross(e1, e2);
    var point: Interaction;
    point.material = scene_words[mesh];
    point.flags = material_flags(point.material);
    point.p = shape.p0 + e1 * uv.x + e2 * uv.y;
    point.p_outside = point.p;
    point.ng = direction_or(area_vector, -direction);
    // Rounding errors of the hit and of the next test are relative to the size of the triangle and to the place.
    point.clearance = CLEARANCE * (math_max3(abs(point.p)) + 3.0 * max(math_max3(abs(e1)), math_max3(abs(e2))));
    point.wo = -direction;
    point.is_in_front = dot(direction, point.ng) < 0.0;
    let corners = corners_of(mesh, shape.primitive);
    point.color = color_of(mesh, corners, weights);
    point.coat_normal = vec3(0.0, 0.0, 1.0);
    point.lifted = vec4(0.0, 0.0, 1.0, -1.0);
    if (point.flags & MATERIAL_TEXTURED) != 0u {
        point.uv0 = uv_of_set(mesh, 0u, corners, weights, vec2<f32>(0.0));
        point.uv1 = uv_of_set(mesh, 1u, corners, weights, point.uv0);
        point.footprint = footprint_of(mesh, corners, length_of(area_vector), width, dot(direction, point.ng));
    }
    var ns = point.ng;
    let normals = scene_words[mesh + NORMALS];
    if normals != NONE {
        let smoothed = vec3_at(normals + 3u * corners.x) * weights.x + vec3_at(normals + 3u * corners.y) * weights.y
            + vec3_at(normals + 3u * corners.z) * weights.z;
        ns = direction_or(mat3_at(instance + WORLD_FROM_NORMAL) * smoothed, point.ng);
        if (point.flags & MATERIAL_TRANSMITS) == 0u {
            let lift = lift_off_facets(mesh, corners, weights, point.is_in_front);
            point.p_outside = point.p + mat3_at(instance) * lift;
        }
    }
    if (point.flags & MATERIAL_NEEDS_TANGENTS) == 0u {
        set_frame(&point, ns);
    } else {
        set_textured_frame(&point, ns, triangle_sides(mesh, corners, weights, e1, e2, mat3_at(instance)));
    }
    return point;
}

fn interaction_at(shape_index: u32, t: f32, uv: vec2<f32>, origin: vec3<f32>, direction: vec3<f32>, width: f32) -> Interaction {
    let shape = shapes[shape_index];
    if (shape.instance & SPHERE) != 0u {
        return on_sphere(shape, origin, direction, t, width);
    }
    return on_triangle(shape, uv, direction, width);
}
