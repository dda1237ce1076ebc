// Twin: `bottega-render/src/interaction.rs`.
//
// Surface interactions: from the hit to the shading frame.

struct Interaction {
    p: vec3<f32>,
    clearance: f32,
    // Origin of rays that stay on the side of wo.
    p_outside: vec3<f32>,
    footprint: f32,
    // Geometric normal, pointing to the front side.
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

// The orientation of both sets of texture coordinates on the surface.
struct Sides {
    // Tangents along increasing u, with the signs of their bitangents.
    tangent0: vec4<f32>,
    tangent1: vec4<f32>,
    // Derivatives of the point along u and v; undefined if the set has no `tells`.
    along_u0: vec3<f32>,
    along_v0: vec3<f32>,
    along_u1: vec3<f32>,
    along_v1: vec3<f32>,
    tells0: bool,
    tells1: bool,
}

fn interaction_new(shape_index: u32, t: f32, uv: vec2<f32>, origin: vec3<f32>, direction: vec3<f32>, width: f32) -> Interaction {
    let shape = shapes[shape_index];
    if (shape.instance & HIT_SPHERE) != 0u {
        return on_sphere(shape, origin, direction, t, width);
    }
    return on_triangle(shape, uv, direction, width);
}

// Returns the normal of a normal map.
fn mapped_normal(
    point: ptr<function, Interaction>,
    map: u32,
    scale: f32,
    footprint: f32,
    ns: vec3<f32>,
    sides: ptr<function, Sides>,
) -> vec3<f32> {
    let is_second = lookup_uv_set(map) == 1u;
    let uv = select((*point).uv0, (*point).uv1, is_second);
    return relief_mapped_normal(map, scale, uv, footprint, ns, select((*sides).tangent0, (*sides).tangent1, is_second));
}

fn normal_of_relief(
    point: ptr<function, Interaction>,
    relief: MaterialRelief,
    footprint: f32,
    ns: vec3<f32>,
    sides: ptr<function, Sides>,
) -> vec3<f32> {
    if relief.kind == RELIEF_NORMALS {
        return mapped_normal(point, relief.map, relief.scale, footprint, ns, sides);
    }
    let is_second = lookup_uv_set(relief.map) == 1u;
    if relief.kind != RELIEF_HEIGHTS || !select((*sides).tells0, (*sides).tells1, is_second) {
        return ns;
    }
    let uv = select((*point).uv0, (*point).uv1, is_second);
    let along_u = select((*sides).along_u0, (*sides).along_u1, is_second);
    let along_v = select((*sides).along_v0, (*sides).along_v1, is_second);
    return relief_bumped_normal(relief.map, relief.scale, uv, footprint, ns, along_u, along_v);
}

fn on_sphere(shape: Shape, origin: vec3<f32>, direction: vec3<f32>, t: f32, width: f32) -> Interaction {
    let sphere = sphere_at(shape.instance & ~HIT_SPHERE);
    let center = shape.p0;
    let radius = shape.p1.x;
    var point: Interaction;
    point.ng = direction_or(origin + t * direction - center, -direction);
    point.material = scene_words[sphere + SPHERE_MATERIAL];
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
        // u goes once around the equator.
        point.footprint = width / (2.0 * PI * radius);
    }
    if (point.flags & MATERIAL_NEEDS_TANGENTS) == 0u {
        set_frame(&point, point.ng);
    } else {
        set_frames(&point, point.ng, sphere_sides(sphere, radius, point.ng));
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
    point.material = scene_words[mesh + MESH_MATERIAL];
    point.flags = material_flags(point.material);
    point.p = shape.p0 + e1 * uv.x + e2 * uv.y;
    point.p_outside = point.p;
    point.ng = direction_or(area_vector, -direction);
    // Rounding errors of this hit and of the next test scale with the triangle's size and position.
    let extent = 3.0 * max(math_max3(abs(e1)), math_max3(abs(e2)));
    point.clearance = CLEARANCE * math_max3(abs(point.p)) + EXTENT_CLEARANCE * extent;
    point.wo = -direction;
    point.is_in_front = dot(direction, point.ng) < 0.0;
    let corners = corners_of(mesh, shape.primitive);
    point.color = color_of(mesh, corners, weights);
    point.coat_normal = vec3(0.0, 0.0, 1.0);
    point.lifted = vec4(0.0, 0.0, 1.0, -1.0);
    if (point.flags & MATERIAL_TEXTURED) != 0u {
        point.uv0 = uv_of_set(mesh, 0u, corners, weights, vec2<f32>(0.0));
        point.uv1 = uv_of_set(mesh, 1u, corners, weights, point.uv0);
        point.footprint = mesh_footprint(mesh, corners, length_of(area_vector), width, dot(direction, point.ng));
    }
    var ns = point.ng;
    let normals = scene_words[mesh + MESH_NORMALS];
    if normals != NONE {
        let smoothed = vec3_at(normals + 3u * corners.x) * weights.x + vec3_at(normals + 3u * corners.y) * weights.y
            + vec3_at(normals + 3u * corners.z) * weights.z;
        ns = direction_or(mat3_at(instance + INSTANCE_WORLD_FROM_NORMAL) * smoothed, point.ng);
        if (point.flags & MATERIAL_TRANSMITS) == 0u {
            let lift = lift_off_facets(mesh, corners, weights, point.is_in_front);
            point.p_outside = point.p + mat3_at(instance + INSTANCE_WORLD_FROM_OBJECT) * lift;
        }
    }
    if (point.flags & MATERIAL_NEEDS_TANGENTS) == 0u {
        set_frame(&point, ns);
    } else {
        set_frames(&point, ns, triangle_sides(mesh, corners, weights, e1, e2, mat3_at(instance + INSTANCE_WORLD_FROM_OBJECT)));
    }
    return point;
}

// Computes the shading frame of a material that depends on the orientation of texture coordinates.
fn set_frames(point: ptr<function, Interaction>, ns: vec3<f32>, all_sides: Sides) {
    var sides = all_sides;
    let flags = (*point).flags;
    let relief = material_relief((*point).material);
    var without = vec3<f32>(0.0);
    if relief.kind == RELIEF_NONE {
        set_frame(point, ns);
    } else if relief.mitsuba {
        // Mitsuba does not filter textures, and a relief is far from linear in them.
        without = set_lifted_frame(point, relief, ns, normal_of_relief(point, relief, 0.0, ns, &sides));
    } else {
        set_frame(point, normal_of_relief(point, relief, (*point).footprint, ns, &sides));
    }
    let tangent = sides.tangent0;
    var along = tangent.xyz;
    if (flags & MATERIAL_HAS_ANISOTROPY) != 0u {
        along = direction_or(tangent.xyz - ns * dot(ns, tangent.xyz), vec3<f32>(0.0));
        let way = material_anisotropy_way((*point).material, (*point).uv0, (*point).uv1, (*point).footprint);
        along = along * way.x + cross(ns, along) * (tangent.w * way.y);
    }
    turn_frame(point, along);
    if (flags & MATERIAL_HAS_COAT) != 0u {
        // The base's normal map does not apply to the coat.
        let map = material_coat_map((*point).material);
        var coat = ns;
        if map != 0u {
            let scale = material_coat_scale((*point).material);
            coat = mapped_normal(point, map, scale, (*point).footprint, ns, &sides);
        }
        (*point).coat_normal = to_local(point, select(coat, -coat, dot(coat, (*point).wo) < 0.0));
    }
    if relief.kind != RELIEF_NONE && relief.mitsuba {
        (*point).lifted = lifted_new(to_local(point, without), relief.shadows);
    }
}

// Computes the frame around a normal tilted from ns by Mitsuba's rule. Returns the normal without relief on the side of wo.
fn set_lifted_frame(
    point: ptr<function, Interaction>,
    relief: MaterialRelief,
    ns: vec3<f32>,
    normal: vec3<f32>,
) -> vec3<f32> {
    set_frame(point, ns);
    let without = (*point).n;
    let is_turned = (dot(ns, (*point).ng) < 0.0) == (*point).is_in_front;
    var n = select(normal, -normal, is_turned);
    if relief.mirrored && !(*point).is_in_front {
        n = without * (2.0 * dot(n, without)) - n;
    }
    if relief.turns && dot(n, (*point).wo) <= 0.0 {
        n = without * (2.0 * dot(n, without)) - n;
    }
    set_basis(point, n);
    return without;
}

// Rotates the frame about its normal until s is as close to the tangent as possible.
fn turn_frame(point: ptr<function, Interaction>, tangent: vec3<f32>) {
    let n = (*point).n;
    let s = direction_or(tangent - n * dot(n, tangent), vec3<f32>(0.0));
    if !is_black(s) {
        (*point).s = s;
        (*point).t = cross(n, s);
    }
}

// Computes the shading frame around ns, on either side: flips it to the side of wo, and bends it until wo sees it.
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
    let basis = orthonormal_basis(n);
    (*point).s = basis.s;
    (*point).t = basis.t;
    (*point).n = n;
}

fn to_local(point: ptr<function, Interaction>, w: vec3<f32>) -> vec3<f32> {
    return vec3(dot(w, (*point).s), dot(w, (*point).t), dot(w, (*point).n));
}

fn to_world(point: ptr<function, Interaction>, w: vec3<f32>) -> vec3<f32> {
    return (*point).s * w.x + (*point).t * w.y + (*point).n * w.z;
}

// Checks that a direction is on the side of wo of the geometric surface.
fn is_reflection(point: ptr<function, Interaction>, wi: vec3<f32>) -> bool {
    return (dot(wi, (*point).ng) > 0.0) == (*point).is_in_front;
}

fn ray_origin(point: ptr<function, Interaction>, wi: vec3<f32>) -> vec3<f32> {
    let p = select((*point).p, (*point).p_outside, is_reflection(point, wi));
    return p + (*point).ng * with_sign((*point).clearance, dot(wi, (*point).ng));
}
