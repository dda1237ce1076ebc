// Twin: `bottega-render/src/interaction/mesh.rs`.
//
// Points on meshes: orientation of texture coordinates, and vertex normals.

// The orientation of one set of coordinates.
struct Side {
    tangent: vec4<f32>,
    along_u: vec3<f32>,
    along_v: vec3<f32>,
    tells: bool,
}

// Returns the distance from a facet up to the curved surface of its vertex normals (Hanika 2021).
fn lift_off_facets(mesh: u32, corners: vec3<u32>, weights: vec3<f32>, is_in_front: bool) -> vec3<f32> {
    let positions = scene_words[mesh + MESH_POSITIONS];
    let normals = scene_words[mesh + MESH_NORMALS];
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

// Returns the width of a ray cone in texture coordinates.
fn mesh_footprint(mesh: u32, corners: vec3<u32>, double_area: f32, width: f32, cosine: f32) -> f32 {
    let at = scene_words[mesh + MESH_UVS];
    if at == NONE || !(double_area > 0.0) {
        return 0.0;
    }
    let a = vec2_at(at + 2u * corners.x);
    let b = vec2_at(at + 2u * corners.y) - a;
    let c = vec2_at(at + 2u * corners.z) - a;
    return width * sqrt(abs(b.x * c.y - b.y * c.x) / (double_area * max(abs(cosine), 0.01)));
}

fn sphere_sides(sphere: u32, radius: f32, ng: vec3<f32>) -> Sides {
    let turn = vec4_at(sphere + SPHERE_WORLD_FROM_OBJECT);
    let pole = turned(turn, vec3(0.0, 1.0, 0.0));
    let equator = turned(turn, vec3(1.0, 0.0, 0.0));
    let along = cross(pole, ng);
    var sides: Sides;
    sides.tangent0 = vec4(direction_or(along, equator), 1.0);
    sides.tangent1 = sides.tangent0;
    // u goes once around the axis, v from pole to pole; at the poles u has no direction.
    let sine = length(along);
    sides.tells0 = sine > 1e-6;
    sides.tells1 = sides.tells0;
    sides.along_u0 = along * (2.0 * PI * radius);
    sides.along_v0 = (ng * dot(pole, ng) - pole) * (PI * radius / max(sine, 1e-6));
    sides.along_u1 = sides.along_u0;
    sides.along_v1 = sides.along_v0;
    return sides;
}

fn triangle_side(mesh: u32, uv_set: u32, corners: vec3<u32>, e1: vec3<f32>, e2: vec3<f32>) -> Side {
    let at = scene_words[mesh + MESH_UVS + uv_set];
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
    let tangents = scene_words[mesh + MESH_TANGENTS];
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
