// Twin: `bottega-render/src/bsdf/surface.rs`.
//
// The BSDF of a material at one point.

alias SurfaceParams = array<vec3f, SURFACE_PARAMS_MAX>;

// The properties of a surface point that material lookups need.
struct SurfacePoint {
    uv0: vec2f,
    uv1: vec2f,
    // Width of texture lookups in texture coordinates; 0: unfiltered.
    footprint: f32,
    // 1: wo is on the front side.
    front: u32,
    vertex_color: vec4f,
    // A uniform number that selects between blended surfaces.
    chance: f32,
    // The coat's normal in the local frame, above the surface; +z is the base's.
    coat_normal: vec3f,
    // The relief's normal, see `lifted_new`; w below 0: none.
    lifted: vec4f,
}

fn surface_point_plain(front: u32) -> SurfacePoint {
    return SurfacePoint(vec2f(0.0), vec2f(0.0), 0.0, front, vec4f(1.0), 0.0, vec3f(0.0, 0.0, 1.0), vec4f(0.0, 0.0, 1.0, -1.0));
}

fn surface_share(color: vec3f) -> vec3f {
    return clamp(color, vec3f(0.0), vec3f(1.0));
}

// Returns the BSDF of a material at a point, seen from `wo` by a path with throughput `carried`.
fn surface_scattering(material: u32, given: SurfacePoint, wo: vec3f, carried: vec3f) -> Bsdf {
    var point = given;
    var record = material_surface_of(material, point.front != 0u);
    var p: SurfaceParams;
    var kind = SURFACE_BLACK;
    for (var depth = 0u; depth < SURFACE_DEPTH_MAX; depth++) {
        if record == 0u || wo.z <= 0.0 {
            kind = SURFACE_BLACK;
            break;
        }
        kind = material_words[record + SURFACE_KIND] & SURFACE_KIND_MASK;
        let count = min(material_words[record + SURFACE_KIND] >> SURFACE_COUNT_SHIFT, SURFACE_PARAMS_MAX);
        // Look up all textures in one place: the code is long.
        for (var i = 0u; i < count; i++) {
            p[i] = color_param_eval(record + SURFACE_PARAMS + PARAM_WORDS * i, point.uv0, point.uv1, point.footprint);
        }
        if kind != SURFACE_BLEND {
            break;
        }
        let weight = clamp(p[BLEND_PARAM_WEIGHT].x, 0.0, 1.0);
        let is_second = point.chance < weight;
        point.chance = warp_rest(point.chance, weight);
        record = material_words[record + select(BLEND_FIRST, BLEND_SECOND, is_second)];
    }
    var b = surface_of_surface(kind, record, &point, &p, wo, carried);
    b.lifted = point.lifted;
    return b;
}

// One line per case: a line of a feature that the scene does not use is removed.
fn surface_of_surface(
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

// A matte base below a layer that only absorbs has a closed form; all other coats need random walks.
fn surface_is_stack(record: u32, p: ptr<function, SurfaceParams>) -> bool {
    return material_words[record + COATED_COVER] == 0u || math_max3(surface_share((*p)[COATED_PARAM_ALBEDO])) > 0.0;
}

fn surface_unit(x: f32) -> f32 {
    return clamp(x, 0.0, 1.0);
}
