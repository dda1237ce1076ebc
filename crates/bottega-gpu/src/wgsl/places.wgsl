// No twin.
//
// Surface points, as far as textures and emission need them.

// A surface point, as far as textures need it.
struct SurfacePlace {
    material: u32,
    uv0: vec2<f32>,
    uv1: vec2<f32>,
    vertex_alpha: f32,
}

fn instance_at(instance: u32) -> u32 {
    return scene_words[HEADER_INSTANCES] + instance * INSTANCE_WORDS;
}

fn sphere_at(sphere: u32) -> u32 {
    return scene_words[HEADER_SPHERES] + sphere * SPHERE_WORDS;
}

// Rotates a vector by a unit quaternion, or back by its conjugate.
fn turned(q: vec4<f32>, v: vec3<f32>) -> vec3<f32> {
    let t = 2.0 * cross(q.xyz, v);
    return v + q.w * t + cross(q.xyz, t);
}

fn conjugate(q: vec4<f32>) -> vec4<f32> {
    return vec4(-q.xyz, q.w);
}

// Returns texture coordinates on a sphere: u around +y, v from the upper pole down.
fn sphere_uv(sphere: u32, normal: vec3<f32>) -> vec2<f32> {
    let n = turned(conjugate(vec4_at(sphere + SPHERE_WORLD_FROM_OBJECT)), normal);
    return vec2(0.5 + atan2_of(n.x, n.z) / (2.0 * PI), acos_of(n.y) / PI);
}

// Returns barycentric weights.
fn weights_of(uv: vec2<f32>) -> vec3<f32> {
    return vec3(1.0 - uv.x - uv.y, uv);
}

fn uv_of_set(mesh: u32, uv_set: u32, corners: vec3<u32>, weights: vec3<f32>, otherwise: vec2<f32>) -> vec2<f32> {
    let at = scene_words[mesh + MESH_UVS + uv_set];
    if at == NONE {
        return otherwise;
    }
    return vec2_at(at + 2u * corners.x) * weights.x + vec2_at(at + 2u * corners.y) * weights.y
        + vec2_at(at + 2u * corners.z) * weights.z;
}

fn corners_of(mesh: u32, primitive: u32) -> vec3<u32> {
    let at = scene_words[mesh + MESH_TRIANGLES];
    if at == NONE {
        return vec3(0u);
    }
    return triple_at(at + 3u * primitive);
}

// Returns the vertex color at a point of a triangle.
fn color_of(mesh: u32, corners: vec3<u32>, weights: vec3<f32>) -> vec4<f32> {
    let at = scene_words[mesh + MESH_COLORS];
    if at == NONE {
        return vec4<f32>(1.0);
    }
    return vec4_at(at + 4u * corners.x) * weights.x + vec4_at(at + 4u * corners.y) * weights.y
        + vec4_at(at + 4u * corners.z) * weights.z;
}

fn place_of(instance: u32, primitive: u32, uv: vec2<f32>) -> SurfacePlace {
    let mesh = scene_words[instance_at(instance) + INSTANCE_MESH];
    let corners = corners_of(mesh, primitive);
    let weights = weights_of(uv);
    let uv0 = uv_of_set(mesh, 0u, corners, weights, vec2<f32>(0.0));
    let uv1 = uv_of_set(mesh, 1u, corners, weights, uv0);
    return SurfacePlace(scene_words[mesh + MESH_MATERIAL], uv0, uv1, color_of(mesh, corners, weights).w);
}

// Returns the emitted radiance at a point of a triangle.
fn emitted(place: SurfacePlace) -> vec3<f32> {
    return material_emission(place.material, place.uv0, place.uv1, 0.0);
}

// Returns the opacity at a point.
fn opacity(place: SurfacePlace) -> f32 {
    return material_opacity_at(place.material, place.uv0, place.uv1, 0.0, place.vertex_alpha);
}
