// Twin: `bottega-render/src/bsdf/dielectric.rs`.
//
// Clear solids and thin sheets.

struct Dielectric {
    // Index of refraction beyond the boundary (of a sheet: inside it), relative to the side of wo.
    eta: f32,
    reflectance: vec3f,
    transmittance: vec3f,
    facets: Microfacets,
    thin: bool,
}

// Reflectance and transmittance of a facet, and the probability of sampling reflection.
struct DielectricSplit {
    reflected: vec3f,
    transmitted: vec3f,
    chance: f32,
}

// d[0]: reflectance, α of x; d[1]: transmittance, α of y; d[2]: η, bits of the facets, 1 for a sheet.
fn dielectric_new(wo: vec3f, given: Dielectric) -> Bsdf {
    var b = bsdf_black(wo);
    var glass = given;
    if max(math_max3(glass.reflectance), math_max3(glass.transmittance)) <= 0.0 {
        return b;
    }
    // With so small a refraction, a rough boundary counts as smooth.
    if abs(glass.eta - 1.0) < DIELECTRIC_ETA_STEP_MIN && !glass.thin {
        glass.facets = Microfacets(vec2f(0.0), 0u);
    }
    let seen = dielectric_split(glass, wo.z);
    b.kind = BSDF_KIND_DIELECTRIC;
    b.lobes = select(BSDF_HAS_NON_DELTA, 0u, microfacets_is_smooth(glass.facets))
        | select(0u, BSDF_IS_TRANSMISSIVE, math_max3(glass.transmittance) > 0.0);
    b.roughness = microfacets_roughness(glass.facets);
    b.albedo = seen.reflected + seen.transmitted;
    b.d[0] = vec4f(glass.reflectance, glass.facets.alpha.x);
    b.d[1] = vec4f(glass.transmittance, glass.facets.alpha.y);
    b.d[2] = vec4f(glass.eta, f32(glass.facets.bits), select(0.0, 1.0, glass.thin), 0.0);
    return b;
}

fn dielectric_from(b: ptr<function, Bsdf>) -> Dielectric {
    let facets = Microfacets(vec2f((*b).d[0].w, (*b).d[1].w), u32((*b).d[2].y));
    return Dielectric((*b).d[2].x, (*b).d[0].xyz, (*b).d[1].xyz, facets, (*b).d[2].z != 0.0);
}

fn dielectric_split(glass: Dielectric, cosine: f32) -> DielectricSplit {
    let single = fresnel_dielectric(cosine, glass.eta);
    // Reflectance of two boundaries with all interreflections: R + T² R / (1 − R²), T = 1 − R.
    let share = select(single, 2.0 * single / (1.0 + single), glass.thin);
    let reflected = glass.reflectance * share;
    let transmitted = glass.transmittance * (1.0 - share);
    let r = math_mean(reflected);
    let sum = r + math_mean(transmitted);
    var chance = 1.0;
    if sum > 0.0 {
        chance = r / sum;
    }
    return DielectricSplit(reflected, transmitted, chance);
}

fn dielectric_eval_pdf(b: ptr<function, Bsdf>, wi: vec3f) -> BsdfValue {
    let glass = dielectric_from(b);
    let reflects = wi.z > 0.0;
    let seen = select(wi, vec3f(wi.xy, -wi.z), glass.thin && !reflects);
    let bounce = microfacets_bounce(glass.facets, (*b).wo, seen, glass.eta);
    if bounce.cosine <= 0.0 {
        return BsdfValue(vec3f(0.0), 0.0);
    }
    let split = dielectric_split(glass, bounce.cosine);
    if reflects {
        return BsdfValue(split.reflected * bounce.value, split.chance * bounce.pdf);
    }
    let across = select(glass.eta, 1.0, glass.thin);
    return BsdfValue(split.transmitted * (bounce.value / (across * across)), (1.0 - split.chance) * bounce.pdf);
}

fn dielectric_sample(b: ptr<function, Bsdf>, u: vec3f) -> BsdfDrawn {
    let glass = dielectric_from(b);
    let wo = (*b).wo;
    let smooth_boundary = microfacets_is_smooth(glass.facets);
    let h = microfacets_sample_visible_normal(glass.facets, wo, u.yz);
    let split = dielectric_split(glass, dot(wo, h));
    if u.x < split.chance {
        let wi = fresnel_reflect(wo, h);
        if smooth_boundary {
            return bsdf_delta(wi, split.reflected, split.chance, BSDF_REFLECTION, 1.0);
        }
        return bsdf_spread(wi, select(0u, BSDF_REFLECTION | BSDF_GLOSSY, wi.z > 0.0), 1.0);
    }
    let eta = select(glass.eta, 1.0, glass.thin);
    var wi = fresnel_reflect(wo, h) * vec3f(1.0, 1.0, -1.0);
    if !glass.thin {
        let bent = fresnel_refract(wo, h, eta);
        if bent.w == 0.0 {
            return BSDF_NONE;
        }
        wi = bent.xyz;
    }
    if smooth_boundary {
        return bsdf_delta(wi, split.transmitted / (eta * eta), 1.0 - split.chance, BSDF_TRANSMISSION, eta);
    }
    return bsdf_spread(wi, select(0u, BSDF_TRANSMISSION | BSDF_GLOSSY, wi.z < 0.0), eta);
}

fn dielectric_surface(
    record: u32, point: ptr<function, SurfacePoint>, p: ptr<function, SurfaceParams>, wo: vec3f,
) -> Bsdf {
    let roughness = vec2f((*p)[DIELECTRIC_PARAM_ROUGHNESS_X].x, (*p)[DIELECTRIC_PARAM_ROUGHNESS_Y].x);
    let facets = microfacets_new(material_words[record + DIELECTRIC_FACETS], roughness);
    let thin = material_words[record + DIELECTRIC_THIN] != 0u;
    let eta = material_f32(record + DIELECTRIC_ETA);
    let inside = !thin && (*point).front == 0u;
    let reflectance = surface_share((*p)[DIELECTRIC_PARAM_REFLECTANCE]);
    let transmittance = surface_share((*p)[DIELECTRIC_PARAM_TRANSMITTANCE]);
    let glass = Dielectric(select(eta, 1.0 / eta, inside), reflectance, transmittance, facets, thin);
    return dielectric_new(wo, glass);
}
