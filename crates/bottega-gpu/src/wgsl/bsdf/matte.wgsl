// Twin: `bottega-render/src/bsdf/matte.rs`.
//
// Matte surfaces.

// d[0]: colour.
fn lambert_new(wo: vec3f, color: vec3f) -> Bsdf {
    var b = bsdf_black(wo);
    if math_max3(color) > 0.0 {
        b.kind = BSDF_KIND_LAMBERT;
        b.lobes = BSDF_HAS_NON_DELTA;
        b.albedo = color;
        b.d[0] = vec4f(color, 0.0);
    }
    return b;
}

fn lambert_eval_pdf(b: ptr<function, Bsdf>, wi: vec3f) -> BsdfValue {
    if wi.z <= 0.0 {
        return BsdfValue(vec3f(0.0), 0.0);
    }
    return BsdfValue((*b).d[0].xyz * FRAC_1_PI, warp_cosine_hemisphere_pdf(wi.z));
}

// d[0]: colour, r; d[1]: colour of light scattered again between facets, and the single-scattering albedo for wo.
fn rough_matte_new(wo: vec3f, color: vec3f, deviation: f32) -> Bsdf {
    let s2 = deviation * deviation;
    let rough = min(0.45 * s2 / (s2 + 0.09) / (1.0 - 0.5 * s2 / (s2 + 0.33)), 1.0);
    let mean = (1.0 + ROUGH_MATTE_GAIN * rough) / (1.0 + ROUGH_MATTE_LOSS * rough);
    let multiple = color * color * (mean / max(1.0 - mean, 1e-6)) / (1.0 - color * (1.0 - mean));
    let single = rough_matte_single(rough, wo.z);
    var b = bsdf_black(wo);
    b.kind = BSDF_KIND_ROUGH_MATTE;
    b.lobes = BSDF_HAS_NON_DELTA;
    b.albedo = color * single + multiple * ((1.0 - single) * (1.0 - mean));
    b.d[0] = vec4f(color, rough);
    b.d[1] = vec4f(multiple, single);
    return b;
}

// Returns the single-scattering albedo of a white surface at a cosine.
fn rough_matte_single(rough: f32, cosine: f32) -> f32 {
    let sine = sqrt(max(1.0 - cosine * cosine, 0.0));
    let tail = sine * cosine * (1.0 + sine + sine * sine) / (1.0 + sine);
    let rise = sine * (math_acos(cosine) - sine * cosine - 2.0 / 3.0) + 2.0 / 3.0 * tail;
    return (1.0 + rough * FRAC_1_PI * rise) / (1.0 + ROUGH_MATTE_LOSS * rough);
}

fn rough_matte_eval_pdf(b: ptr<function, Bsdf>, wi: vec3f) -> BsdfValue {
    if wi.z <= 0.0 {
        return BsdfValue(vec3f(0.0), 0.0);
    }
    let wo = (*b).wo;
    let rough = (*b).d[0].w;
    let s = dot(wo, wi) - wo.z * wi.z;
    let t = select(1.0, max(wo.z, wi.z), s > 0.0);
    let single = (1.0 + rough * s / t) / (1.0 + ROUGH_MATTE_LOSS * rough);
    let rest = max(1.0 - (*b).d[1].w, 0.0) * max(1.0 - rough_matte_single(rough, wi.z), 0.0);
    let value = ((*b).d[0].xyz * single + (*b).d[1].xyz * rest) * FRAC_1_PI;
    return BsdfValue(value, warp_cosine_hemisphere_pdf(wi.z));
}

// d[0]: reflectance, and the probability of sampling reflection; d[1]: transmittance.
fn translucent_new(wo: vec3f, reflectance: vec3f, transmittance: vec3f) -> Bsdf {
    var b = bsdf_black(wo);
    let r = math_mean(reflectance);
    let t = math_mean(transmittance);
    if r + t > 0.0 {
        b.kind = BSDF_KIND_TRANSLUCENT;
        b.lobes = BSDF_HAS_NON_DELTA | select(0u, BSDF_IS_TRANSMISSIVE, math_max3(transmittance) > 0.0);
        b.albedo = reflectance + transmittance;
        b.d[0] = vec4f(reflectance, r / (r + t));
        b.d[1] = vec4f(transmittance, 0.0);
    }
    return b;
}

fn translucent_eval_pdf(b: ptr<function, Bsdf>, wi: vec3f) -> BsdfValue {
    let reflects = wi.z > 0.0;
    let chance = (*b).d[0].w;
    let color = select((*b).d[1].xyz, (*b).d[0].xyz, reflects);
    return BsdfValue(color * FRAC_1_PI, select(1.0 - chance, chance, reflects) * warp_cosine_hemisphere_pdf(abs(wi.z)));
}

fn translucent_sample(b: ptr<function, Bsdf>, u: vec3f) -> BsdfDrawn {
    let wi = warp_cosine_hemisphere(u.yz);
    if u.x < (*b).d[0].w {
        return bsdf_spread(wi, BSDF_REFLECTION | BSDF_DIFFUSE, 1.0);
    }
    return bsdf_spread(-wi, BSDF_TRANSMISSION | BSDF_DIFFUSE, 1.0);
}

fn matte_surface(point: ptr<function, SurfacePoint>, p: ptr<function, SurfaceParams>, wo: vec3f) -> Bsdf {
    let color = surface_share((*p)[DIFFUSE_PARAM_REFLECTANCE] * (*point).vertex_color.xyz);
    let deviation = (*p)[DIFFUSE_PARAM_ROUGHNESS].x;
    if deviation > 0.0 && math_max3(color) > 0.0 {
        return rough_matte_new(wo, color, min(deviation, 10.0));
    }
    return lambert_new(wo, color);
}

fn translucent_surface(point: ptr<function, SurfacePoint>, p: ptr<function, SurfaceParams>, wo: vec3f) -> Bsdf {
    let reflectance = surface_share((*p)[TRANSLUCENT_PARAM_REFLECTANCE] * (*point).vertex_color.xyz);
    let transmittance = surface_share((*p)[TRANSLUCENT_PARAM_TRANSMITTANCE] * (*point).vertex_color.xyz);
    // Conserve energy.
    let scale = 1.0 / max(reflectance + transmittance, vec3f(1.0));
    return translucent_new(wo, reflectance * scale, transmittance * scale);
}
