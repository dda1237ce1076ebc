// Twin: `bottega-render/src/bsdf/unevenness.rs`.
//
// The correction for a normal that a relief turned away from the surface's own.

// Returns `SurfacePoint.lifted` for a frame turned by Mitsuba's rule. `normal`: the surface's normal without relief, in the
// turned frame.
fn lifted_new(normal: vec3f, shadows: bool) -> vec4f {
    return vec4f(normal, select(0.0, min(0.125 * unevenness_slope_squared(normal.z), 1.0), shadows));
}

// Returns the factor on scattering towards `wi`.
fn lifted_factor(lifted: vec4f, wi: vec3f) -> f32 {
    let cosine = dot(lifted.xyz, wi);
    if cosine * wi.z <= 0.0 {
        return 0.0;
    }
    if lifted.w == 0.0 {
        return 1.0;
    }
    return 2.0 / (1.0 + sqrt(1.0 + lifted.w * unevenness_slope_squared(cosine)));
}

fn unevenness_slope_squared(cosine: f32) -> f32 {
    let squared = cosine * cosine;
    return max(1.0 - squared, 0.0) / max(squared, 1e-12);
}
