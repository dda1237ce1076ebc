// Twin: `bottega-render/src/bsdf/coat.rs`.
//
// The clear coat of the layered material.

struct Coat {
    // Strength in [0, 1]; 0: no coat.
    weight: f32,
    // Perceptual roughness; α is its square.
    roughness: f32,
    // Normal in the local frame; +z is the base's normal.
    normal: vec3f,
}

fn coat_is_tilted(coat: Coat) -> bool {
    return any(coat.normal != vec3f(0.0, 0.0, 1.0));
}

fn coat_is_smooth(coat: Coat) -> bool {
    return coat.roughness * coat.roughness < GGX_SMOOTH_ALPHA;
}

// Transforms a direction to the coat's frame.
fn coat_in_coat(coat: Coat, w: vec3f) -> vec3f {
    if !coat_is_tilted(coat) {
        return w;
    }
    return w * frame_from_normal(coat.normal);
}

// Returns f and pdf of a rough coat; both directions above the surface.
fn coat_eval_pdf(coat: Coat, wo: vec3f, wi: vec3f) -> vec2f {
    let o = coat_in_coat(coat, wo);
    let i = coat_in_coat(coat, wi);
    let sum = o + i;
    if coat_is_smooth(coat) || o.z <= 0.0 || i.z <= 0.0 || dot(sum, sum) < 1e-30 {
        return vec2f(0.0);
    }
    let h = normalize(sum);
    let alpha = vec2f(coat.roughness * coat.roughness);
    let density = ggx_density(alpha, h);
    let facets = density * ggx_visibility(alpha, o, i) * coat_tilt(wo.z, o.z) * coat_tilt(wi.z, i.z);
    return vec2f(coat_reflectance(coat, dot(o, h)) * facets, 0.25 * density / ggx_visible_area(alpha, o));
}

// Returns the reflectance of a facet.
fn coat_reflectance(coat: Coat, cosine: f32) -> f32 {
    return coat.weight * fresnel_dielectric(cosine, COAT_IOR);
}

fn coat_sample(coat: Coat, wo: vec3f, u: vec2f) -> BsdfDrawn {
    let o = coat_in_coat(coat, wo);
    if o.z <= 0.0 {
        return BSDF_NONE;
    }
    let is_smooth = coat_is_smooth(coat);
    var h = vec3f(0.0, 0.0, 1.0);
    if !is_smooth {
        h = ggx_sample_visible_normal(vec2f(coat.roughness * coat.roughness), o, u);
    }
    let i = fresnel_reflect(o, h);
    var wi = i;
    if coat_is_tilted(coat) {
        wi = frame_from_normal(coat.normal) * i;
    }
    if i.z <= 0.0 || wi.z <= 0.0 {
        return BSDF_NONE;
    }
    if !is_smooth {
        return bsdf_spread(wi, BSDF_REFLECTION | BSDF_GLOSSY, 1.0);
    }
    // f |cos θi|; the f of a mirror contains the reciprocal of its own cosine.
    let weight = coat_reflectance(coat, o.z) * coat_tilt(wo.z, o.z) * coat_tilt(wi.z, i.z) * (wi.z / i.z);
    return bsdf_delta(wi, vec3f(weight), 1.0, BSDF_REFLECTION, 1.0);
}

// Returns the fraction of light along a direction, on either side, that the coat does not reflect.
fn coat_passed(coat: Coat, w: vec3f) -> f32 {
    let cosine = select(abs(w.z), dot(coat.normal, w) * math_sign(w.z), coat_is_tilted(coat));
    if !HAS_COAT || coat.weight <= 0.0 || cosine <= 0.0 {
        return 1.0;
    }
    let mu = tables_mu_new(cosine);
    let rough = tables_rough_at(sqrt(coat.roughness));
    let f0 = fresnel_at_normal_incidence(COAT_IOR);
    let rise = tables_by_index(TABLE_RISE, tables_index_new(COAT_IOR), rough, mu);
    return 1.0 - coat.weight * (f0 * tables_by_rough(TABLE_SINGLE, rough, mu) + (1.0 - f0) * rise);
}

fn coat_tilt(base: f32, coat: f32) -> f32 {
    return min(coat / base, 1.0);
}
