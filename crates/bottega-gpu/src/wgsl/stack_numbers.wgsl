// The random numbers of walks through coats, and where they scatter. See `bsdf/coated.rs`.

// 64-bit numbers as low and high words.
fn stack_product(a: vec2u, b: vec2u) -> vec2u {
    let a0 = a.x & 0xffffu;
    let a1 = a.x >> 16u;
    let b0 = b.x & 0xffffu;
    let b1 = b.x >> 16u;
    let low = a0 * b0;
    let p = a0 * b1;
    let q = a1 * b0;
    let middle = (low >> 16u) + (p & 0xffffu) + (q & 0xffffu);
    let high = a1 * b1 + (p >> 16u) + (q >> 16u) + (middle >> 16u);
    return vec2u((low & 0xffffu) | (middle << 16u), high + a.x * b.y + a.y * b.x);
}

// Steele, Lea and Flood 2014 (`mix64`, Stafford's variant 13).
fn stack_mixed(x: vec2u) -> vec2u {
    let a = stack_product(x ^ vec2u((x.x >> 30u) | (x.y << 2u), x.y >> 30u), vec2u(0x1ce4e5b9u, 0xbf58476du));
    let b = stack_product(a ^ vec2u((a.x >> 27u) | (a.y << 5u), a.y >> 27u), vec2u(0x133111ebu, 0x94d049bbu));
    return b ^ vec2u((b.x >> 31u) | (b.y << 1u), b.y >> 31u);
}

// A walk's random numbers.
fn stack_seed(wo: vec3f, wi: vec3f) -> vec2u {
    var state = vec2u(0x7f4a7c15u, 0x9e3779b9u);
    state = stack_mixed(state ^ vec2u(bitcast<u32>(wo.x), 0u));
    state = stack_mixed(state ^ vec2u(bitcast<u32>(wo.y), 0u));
    state = stack_mixed(state ^ vec2u(bitcast<u32>(wo.z), 0u));
    state = stack_mixed(state ^ vec2u(bitcast<u32>(wi.x), 0u));
    state = stack_mixed(state ^ vec2u(bitcast<u32>(wi.y), 0u));
    return stack_mixed(state ^ vec2u(bitcast<u32>(wi.z), 0u));
}

fn stack_next(state: ptr<function, vec2u>) -> f32 {
    let low = (*state).x + 0x7f4a7c15u;
    *state = vec2u(low, (*state).y + 0x9e3779b9u + select(0u, 1u, low < 0x7f4a7c15u));
    return f32(stack_mixed(*state).y >> 8u) / 16777216.0;
}

fn stack_pair(state: ptr<function, vec2u>) -> vec2f {
    let first = stack_next(state);
    return vec2f(first, stack_next(state));
}

// Density with which light goes on at an angle of that cosine to where it went.
fn stack_phase(g: f32, cosine: f32) -> f32 {
    let t = max(1.0 + g * g - 2.0 * g * cosine, 1e-6);
    return (1.0 - g * g) / (2.0 * TAU * t * sqrt(t));
}

fn stack_sample_phase(g: f32, w: vec3f, u: vec2f) -> vec3f {
    var cosine = 1.0 - 2.0 * u.x;
    if abs(g) >= 1e-3 {
        let t = (1.0 - g * g) / (1.0 + g - 2.0 * g * u.x);
        cosine = clamp((1.0 + g * g - t * t) / (2.0 * g), -1.0, 1.0);
    }
    let sine = sqrt(max(1.0 - cosine * cosine, 0.0));
    let turn = math_turns(u.y);
    return normalize(frame_of(w) * vec3f(sine * turn.y, sine * turn.x, cosine));
}
