// Twin: `bottega-render/src/bsdf/microfacet.rs`.
//
// The facets of a boundary, GGX or Beckmann: light that they reflect or refract once.

struct Microfacets {
    // α along x and y; both 0: smooth.
    alpha: vec2f,
    bits: u32,
}

// The scattering between two directions by facets that reflect or refract all light.
struct FacetBounce {
    // Cosine between wo and the facet's normal; 0: no such facet.
    cosine: f32,
    value: f32,
    pdf: f32,
}

// `bits` as encoded, with the scale of roughness in the upper bits.
fn microfacets_new(bits: u32, roughness: vec2f) -> Microfacets {
    var alpha = roughness;
    switch bits >> FACETS_SCALE_SHIFT {
        case FACETS_SQUARE_ROOT: { alpha = sqrt(max(roughness, vec2f(0.0))); }
        case FACETS_SQUARE: { alpha = roughness * roughness; }
        default: {}
    }
    if max(alpha.x, alpha.y) < GGX_SMOOTH_ALPHA {
        return Microfacets(vec2f(0.0), bits & FACETS_MASK);
    }
    return Microfacets(clamp(alpha, vec2f(GGX_SMOOTH_ALPHA), vec2f(FACETS_ALPHA_MAX)), bits & FACETS_MASK);
}

fn microfacets_is_smooth(facets: Microfacets) -> bool {
    return facets.alpha.x == 0.0;
}

fn microfacets_is_beckmann(facets: Microfacets) -> bool {
    return (facets.bits & FACETS_BECKMANN) != 0u;
}

fn microfacets_roughness(facets: Microfacets) -> f32 {
    return min(sqrt(sqrt(facets.alpha.x * facets.alpha.y)), 1.0);
}

fn microfacets_density(facets: Microfacets, h: vec3f) -> f32 {
    if HAS_BECKMANN { if microfacets_is_beckmann(facets) { return beckmann_density(facets.alpha, h); } }
    return ggx_density(facets.alpha, h);
}

// Returns G₁; 1 for smooth facets.
fn microfacets_masking(facets: Microfacets, w: vec3f) -> f32 {
    if HAS_BECKMANN { if microfacets_is_beckmann(facets) { return beckmann_masking(facets.alpha, w); } }
    return ggx_masking(facets.alpha, w);
}

// Returns G₂; the directions may be on different sides.
fn microfacets_shadowing(facets: Microfacets, wo: vec3f, wi: vec3f) -> f32 {
    let o = microfacets_masking(facets, wo);
    let i = microfacets_masking(facets, wi);
    if (facets.bits & FACETS_SEPARABLE) != 0u {
        return o * i;
    }
    return o * i / max(o + i - o * i, 1.2e-38);
}

fn microfacets_visible_area(facets: Microfacets, wo: vec3f) -> f32 {
    if HAS_BECKMANN { if microfacets_is_beckmann(facets) { return beckmann_visible_area(facets.alpha, wo); } }
    return ggx_visible_area(facets.alpha, wo);
}

// Samples a visible normal; the surface's normal if smooth.
fn microfacets_sample_visible_normal(facets: Microfacets, wo: vec3f, u: vec2f) -> vec3f {
    if microfacets_is_smooth(facets) {
        return vec3f(0.0, 0.0, 1.0);
    }
    if HAS_BECKMANN { if microfacets_is_beckmann(facets) { return beckmann_sample_visible_normal(facets.alpha, wo, u); } }
    return ggx_sample_visible_normal(facets.alpha, wo, u);
}

// Scatters between wo above the surface and wi above it (reflected) or below it (refracted; `eta`: index below relative to
// above), in importance mode. Returns 0 for smooth facets.
fn microfacets_bounce(facets: Microfacets, wo: vec3f, wi: vec3f, eta: f32) -> FacetBounce {
    let mirrors = wi.z > 0.0;
    let sum = wo + select(eta, 1.0, mirrors) * wi;
    let length2 = dot(sum, sum);
    if microfacets_is_smooth(facets) || length2 < 1e-30 {
        return FacetBounce(0.0, 0.0, 0.0);
    }
    let upright = sum / sqrt(length2);
    let h = select(upright * math_sign(sum.z), upright, mirrors);
    let cos_o = dot(wo, h);
    let cos_i = dot(wi, h);
    if cos_o <= 0.0 || (!mirrors && cos_i >= 0.0) || wi.z == 0.0 {
        return FacetBounce(0.0, 0.0, 0.0);
    }
    // D times dω_h / dω_i (Walter et al. 2007, eq. 17) times the cosine of wo.
    let jacobian = select(eta * eta * -cos_i * cos_o / length2, 0.25, mirrors);
    let density = microfacets_density(facets, h) * jacobian;
    let value = density * microfacets_shadowing(facets, wo, wi) / (wo.z * abs(wi.z));
    return FacetBounce(cos_o, value, density / microfacets_visible_area(facets, wo));
}
