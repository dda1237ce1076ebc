// Twin: `bottega-render/src/bsdf/plastic.rs`.
//
// A matte base below a dielectric boundary.

struct Plastic {
    eta: f32,
    facets: Microfacets,
    specular: vec3f,
    // The base with all interreflections, over η².
    base: vec3f,
    // Thickness of an absorbing layer below a smooth boundary, in mean free paths.
    thickness: f32,
    // Curves of a rough boundary; place 0: the base is seen through a smooth one.
    cover: Cover,
}

// d[0]: tint of the boundary's reflection, α of x; d[1]: base, α of y; d[2]: η, thickness, the cover's fractions; d[3]:
// transmittance for wo, probability of the boundary; words: the cover's place and stride, the facets' bits.
fn plastic_new(wo: vec3f, plastic: Plastic) -> Bsdf {
    var b = bsdf_black(wo);
    let through = plastic_through(plastic, wo.z);
    let fresnel = fresnel_dielectric(wo.z, plastic.eta);
    let mirrored = math_mean(plastic.specular) * fresnel;
    let sum = mirrored + math_mean(plastic.base) * through * PLASTIC_MEAN_THROUGH;
    var chance = 1.0;
    if sum > 0.0 {
        chance = mirrored / sum;
    }
    b.kind = BSDF_KIND_PLASTIC;
    let is_rough = !microfacets_is_smooth(plastic.facets);
    b.lobes = select(0u, BSDF_HAS_NON_DELTA, is_rough || math_max3(plastic.base) > 0.0);
    b.roughness = microfacets_roughness(plastic.facets);
    b.albedo = plastic.specular * fresnel + plastic.base * (through * PLASTIC_MEAN_THROUGH);
    b.d[0] = vec4f(plastic.specular, plastic.facets.alpha.x);
    b.d[1] = vec4f(plastic.base, plastic.facets.alpha.y);
    b.d[2] = vec4f(plastic.eta, plastic.thickness, plastic.cover.fraction, plastic.cover.deeper);
    b.d[3] = vec4f(through, chance, 0.0, 0.0);
    b.words = vec3u(plastic.cover.at, plastic.cover.stride, plastic.facets.bits);
    return b;
}

fn plastic_from(b: ptr<function, Bsdf>) -> Plastic {
    let words = (*b).words;
    let d2 = (*b).d[2];
    let facets = Microfacets(vec2f((*b).d[0].w, (*b).d[1].w), words.z);
    let cover = Cover(words.x, d2.z, words.y, d2.w);
    return Plastic(d2.x, facets, (*b).d[0].xyz, (*b).d[1].xyz, d2.y, cover);
}

// Returns the transmittance to the base at a cosine.
fn plastic_through(plastic: Plastic, cosine: f32) -> f32 {
    if !microfacets_is_smooth(plastic.facets) && plastic.cover.at != 0u {
        return cover_through(plastic.cover, cosine);
    }
    let through = 1.0 - fresnel_dielectric(cosine, plastic.eta);
    if plastic.thickness == 0.0 {
        return through;
    }
    let sin2 = max(1.0 - cosine * cosine, 0.0) / (plastic.eta * plastic.eta);
    return through * math_exp(-plastic.thickness / sqrt(max(1.0 - sin2, 1e-12)));
}

// Returns the mean internal reflectance over the hemisphere of a solid of index `eta` (Egan and Hilgeman 1979).
fn plastic_mean_internal_reflectance(eta: f32) -> f32 {
    let beyond = 1.0 / eta;
    if beyond < 1.0 {
        return ((-1.4399 * beyond + 0.7099) * beyond + 0.6681) + 0.0636 / beyond;
    }
    let r = eta;
    return ((((-1.36881 * r + 4.98554) * r - 7.80989) * r + 6.75335) * r - 3.4793) * r + 0.919317;
}

fn plastic_eval_pdf(b: ptr<function, Bsdf>, wi: vec3f) -> BsdfValue {
    if wi.z <= 0.0 {
        return BsdfValue(vec3f(0.0), 0.0);
    }
    let plastic = plastic_from(b);
    let seen = (*b).d[3].xy;
    let bounce = microfacets_bounce(plastic.facets, (*b).wo, wi, 1.0);
    let value = plastic.base * (seen.x * plastic_through(plastic, wi.z) * FRAC_1_PI)
        + plastic.specular * (fresnel_dielectric(bounce.cosine, plastic.eta) * bounce.value);
    return BsdfValue(value, (1.0 - seen.y) * warp_cosine_hemisphere_pdf(wi.z) + seen.y * bounce.pdf);
}

fn plastic_sample(b: ptr<function, Bsdf>, u: vec3f) -> BsdfDrawn {
    let plastic = plastic_from(b);
    let wo = (*b).wo;
    let chance = (*b).d[3].y;
    if u.x >= chance {
        return bsdf_spread(warp_cosine_hemisphere(u.yz), BSDF_REFLECTION | BSDF_DIFFUSE, 1.0);
    }
    if microfacets_is_smooth(plastic.facets) {
        let energy = plastic.specular * fresnel_dielectric(wo.z, plastic.eta);
        return bsdf_delta(vec3f(-wo.xy, wo.z), energy, chance, BSDF_REFLECTION, 1.0);
    }
    let wi = fresnel_reflect(wo, microfacets_sample_visible_normal(plastic.facets, wo, u.yz));
    return bsdf_spread(wi, BSDF_REFLECTION | BSDF_GLOSSY, 1.0);
}

fn plastic_surface(record: u32, point: ptr<function, SurfacePoint>, p: ptr<function, SurfaceParams>, wo: vec3f) -> Bsdf {
    let roughness = vec2f((*p)[PLASTIC_PARAM_ROUGHNESS_X].x, (*p)[PLASTIC_PARAM_ROUGHNESS_Y].x);
    let facets = microfacets_new(material_words[record + PLASTIC_FACETS], roughness);
    let eta = material_f32(record + PLASTIC_ETA);
    let inner = material_words[record + PLASTIC_INNER];
    // 0: the boundary is smooth everywhere, or the base is shaded as if it were.
    let block = material_words[record + PLASTIC_COVER];
    let diffuse = surface_share((*p)[PLASTIC_PARAM_DIFFUSE] * (*point).vertex_color.xyz);
    var cover = Cover(0u, 0.0, 0u, 0.0);
    var back = 0.0;
    if block == 0u || microfacets_is_smooth(facets) {
        back = plastic_mean_internal_reflectance(eta);
    } else {
        cover = cover_new(block, facets.alpha, 0.0);
        back = cover_back(cover);
    }
    var base = diffuse;
    if inner != PLASTIC_LOST {
        base /= (1.0 - select(vec3f(1.0), diffuse, inner == PLASTIC_NONLINEAR) * back) * (eta * eta);
    }
    return plastic_new(wo, Plastic(eta, facets, surface_share((*p)[PLASTIC_PARAM_SPECULAR]), base, 0.0, cover));
}

// A matte base below a layer that only absorbs. See `matte_coated` in `bsdf/coated.rs`.
fn plastic_coat_surface(
    record: u32, point: ptr<function, SurfacePoint>, p: ptr<function, SurfaceParams>, wo: vec3f,
) -> Bsdf {
    let roughness = vec2f((*p)[COATED_PARAM_ROUGHNESS_X].x, (*p)[COATED_PARAM_ROUGHNESS_Y].x);
    let facets = microfacets_new(material_words[record + COATED_FACETS], roughness);
    let eta = material_f32(record + COATED_ETA);
    let thickness = clamp((*p)[COATED_PARAM_THICKNESS].x, 0.0, 100.0);
    let color = surface_share((*p)[COATED_PARAM_BASE] * (*point).vertex_color.xyz);
    let cover = cover_new(material_words[record + COATED_COVER], facets.alpha, thickness);
    // Every other event within is at the base.
    let bounces = f32((material_words[record + COATED_MAX_DEPTH] + 1u) / 2u);
    let round = color * cover_back(cover);
    var rest = vec3f(1.0);
    if bounces > 0.0 {
        rest = vec3f(math_powf(round.x, bounces), math_powf(round.y, bounces), math_powf(round.z, bounces));
    }
    let series = color * (1.0 - rest) / (1.0 - round);
    return plastic_new(wo, Plastic(eta, facets, vec3f(1.0), series / (eta * eta), thickness, cover));
}
