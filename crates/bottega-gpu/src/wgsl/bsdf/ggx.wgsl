// Twin: `bottega-render/src/bsdf/ggx.rs`.
//
// The GGX distribution of microfacet normals.

fn ggx_density(alpha: vec2f, h: vec3f) -> f32 {
    let area = alpha.x * alpha.y;
    let v = vec3f(alpha.y * h.x, alpha.x * h.y, area * h.z);
    let t = dot(v, v);
    return area * area * area / (PI * t * t);
}

fn ggx_stretch(alpha: vec2f, w: vec3f) -> f32 {
    return length(vec3f(alpha * w.xy, w.z));
}

// Returns G₁, on either side.
fn ggx_masking(alpha: vec2f, w: vec3f) -> f32 {
    let cosine = abs(w.z);
    return 2.0 * cosine / (cosine + ggx_stretch(alpha, w));
}

// Returns G₂ / (4 cos cos).
fn ggx_visibility(alpha: vec2f, wo: vec3f, wi: vec3f) -> f32 {
    return 0.5 / (wi.z * ggx_stretch(alpha, wo) + wo.z * ggx_stretch(alpha, wi));
}

fn ggx_visible_area(alpha: vec2f, w: vec3f) -> f32 {
    return 0.5 * (w.z + ggx_stretch(alpha, w));
}

fn ggx_reflection_pdf(alpha: vec2f, wo: vec3f, h: vec3f) -> f32 {
    return 0.25 * ggx_density(alpha, h) / ggx_visible_area(alpha, wo);
}

// Samples a visible normal of the facets (Dupuy and Benyoub 2023).
fn ggx_sample_visible_normal(alpha: vec2f, wo: vec3f, u: vec2f) -> vec3f {
    let w = normalize(vec3f(alpha * wo.xy, wo.z));
    let turn = math_sin_cos_of_turns(u.x);
    let z = (1.0 - u.y) * (1.0 + w.z) - w.z;
    let radius = sqrt(max(1.0 - z * z, 0.0));
    let h = vec3f(radius * turn.y, radius * turn.x, z) + w;
    return normalize(vec3f(alpha * h.xy, max(h.z, 1e-9)));
}
