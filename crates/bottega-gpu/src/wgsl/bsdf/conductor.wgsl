// Twin: `bottega-render/src/bsdf/conductor.rs`.
//
// Rough and smooth metals.

struct Conductor {
    // Complex index of refraction; both 0: a perfect mirror.
    eta: vec3f,
    k: vec3f,
    tint: vec3f,
    facets: Microfacets,
}

// d[0]: η, α of x; d[1]: k, α of y; d[2]: tint, bits of the facets.
fn conductor_new(wo: vec3f, metal: Conductor) -> Bsdf {
    var b = bsdf_black(wo);
    if math_max3(metal.tint) <= 0.0 {
        return b;
    }
    b.kind = BSDF_KIND_CONDUCTOR;
    b.lobes = select(BSDF_HAS_NON_DELTA, 0u, microfacets_is_smooth(metal.facets));
    b.roughness = microfacets_roughness(metal.facets);
    b.albedo = conductor_reflectance(metal, wo.z) * microfacets_masking(metal.facets, wo);
    b.d[0] = vec4f(metal.eta, metal.facets.alpha.x);
    b.d[1] = vec4f(metal.k, metal.facets.alpha.y);
    b.d[2] = vec4f(metal.tint, f32(metal.facets.bits));
    return b;
}

fn conductor_from(b: ptr<function, Bsdf>) -> Conductor {
    let facets = Microfacets(vec2f((*b).d[0].w, (*b).d[1].w), u32((*b).d[2].w));
    return Conductor((*b).d[0].xyz, (*b).d[1].xyz, (*b).d[2].xyz, facets);
}

fn conductor_reflectance(metal: Conductor, cosine: f32) -> vec3f {
    if max(math_max3(metal.eta), math_max3(metal.k)) == 0.0 {
        return metal.tint;
    }
    return metal.tint * fresnel_conductor(cosine, metal.eta, metal.k);
}

fn conductor_eval_pdf(b: ptr<function, Bsdf>, wi: vec3f) -> BsdfValue {
    let metal = conductor_from(b);
    if wi.z <= 0.0 {
        return BsdfValue(vec3f(0.0), 0.0);
    }
    let bounce = microfacets_bounce(metal.facets, (*b).wo, wi, 1.0);
    return BsdfValue(conductor_reflectance(metal, bounce.cosine) * bounce.value, bounce.pdf);
}

fn conductor_sample(b: ptr<function, Bsdf>, u: vec3f) -> BsdfDrawn {
    let metal = conductor_from(b);
    let wo = (*b).wo;
    if microfacets_is_smooth(metal.facets) {
        return bsdf_delta(vec3f(-wo.xy, wo.z), conductor_reflectance(metal, wo.z), 1.0, BSDF_REFLECTION, 1.0);
    }
    let wi = fresnel_reflect(wo, microfacets_sample_visible_normal(metal.facets, wo, u.yz));
    return bsdf_spread(wi, BSDF_REFLECTION | BSDF_GLOSSY, 1.0);
}

// `first`: the first of its parameters; `outside`: index of refraction of the surrounding medium.
fn conductor_param(p: ptr<function, SurfaceParams>, first: u32, bits: u32, outside: f32) -> Conductor {
    let eta = clamp((*p)[first + CONDUCTOR_PARAM_ETA] / outside, vec3f(0.0), vec3f(1e3));
    let k = clamp((*p)[first + CONDUCTOR_PARAM_K] / outside, vec3f(0.0), vec3f(1e3));
    let roughness = vec2f((*p)[first + CONDUCTOR_PARAM_ROUGHNESS_X].x, (*p)[first + CONDUCTOR_PARAM_ROUGHNESS_Y].x);
    let facets = microfacets_new(bits, roughness);
    return Conductor(eta, k, surface_share((*p)[first + CONDUCTOR_PARAM_REFLECTANCE]), facets);
}

fn conductor_surface(record: u32, p: ptr<function, SurfaceParams>, wo: vec3f) -> Bsdf {
    return conductor_new(wo, conductor_param(p, 0u, material_words[record + CONDUCTOR_FACETS], 1.0));
}
