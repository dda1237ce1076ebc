// Twin: `bottega-render/src/bsdf/frame.rs`.
//
// Local frames.

// Returns a frame around a unit normal as columns x, y, z (Duff et al. 2017, listing 3).
fn frame_from_normal(n: vec3f) -> mat3x3f {
    let sign = math_sign(n.z);
    let a = -1.0 / (sign + n.z);
    let b = n.x * n.y * a;
    return mat3x3f(vec3f(1.0 + sign * n.x * n.x * a, sign * b, -sign * n.x), vec3f(b, sign + n.y * n.y * a, -n.y), n);
}
