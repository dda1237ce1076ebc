// No twin.
//
// The scene's words (`bottega_render::flat`), and small helpers.

@group(0) @binding(2) var<storage, read> scene_words: array<u32>;

fn number_at(at: u32) -> f32 {
    return bitcast<f32>(scene_words[at]);
}

fn vec2_at(at: u32) -> vec2<f32> {
    return vec2(number_at(at), number_at(at + 1u));
}

fn vec3_at(at: u32) -> vec3<f32> {
    return vec3(number_at(at), number_at(at + 1u), number_at(at + 2u));
}

fn vec4_at(at: u32) -> vec4<f32> {
    return vec4(number_at(at), number_at(at + 1u), number_at(at + 2u), number_at(at + 3u));
}

fn triple_at(at: u32) -> vec3<u32> {
    return vec3(scene_words[at], scene_words[at + 1u], scene_words[at + 2u]);
}

fn mat3_at(at: u32) -> mat3x3<f32> {
    return mat3x3<f32>(vec3_at(at), vec3_at(at + 3u), vec3_at(at + 6u));
}

fn luminance(color: vec3<f32>) -> f32 {
    return dot(color, vec3(0.2126, 0.7152, 0.0722));
}

fn is_black(color: vec3<f32>) -> bool {
    return all(color == vec3<f32>(0.0));
}

// Returns `x` with the sign of `sign`; 0 counts as positive.
fn with_sign(x: f32, sign: f32) -> f32 {
    return select(abs(x), -abs(x), sign < 0.0);
}

// Returns the unit vector of a vector of any length, or `fallback`.
fn direction_or(v: vec3<f32>, fallback: vec3<f32>) -> vec3<f32> {
    let size = math_max3(abs(v));
    if !(size > 0.0) || size > FAR {
        return fallback;
    }
    let w = v / size;
    return w / sqrt(dot(w, w));
}

// Returns the length of a vector whose square may overflow.
fn length_of(v: vec3<f32>) -> f32 {
    let size = math_max3(abs(v));
    if !(size > 0.0) {
        return 0.0;
    }
    let w = v / size;
    return size * sqrt(dot(w, w));
}
