// Twin: `bottega-render/src/bsdf/principled.rs`.
//
// Disney's material, as a solid and as a thin sheet.

struct Principled {
    base: vec3f,
    roughness: f32,
    // The base colour scaled to luminance 1.
    tint: vec3f,
    metallic: f32,
    // α of the main lobes; of a sheet: of the reflecting lobes.
    alpha: vec2f,
    spec_trans: f32,
    eta: f32,
    spec_tint: f32,
    sheen: f32,
    sheen_tint: f32,
    flatness: f32,
    clearcoat: f32,
    coat_alpha: f32,
    // `true`: wo is inside the solid.
    inside: bool,
    diff_trans: f32,
    // α of a sheet's transmitting lobes.
    through_alpha: vec2f,
}

// In the order above; d[5]: of a solid, probabilities of the main lobes and of the coat.
fn principled_from(b: ptr<function, Bsdf>) -> Principled {
    let d0 = (*b).d[0];
    let d1 = (*b).d[1];
    let d2 = (*b).d[2];
    let d3 = (*b).d[3];
    let d4 = (*b).d[4];
    return Principled(d0.xyz, d0.w, d1.xyz, d1.w, d2.xy, d2.z, d2.w, d3.x, d3.y, d3.z, d3.w, d4.x, d4.y, d4.z != 0.0, d4.w,
        (*b).d[5].zw);
}

fn principled_bsdf(wo: vec3f, p: Principled, chances: vec2f) -> Bsdf {
    var b = bsdf_black(wo);
    b.d[0] = vec4f(p.base, p.roughness);
    b.d[1] = vec4f(p.tint, p.metallic);
    b.d[2] = vec4f(p.alpha, p.spec_trans, p.eta);
    b.d[3] = vec4f(p.spec_tint, p.sheen, p.sheen_tint, p.flatness);
    b.d[4] = vec4f(p.clearcoat, p.coat_alpha, select(0.0, 1.0, p.inside), p.diff_trans);
    b.d[5] = vec4f(chances, p.through_alpha);
    b.lobes = BSDF_HAS_NON_DELTA;
    return b;
}

fn principled_facets(alpha: vec2f) -> Microfacets {
    return Microfacets(alpha, FACETS_SEPARABLE);
}

fn principled_alpha(roughness: f32, anisotropic: f32) -> vec2f {
    let aspect = sqrt(1.0 - 0.9 * anisotropic);
    let alpha = roughness * roughness;
    return clamp(vec2f(alpha / aspect, alpha * aspect), vec2f(GGX_SMOOTH_ALPHA), vec2f(FACETS_ALPHA_MAX));
}

// Scales a colour to luminance 1; white for black.
fn principled_tint_of(color: vec3f) -> vec3f {
    let luminance = dot(color, vec3f(0.212671, 0.715160, 0.072169));
    if luminance <= 0.0 {
        return vec3f(1.0);
    }
    return color / luminance;
}

fn principled_mix(a: f32, b: f32, share: f32) -> f32 {
    return a * (1.0 - share) + b * share;
}

// Returns Schlick's term for the angle on the side of the lower index.
fn principled_schlick(f0: vec3f, cosine: f32, eta: f32) -> vec3f {
    let thin = sqrt(max(1.0 - (1.0 - cosine * cosine) / (eta * eta), 0.0));
    let weight = fresnel_schlick_weight(select(thin, cosine, eta > 1.0));
    return f0 * (1.0 - weight) + weight;
}

// Returns the sheen, and in w the diffuse term without the base colour. Both directions above the surface.
fn principled_diffuse(p: Principled, wo: vec3f, wi: vec3f) -> vec4f {
    let fo = fresnel_schlick_weight(wo.z);
    let fi = fresnel_schlick_weight(wi.z);
    let cosine = dot(math_normalize_or(wo + wi, vec3f(0.0, 0.0, 1.0)), wi);
    let retro = 2.0 * p.roughness * cosine * cosine;
    let lambert = (1.0 - 0.5 * fo) * (1.0 - 0.5 * fi) + retro * (fo + fi + fo * fi * (retro - 1.0));
    // Approximate Hanrahan and Krueger's subsurface scattering by Burley's flat term.
    let at_horizon = 0.5 * retro;
    let once = principled_mix(1.0, at_horizon, fo) * principled_mix(1.0, at_horizon, fi);
    let subsurface = 1.25 * (once * (1.0 / (wo.z + wi.z) - 0.5) + 0.5);
    let sheen = ((1.0 - p.sheen_tint) + p.tint * p.sheen_tint) * (p.sheen * fresnel_schlick_weight(abs(cosine)));
    return vec4f(sheen, FRAC_1_PI * principled_mix(lambert, subsurface, p.flatness));
}

fn principled_new(wo: vec3f, p: Principled) -> Bsdf {
    let split = principled_split(p, wo.z);
    var chances = vec2f(1.0, 0.0);
    if !p.inside {
        let main = math_mean(split.xyz) + split.w * math_mean(p.base) + 0.02;
        let coat = 0.25 * p.clearcoat * principled_mix(0.04, 1.0, fresnel_schlick_weight(wo.z));
        let diffuse = principled_matte(p) * math_mean(p.base) + 0.2 * (1.0 - p.metallic) * p.sheen;
        chances = vec2f(main, coat) / (main + coat + diffuse);
    }
    var b = principled_bsdf(wo, p, chances);
    b.kind = BSDF_KIND_PRINCIPLED;
    b.lobes |= select(0u, BSDF_IS_TRANSMISSIVE, principled_clear(p) > 0.0);
    let matte = select(principled_matte(p), 0.0, p.inside);
    b.albedo = min(split.xyz + p.base * (split.w + matte), vec3f(1.0));
    let coat_roughness = select(1.0, sqrt(p.coat_alpha), p.clearcoat > 0.0 && !p.inside);
    b.roughness = min(microfacets_roughness(principled_facets(p.alpha)), coat_roughness);
    return b;
}

fn principled_coat_masking(cosine: f32) -> f32 {
    let tan2 = max(1.0 - cosine * cosine, 0.0) / (cosine * cosine);
    return 2.0 / (1.0 + sqrt(1.0 + 0.25 * 0.25 * tan2));
}

// Returns the fraction of the surface that is a clear solid.
fn principled_clear(p: Principled) -> f32 {
    return (1.0 - p.metallic) * p.spec_trans;
}

// Returns the fraction of the surface that is matte.
fn principled_matte(p: Principled) -> f32 {
    return (1.0 - p.metallic) * (1.0 - p.spec_trans);
}

fn principled_eta(p: Principled) -> f32 {
    return select(p.eta, 1.0 / p.eta, p.inside);
}

fn principled_tinted(p: Principled, exact: f32, cosine: f32) -> vec3f {
    let f0 = p.tint * fresnel_at_normal_incidence(p.eta);
    return exact * (1.0 - p.spec_tint) + principled_schlick(f0, cosine, p.eta) * p.spec_tint;
}

// Returns the reflectance of a facet, and in w its transmittance.
fn principled_split(p: Principled, cosine: f32) -> vec4f {
    let exact = fresnel_dielectric(cosine, principled_eta(p));
    let through = principled_clear(p) * (1.0 - exact);
    if p.inside {
        return vec4f(vec3f(principled_clear(p) * exact), through);
    }
    let metal = principled_schlick(p.base, cosine, p.eta) * p.metallic;
    return vec4f(metal + principled_tinted(p, exact, cosine) * (1.0 - p.metallic), through);
}

// Returns the probability of sampling reflection at a facet.
fn principled_reflection(p: Principled, split: vec4f) -> f32 {
    let r = math_mean(split.xyz);
    let t = split.w * math_mean(p.base);
    // Keep both probabilities above 0, so that weights stay bounded.
    return select(1.0, (r + 0.05) / (r + t + 0.1), split.w > 0.0);
}

// Returns f and pdf of the clear coat: Burley's generalized Trowbridge-Reitz facets with γ = 1.
fn principled_coat(p: Principled, wo: vec3f, wi: vec3f) -> vec2f {
    let h = math_normalize_or(wo + wi, vec3f(0.0));
    let cosine = dot(wo, h);
    if cosine <= 0.0 {
        return vec2f(0.0);
    }
    let a2 = p.coat_alpha * p.coat_alpha;
    let density = (a2 - 1.0) / (PI * math_ln(a2) * (h.x * h.x + h.y * h.y + a2 * h.z * h.z));
    let reflectance = principled_schlick(vec3f(0.04), cosine, p.eta).x;
    let masking = principled_coat_masking(wo.z) * principled_coat_masking(wi.z);
    return vec2f(0.25 * p.clearcoat * reflectance * density * masking, density * h.z / (4.0 * cosine));
}

fn principled_eval_pdf(b: ptr<function, Bsdf>, wi: vec3f) -> BsdfValue {
    let p = principled_from(b);
    let wo = (*b).wo;
    let chances = (*b).d[5].xy;
    let refracts = wi.z < 0.0;
    if refracts && principled_clear(p) <= 0.0 {
        return BsdfValue(vec3f(0.0), 0.0);
    }
    let eta = principled_eta(p);
    let bounce = microfacets_bounce(principled_facets(p.alpha), wo, wi, eta);
    var value = vec3f(0.0);
    var pdf = 0.0;
    if bounce.cosine > 0.0 {
        let split = principled_split(p, bounce.cosine);
        let reflection = principled_reflection(p, split);
        value = select(split.xyz, sqrt(p.base) * (split.w / (eta * eta)), refracts) * bounce.value;
        pdf = chances.x * select(reflection, 1.0 - reflection, refracts) * bounce.pdf;
    }
    if refracts || p.inside {
        return BsdfValue(value, pdf);
    }
    if p.clearcoat > 0.0 {
        let coat = principled_coat(p, wo, wi);
        value += coat.x;
        pdf += chances.y * coat.y;
    }
    let matte = principled_matte(p);
    if matte > 0.0 {
        let light = principled_diffuse(p, wo, wi);
        value += p.base * (matte * light.w) + light.xyz * (1.0 - p.metallic);
    }
    return BsdfValue(max(value, vec3f(0.0)), pdf + max(1.0 - chances.x - chances.y, 0.0) * warp_cosine_hemisphere_pdf(wi.z));
}

fn principled_sample(b: ptr<function, Bsdf>, u: vec3f) -> BsdfDrawn {
    let p = principled_from(b);
    let wo = (*b).wo;
    let chances = (*b).d[5].xy;
    if u.x < chances.x {
        let h = ggx_sample_visible_normal(p.alpha, wo, u.yz);
        if warp_rest(u.x, chances.x) < principled_reflection(p, principled_split(p, dot(wo, h))) {
            let wi = fresnel_reflect(wo, h);
            return bsdf_spread(wi, select(0u, BSDF_REFLECTION | BSDF_GLOSSY, wi.z > 0.0), 1.0);
        }
        let eta = principled_eta(p);
        let wi = fresnel_refract(wo, h, eta).xyz;
        return bsdf_spread(wi, select(0u, BSDF_TRANSMISSION | BSDF_GLOSSY, wi.z < 0.0), eta);
    }
    if u.x >= chances.x + chances.y {
        return bsdf_spread(warp_cosine_hemisphere(u.yz), BSDF_REFLECTION | BSDF_DIFFUSE, 1.0);
    }
    let a2 = p.coat_alpha * p.coat_alpha;
    let cos2 = (1.0 - math_powf(a2, 1.0 - u.z)) / (1.0 - a2);
    let sine = sqrt(max(1.0 - cos2, 0.0));
    let turn = math_sin_cos_of_turns(u.y);
    let wi = fresnel_reflect(wo, vec3f(sine * turn.y, sine * turn.x, sqrt(max(cos2, 0.0))));
    return bsdf_spread(wi, select(0u, BSDF_REFLECTION | BSDF_GLOSSY, wi.z > 0.0), 1.0);
}

// Creates a sheet: diffuse and sharp lobes on both sides.
fn principled_sheet_new(wo: vec3f, p: Principled) -> Bsdf {
    var b = principled_bsdf(wo, p, vec2f(0.0));
    b.kind = BSDF_KIND_SHEET;
    b.lobes |= select(0u, BSDF_IS_TRANSMISSIVE, p.spec_trans > 0.0 || p.diff_trans > 0.0);
    let exact = fresnel_dielectric(wo.z, p.eta);
    b.albedo = p.base * (1.0 - p.spec_trans) + (exact + p.base * (1.0 - exact)) * p.spec_trans;
    if p.spec_trans > 0.0 {
        b.roughness =
            min(microfacets_roughness(principled_facets(p.alpha)), microfacets_roughness(principled_facets(p.through_alpha)));
    }
    return b;
}

// Checks that `wi`, below the surface, is also below the facet that mirrors `wo` to the image of `wi` above.
fn principled_is_beyond(wo: vec3f, wi: vec3f) -> bool {
    return dot(wi, wo + vec3f(wi.xy, -wi.z)) < 0.0;
}

fn principled_sheet_eval_pdf(b: ptr<function, Bsdf>, wi: vec3f) -> BsdfValue {
    let p = principled_from(b);
    let wo = (*b).wo;
    let reflects = wi.z > 0.0;
    let above = vec3f(wi.xy, abs(wi.z));
    var value = vec3f(0.0);
    var pdf = 0.0;
    let bounce = microfacets_bounce(principled_facets(select(p.through_alpha, p.alpha, reflects)), wo, above, 1.0);
    if p.spec_trans > 0.0 && bounce.cosine > 0.0 && (reflects || principled_is_beyond(wo, wi)) {
        let exact = fresnel_dielectric(bounce.cosine, p.eta);
        let color = select(p.base * (1.0 - exact), principled_tinted(p, exact, bounce.cosine), reflects);
        value = color * (p.spec_trans * bounce.value);
        pdf = 0.5 * p.spec_trans * bounce.pdf;
    }
    let matte = 1.0 - p.spec_trans;
    let cosine = warp_cosine_hemisphere_pdf(above.z);
    if reflects {
        let light = principled_diffuse(p, wo, wi);
        value += (p.base * light.w + light.xyz) * (matte * (1.0 - p.diff_trans));
        pdf += matte * (1.0 - p.diff_trans) * cosine;
    } else {
        value += p.base * (matte * p.diff_trans * FRAC_1_PI);
        pdf += matte * p.diff_trans * cosine;
    }
    return BsdfValue(max(value, vec3f(0.0)), pdf);
}

fn principled_sheet_sample(b: ptr<function, Bsdf>, u: vec3f) -> BsdfDrawn {
    let p = principled_from(b);
    let wo = (*b).wo;
    let half = 0.5 * p.spec_trans;
    let diffuse = (1.0 - p.spec_trans) * (1.0 - p.diff_trans);
    let is_sharp = u.x < half + half;
    let reflects = u.x < half || (!is_sharp && u.x < half + half + diffuse);
    var above = vec3f(0.0);
    if is_sharp {
        above = fresnel_reflect(wo, ggx_sample_visible_normal(select(p.through_alpha, p.alpha, reflects), wo, u.yz));
    } else {
        above = warp_cosine_hemisphere(u.yz);
    }
    let wi = select(vec3f(above.xy, -above.z), above, reflects);
    // A sharp direction that is not beyond its facet has only the diffuse lobe's pdf, which did not sample it.
    if above.z <= 0.0 || (is_sharp && !reflects && !principled_is_beyond(wo, wi)) {
        return BSDF_NONE;
    }
    let side = select(BSDF_TRANSMISSION, BSDF_REFLECTION, reflects);
    return bsdf_spread(wi, side | select(BSDF_DIFFUSE, BSDF_GLOSSY, is_sharp), 1.0);
}

fn principled_surface(
    record: u32, point: ptr<function, SurfacePoint>, p: ptr<function, SurfaceParams>, wo: vec3f,
) -> Bsdf {
    let base = surface_share((*p)[PRINCIPLED_PARAM_BASE_COLOR] * (*point).vertex_color.xyz);
    let front = (*point).front != 0u;
    let roughness = surface_unit((*p)[PRINCIPLED_PARAM_ROUGHNESS].x);
    let anisotropic = surface_unit((*p)[PRINCIPLED_PARAM_ANISOTROPIC].x);
    let spec_trans = surface_unit((*p)[PRINCIPLED_PARAM_SPEC_TRANS].x);
    let thin = material_words[record + PRINCIPLED_THIN] != 0u;
    let eta = material_f32(record + PRINCIPLED_ETA);
    let scaled = max((0.65 * eta - 0.35) * roughness, 0.0);
    let inside = !thin && !front && spec_trans > 0.0;
    let it = Principled(
        base,
        roughness,
        principled_tint_of(base),
        surface_unit((*p)[PRINCIPLED_PARAM_METALLIC].x),
        principled_alpha(roughness, anisotropic),
        spec_trans,
        eta,
        surface_unit((*p)[PRINCIPLED_PARAM_SPEC_TINT].x),
        surface_unit((*p)[PRINCIPLED_PARAM_SHEEN].x),
        surface_unit((*p)[PRINCIPLED_PARAM_SHEEN_TINT].x),
        surface_unit((*p)[PRINCIPLED_PARAM_FLATNESS].x),
        surface_unit((*p)[PRINCIPLED_PARAM_CLEARCOAT].x),
        principled_mix(0.1, 0.001, surface_unit((*p)[PRINCIPLED_PARAM_CLEARCOAT_GLOSS].x)),
        inside,
        0.5 * clamp((*p)[PRINCIPLED_PARAM_DIFF_TRANS].x, 0.0, 2.0),
        principled_alpha(scaled, anisotropic),
    );
    if thin {
        return principled_sheet_new(wo, it);
    }
    return principled_new(wo, it);
}
