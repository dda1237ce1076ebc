// Twin: `bottega-render/src/bsdf/warp.rs`.
//
// Maps from the unit square to directions, and local frames.

// Samples the upper hemisphere with pdf cos θ / π.
fn warp_cosine_hemisphere(u: vec2f) -> vec3f {
    let turn = math_sin_cos_of_turns(u.x);
    let radius = sqrt(u.y);
    return vec3f(radius * turn.y, radius * turn.x, sqrt(max(1.0 - u.y, 0.0)));
}

fn warp_cosine_hemisphere_pdf(cos_theta: f32) -> f32 {
    return max(cos_theta, 0.0) * FRAC_1_PI;
}

// Samples the upper hemisphere uniformly.
fn warp_uniform_hemisphere(u: vec2f) -> vec3f {
    let turn = math_sin_cos_of_turns(u.x);
    let z = 1.0 - u.y;
    let radius = sqrt(max(1.0 - z * z, 0.0));
    return vec3f(radius * turn.y, radius * turn.x, z);
}

// Rescales `u` to [0, 1) within its part, below or above `chance`.
fn warp_rest(u: f32, chance: f32) -> f32 {
    var rest = 0.0;
    if u < chance {
        rest = u / chance;
    } else {
        rest = (u - chance) / (1.0 - chance);
    }
    return clamp(rest, 0.0, ONE_MINUS_EPSILON);
}
