// Twin: `bottega-render/src/bsdf/fresnel.rs`.
//
// Reflectance of boundaries, and the direction of refraction.

// Returns the reflectance of a dielectric; `eta`: index of refraction beyond the boundary, relative to the side of the direction.
fn fresnel_dielectric(cosine: f32, eta: f32) -> f32 {
    let cos_o = clamp(cosine, 0.0, 1.0);
    let sin2_i = (1.0 - cos_o * cos_o) / (eta * eta);
    if sin2_i >= 1.0 {
        return 1.0;
    }
    let cos_i = sqrt(1.0 - sin2_i);
    let parallel = (eta * cos_o - cos_i) / (eta * cos_o + cos_i);
    let perpendicular = (cos_o - eta * cos_i) / (cos_o + eta * cos_i);
    return 0.5 * (parallel * parallel + perpendicular * perpendicular);
}

// Returns the reflectance of a metal, per channel.
fn fresnel_conductor(cosine: f32, n: vec3f, k: vec3f) -> vec3f {
    let c = clamp(cosine, 0.0, 1.0);
    let cos2 = c * c;
    let sin2 = 1.0 - cos2;
    let t = n * n - k * k - sin2;
    let size = sqrt(t * t + 4.0 * n * n * k * k);
    let twice = 2.0 * c * sqrt(max(0.5 * (size + t), vec3f(0.0)));
    let p = cos2 * size + sin2 * sin2;
    let q = twice * sin2;
    let below = size + cos2 + twice;
    // Avoid 0 / 0 for an index of 1 at the horizon.
    if math_min3(below) <= 0.0 || math_min3(p + q) <= 0.0 {
        return vec3f(1.0);
    }
    let perpendicular = (size + cos2 - twice) / below;
    return 0.5 * perpendicular * (1.0 + (p - q) / (p + q));
}

// Refracts `wo` at a boundary with normal `h`; w: 1, or 0 for total reflection.
fn fresnel_refract(wo: vec3f, h: vec3f, eta: f32) -> vec4f {
    let cos_o = dot(wo, h);
    let sin2_i = max(1.0 - cos_o * cos_o, 0.0) / (eta * eta);
    if sin2_i >= 1.0 {
        return vec4f(0.0);
    }
    let cos_i = sqrt(1.0 - sin2_i);
    return vec4f(normalize(h * (cos_o / eta - cos_i) - wo / eta), 1.0);
}

fn fresnel_reflect(wo: vec3f, h: vec3f) -> vec3f {
    return 2.0 * dot(wo, h) * h - wo;
}

fn fresnel_schlick_weight(cosine: f32) -> f32 {
    let m = clamp(1.0 - cosine, 0.0, 1.0);
    let m2 = m * m;
    return m2 * m2 * m;
}

// Returns the reflectance at normal incidence.
fn fresnel_at_normal_incidence(ior: f32) -> f32 {
    let r = (ior - 1.0) / (ior + 1.0);
    return r * r;
}
