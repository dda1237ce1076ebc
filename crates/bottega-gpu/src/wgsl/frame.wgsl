// Frames along the texture, and maps of normals and of heights (`bottega_render::interaction::relief`).

// How texture coordinates lie on a surface, for both sets of them.
struct Sides {
    // Tangents of increasing u, and the signs of their bitangents.
    tangent0: vec4<f32>,
    tangent1: vec4<f32>,
    // How the point moves with u and with v; not to be asked where they do not tell.
    along_u0: vec3<f32>,
    along_v0: vec3<f32>,
    along_u1: vec3<f32>,
    along_v1: vec3<f32>,
    tells0: bool,
    tells1: bool,
}

fn sphere_sides(sphere: u32, radius: f32, ng: vec3<f32>) -> Sides {
    let turn = vec4_at(sphere + 4u);
    let pole = turned(turn, vec3(0.0, 1.0, 0.0));
    let equator = turned(turn, vec3(1.0, 0.0, 0.0));
    let along = cross(pole, ng);
    var sides: Sides;
    sides.tangent0 = vec4(direction_or(along, equator), 1.0);
    sides.tangent1 = sides.tangent0;
    // u goes once around the axis, v from pole to pole; at these nothing goes along u.
    let sine = length(along);
    sides.tells0 = sine > 1e-6;
    sides.tells1 = sides.tells0;
    sides.along_u0 = along * (2.0 * PI * radius);
    sides.along_v0 = (ng * dot(pole, ng) - pole) * (PI * radius / max(sine, 1e-6));
    sides.along_u1 = sides.along_u0;
    sides.along_v1 = sides.along_v0;
    return sides;
}

// Of one set of coordinates.
struct Side {
    tangent: vec4<f32>,
    along_u: vec3<f32>,
    along_v: vec3<f32>,
    tells: bool,
}

fn triangle_side(mesh: u32, uv_set: u32, corners: vec3<u32>, e1: vec3<f32>, e2: vec3<f32>) -> Side {
    let at = scene_words[mesh + UVS + uv_set];
    if at == NONE {
        return Side(vec4(e1, 1.0), vec3<f32>(0.0), vec3<f32>(0.0), false);
    }
    let a = vec2_at(at + 2u * corners.x);
    let d1 = vec2_at(at + 2u * corners.y) - a;
    let d2 = vec2_at(at + 2u * corners.z) - a;
    let determinant = d1.x * d2.y - d1.y * d2.x;
    let side = select(1.0, -1.0, determinant < 0.0);
    let size = abs(determinant);
    let tells = size > 1e-30;
    let inverse = side / max(size, 1e-30);
    let along_u = e1 * d2.y - e2 * d1.y;
    let along_v = e2 * d1.x - e1 * d2.x;
    return Side(vec4(along_u * side, -side), along_u * inverse, along_v * inverse, tells);
}

fn triangle_sides(
    mesh: u32,
    corners: vec3<u32>,
    weights: vec3<f32>,
    e1: vec3<f32>,
    e2: vec3<f32>,
    world_from_object: mat3x3<f32>,
) -> Sides {
    let first = triangle_side(mesh, 0u, corners, e1, e2);
    let second = triangle_side(mesh, 1u, corners, e1, e2);
    var sides = Sides(first.tangent, second.tangent, first.along_u, first.along_v, second.along_u, second.along_v,
        first.tells, second.tells);
    let tangents = scene_words[mesh + TANGENTS];
    if tangents != NONE {
        let a = vec4_at(tangents + 4u * corners.x);
        let b = vec4_at(tangents + 4u * corners.y);
        let c = vec4_at(tangents + 4u * corners.z);
        let along = world_from_object * (a.xyz * weights.x + b.xyz * weights.y + c.xyz * weights.z);
        sides.tangent0 = vec4(along, a.w);
        sides.tangent1 = sides.tangent0;
    }
    return sides;
}

// The normal that a normal map tells of.
fn mapped_normal(
    point: ptr<function, Interaction>,
    map: u32,
    scale: f32,
    footprint: f32,
    ns: vec3<f32>,
    sides: ptr<function, Sides>,
) -> vec3<f32> {
    let is_second = texture_uv_set(map) == 1u;
    let uv = select((*point).uv0, (*point).uv1, is_second);
    return relief_mapped(map, scale, uv, footprint, ns, select((*sides).tangent0, (*sides).tangent1, is_second));
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
    let is_second = texture_uv_set(relief.map) == 1u;
    if relief.kind != RELIEF_HEIGHTS || !select((*sides).tells0, (*sides).tells1, is_second) {
        return ns;
    }
    let uv = select((*point).uv0, (*point).uv1, is_second);
    let along_u = select((*sides).along_u0, (*sides).along_u1, is_second);
    let along_v = select((*sides).along_v0, (*sides).along_v1, is_second);
    return relief_bumped(relief.map, relief.scale, uv, footprint, ns, along_u, along_v);
}

// Makes the frame around a normal lifted off ns, by Mitsuba's rule. Returns the normal without relief on the side of wo.
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

// Turns the frame about its normal until s is as near to a tangent as it can be.
fn turn_frame(point: ptr<function, Interaction>, tangent: vec3<f32>) {
    let n = (*point).n;
    let s = direction_or(tangent - n * dot(n, tangent), vec3<f32>(0.0));
    if !is_black(s) {
        (*point).s = s;
        (*point).t = cross(n, s);
    }
}

// Makes the shading frame of a material that depends on the directions of the texture coordinates.
fn set_textured_frame(point: ptr<function, Interaction>, ns: vec3<f32>, all_sides: Sides) {
    var sides = all_sides;
    let flags = (*point).flags;
    let relief = material_relief((*point).material);
    var without = vec3<f32>(0.0);
    if relief.kind == RELIEF_NONE {
        set_frame(point, ns);
    } else if relief.mitsuba {
        // Mitsuba filters no textures, and what a relief does is far from linear in what it is.
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
        // The base's normal map is not the coat's.
        let map = material_coat_map((*point).material);
        var coat = ns;
        if map != 0u {
            let scale = material_coat_scale((*point).material);
            coat = mapped_normal(point, map, scale, (*point).footprint, ns, &sides);
        }
        (*point).coat_normal = to_local(point, select(coat, -coat, dot(coat, (*point).wo) < 0.0));
    }
    if relief.kind != RELIEF_NONE && relief.mitsuba {
        (*point).lifted = relief_lifted(to_local(point, without), relief.shadows);
    }
}
