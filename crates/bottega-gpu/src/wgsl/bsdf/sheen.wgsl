// Twin: `bottega-render/src/bsdf/sheen.rs`.
//
// Sheen: the soft rim light of cloth.

struct Sheen {
    // Colour; black: no sheen.
    color: vec3f,
    alpha: f32,
    // Position along the table's axis of roughness.
    position: f32,
}

fn sheen_new(color: vec3f, roughness: f32) -> Sheen {
    let r = max(roughness, SHEEN_ROUGHNESS_MIN);
    let position = (r - SHEEN_ROUGHNESS_MIN) / (1.0 - SHEEN_ROUGHNESS_MIN);
    if !HAS_SHEEN || math_max3(color) <= 0.0 {
        return Sheen(vec3f(0.0), 1.0, 1.0);
    }
    return Sheen(color / max(tables_sheen_peak(tables_rough_at(position)), 1.0), r * r, position);
}

// Returns f(wo, wi), both above the horizon.
fn sheen_eval(sheen: Sheen, wo: vec3f, wi: vec3f) -> vec3f {
    let h = math_normalize_or(wo + wi, vec3f(0.0, 0.0, 1.0));
    let sine = min(length(h.xy), 1.0);
    if sine <= 0.0 {
        return vec3f(0.0);
    }
    let density = (2.0 + 1.0 / sheen.alpha) * math_powf(sine, 1.0 / sheen.alpha) / TAU;
    let o = max(wo.z, 1e-4);
    let i = max(wi.z, 1e-4);
    return sheen.color * (density / (4.0 * o * i * (1.0 + sheen_lambda(sheen.alpha, o) + sheen_lambda(sheen.alpha, i))));
}

// Returns the transmittance to the layers below at a cosine.
fn sheen_passed(sheen: Sheen, mu: TablePlace) -> f32 {
    return 1.0 - math_max3(sheen.color) * tables_by_rough(TABLE_SHEEN, tables_rough_at(sheen.position), mu);
}

fn sheen_lambda(alpha: f32, cosine: f32) -> f32 {
    let narrow = (1.0 - alpha) * (1.0 - alpha);
    let fit = narrow * SHEEN_NARROW + (1.0 - narrow) * SHEEN_WIDE;
    let last = narrow * SHEEN_NARROW_LAST + (1.0 - narrow) * SHEEN_WIDE_LAST;
    let is_steep = cosine < 0.5;
    let l = sheen_fitted(fit, last, select(max(1.0 - cosine, 1e-6), cosine, is_steep));
    return math_exp(select(2.0 * sheen_fitted(fit, last, 0.5) - l, l, is_steep));
}

fn sheen_fitted(fit: vec4f, last: f32, x: f32) -> f32 {
    return fit.x / (1.0 + fit.y * math_powf(x, fit.z)) + fit.w * x + last;
}
