// The scene's words (`bottega_render::flat`), and small helpers.

@group(0) @binding(2) var<storage, read> scene_words: array<u32>;

const NONE: u32 = 0xffffffffu;
// Stands for infinity.
const FAR: f32 = 3e38;

// Places of the header.
const AT_INSTANCES: u32 = 0u;
const AT_SPHERES: u32 = 1u;
const AT_LIGHTS: u32 = 2u;
const AT_LIGHT_COUNT: u32 = 3u;
const AT_TREE: u32 = 4u;
const AT_TREE_INTENSITY: u32 = 5u;
const AT_SHINING: u32 = 6u;
const AT_PARALLEL: u32 = 7u;
const AT_PARALLEL_COUNT: u32 = 8u;
const AT_ENVIRONMENT: u32 = 9u;
const AT_HAS_FAR: u32 = 10u;

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

// `x` with the sign of `sign`; 0 counts as positive.
fn with_sign(x: f32, sign: f32) -> f32 {
    return select(abs(x), -abs(x), sign < 0.0);
}

// The direction of a vector of any length, or else `fallback`.
fn direction_or(v: vec3<f32>, fallback: vec3<f32>) -> vec3<f32> {
    let size = math_max3(abs(v));
    if !(size > 0.0) || size > FAR {
        return fallback;
    }
    let w = v / size;
    return w / sqrt(dot(w, w));
}

// The length of a vector whose square may not be a number.
fn length_of(v: vec3<f32>) -> f32 {
    let size = math_max3(abs(v));
    if !(size > 0.0) {
        return 0.0;
    }
    let w = v / size;
    return size * sqrt(dot(w, w));
}

// Two unit vectors that make a right-handed frame with n (Duff et al. 2017).
struct Basis {
    s: vec3<f32>,
    t: vec3<f32>,
}

fn basis_of(n: vec3<f32>) -> Basis {
    let side = select(1.0, -1.0, n.z < 0.0);
    let a = -1.0 / (side + n.z);
    let b = n.x * n.y * a;
    return Basis(vec3(1.0 + side * n.x * n.x * a, side * b, -side * n.x), vec3(b, side + n.y * n.y * a, -n.y));
}
