// From a material to the scattering at one point of it. See `bsdf/surface.rs`.

const SURFACE_BLACK: u32 = 0u;
const SURFACE_DIFFUSE: u32 = 1u;
const SURFACE_TRANSLUCENT: u32 = 2u;
const SURFACE_CONDUCTOR: u32 = 3u;
const SURFACE_DIELECTRIC: u32 = 4u;
const SURFACE_PLASTIC: u32 = 5u;
const SURFACE_COATED: u32 = 6u;
const SURFACE_PRINCIPLED: u32 = 7u;
const SURFACE_LAYERED: u32 = 8u;
const SURFACE_BLEND: u32 = 9u;

// A record: its kind with the number of its parameters, seven words of the kind's own, then the parameters.
const SURFACE_PARAMS: u32 = 8u;
const SURFACE_PARAMS_MAX: u32 = 16u;
alias SurfaceParams = array<vec3f, SURFACE_PARAMS_MAX>;
// Records on the way through 64 blends within each other.
const SURFACE_DEPTH_MAX: u32 = 65u;

// What the lookup of a material needs to know of a point on a surface.
struct SurfacePoint {
    uv0: vec2f,
    uv1: vec2f,
    // Width of texture lookups in texture coordinates, 0 for sharp ones.
    footprint: f32,
    // Whether wo is on the front side.
    front: u32,
    vertex_color: vec4f,
    // A number in [0, 1) that chooses between blended surfaces.
    chance: f32,
    // Normal of the coat in the local frame, above the surface; +z: that of the base.
    coat_normal: vec3f,
    // See `relief_lifted`; w below 0: none.
    lifted: vec4f,
}

fn surface_point_plain(front: u32) -> SurfacePoint {
    return SurfacePoint(vec2f(0.0), vec2f(0.0), 0.0, front, vec4f(1.0), 0.0, vec3f(0.0, 0.0, 1.0), vec4f(0.0, 0.0, 1.0, -1.0));
}

fn surface_share(color: vec3f) -> vec3f {
    return clamp(color, vec3f(0.0), vec3f(1.0));
}

// The scattering of a material at a point, seen from `wo` by a path that carries `carried`.
fn bsdf_at(material: u32, given: SurfacePoint, wo: vec3f, carried: vec3f) -> Bsdf {
    var point = given;
    var record = material_surface(material, point.front != 0u);
    var p: SurfaceParams;
    var kind = SURFACE_BLACK;
    for (var depth = 0u; depth < SURFACE_DEPTH_MAX; depth++) {
        if record == 0u || wo.z <= 0.0 {
            kind = SURFACE_BLACK;
            break;
        }
        kind = material_words[record] & 0xffu;
        let count = min(material_words[record] >> 8u, SURFACE_PARAMS_MAX);
        // The one place where textures are looked up: it is long.
        for (var i = 0u; i < count; i++) {
            p[i] = param_value(record + SURFACE_PARAMS + 4u * i, point.uv0, point.uv1, point.footprint);
        }
        if kind != SURFACE_BLEND {
            break;
        }
        let weight = clamp(p[0].x, 0.0, 1.0);
        let is_second = point.chance < weight;
        point.chance = warp_rest(point.chance, weight);
        record = material_words[record + select(1u, 2u, is_second)];
    }
    var b = surface_bsdf(kind, record, &point, &p, wo, carried);
    b.lifted = point.lifted;
    return b;
}

// Cases stand in a line each: what a scene does not use is left out with its line.
fn surface_bsdf(
    kind: u32, record: u32, point: ptr<function, SurfacePoint>, p: ptr<function, SurfaceParams>, wo: vec3f, carried: vec3f,
) -> Bsdf {
    switch kind {
        case SURFACE_DIFFUSE: { return matte_surface(point, p, wo); }
        case SURFACE_TRANSLUCENT: { return translucent_surface(point, p, wo); }
        case SURFACE_CONDUCTOR: { if HAS_CONDUCTOR { return conductor_surface(record, p, wo); } }
        case SURFACE_DIELECTRIC: { if HAS_DIELECTRIC { return dielectric_surface(record, point, p, wo); } }
        case SURFACE_PLASTIC: { if HAS_PLASTIC { return plastic_surface(record, point, p, wo); } }
        case SURFACE_COATED: {
            if HAS_STACK { if surface_is_stack(record, p) { return stack_surface(record, point, p, wo); } }
            if HAS_PLASTIC { return plastic_coat_surface(record, point, p, wo); }
        }
        case SURFACE_PRINCIPLED: { if HAS_PRINCIPLED { return principled_surface(record, point, p, wo); } }
        case SURFACE_LAYERED: { if HAS_LAYERED { return layered_surface(record, point, p, wo, carried); } }
        default: {}
    }
    return bsdf_black(wo);
}

// A matte base below a layer that only absorbs has a closed form; all other coats are walked through.
fn surface_is_stack(record: u32, p: ptr<function, SurfaceParams>) -> bool {
    return material_words[record + 4u] == 0u || math_max3(surface_share((*p)[0])) > 0.0;
}

fn surface_unit(x: f32) -> f32 {
    return clamp(x, 0.0, 1.0);
}
