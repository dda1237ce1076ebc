// Twin: `bottega-render/src/bsdf/beckmann.rs`.
//
// The Beckmann distribution of microfacet normals.

// A direction in the space where α is 1, the factor by which it grew, and its sine.
struct BeckmannStretched {
    direction: vec3f,
    size: f32,
    sine: f32,
}

fn beckmann_density(alpha: vec2f, h: vec3f) -> f32 {
    let cos2 = h.z * h.z;
    if cos2 < 1e-12 {
        return 0.0;
    }
    let slope = h.xy / alpha;
    return math_exp(-dot(slope, slope) / cos2) / (PI * alpha.x * alpha.y * cos2 * cos2);
}

fn beckmann_masking(alpha: vec2f, w: vec3f) -> f32 {
    let across = length(alpha * w.xy);
    let cosine = abs(w.z);
    if cosine >= 1.6 * across {
        return 1.0;
    }
    let a = cosine / across;
    return (3.535 * a + 2.181 * a * a) / (1.0 + 2.276 * a + 2.577 * a * a);
}

fn beckmann_visible_area(alpha: vec2f, w: vec3f) -> f32 {
    let s = beckmann_stretched(alpha, w);
    return s.size * beckmann_area_below(s, s.direction.z / max(s.sine, 1e-9));
}

fn beckmann_stretched(alpha: vec2f, w: vec3f) -> BeckmannStretched {
    let v = vec3f(alpha * w.xy, w.z);
    let size = length(v);
    let direction = v / size;
    return BeckmannStretched(direction, size, length(direction.xy));
}

// Samples a visible normal of the facets.
fn beckmann_sample_visible_normal(alpha: vec2f, wo: vec3f, u: vec2f) -> vec3f {
    let s = beckmann_stretched(alpha, wo);
    var slope = vec2f(0.0);
    if s.sine < 1e-4 {
        let turn = math_sin_cos_of_turns(u.y);
        slope = sqrt(max(-math_ln(1.0 - u.x), 0.0)) * turn.yx;
    } else {
        let along = beckmann_visible_slope(s, u.x);
        let across = beckmann_inverse_erf(2.0 * u.y - 1.0);
        let way = s.direction.xy / s.sine;
        slope = vec2f(way.x * along - way.y * across, way.y * along + way.x * across);
    }
    return normalize(vec3f(-alpha * slope, 1.0));
}

// ∫ from −∞ to x of (cos θ − t sin θ) e^(−t²) / √π dt.
fn beckmann_area_below(s: BeckmannStretched, x: f32) -> f32 {
    let near = clamp(x, -12.0, 12.0);
    return 0.5 * s.direction.z * (1.0 + beckmann_erf(near)) + s.sine * BECKMANN_HALF_RSQRT_PI * math_exp(-near * near);
}

// Samples the visible slope along the direction, by Newton's method in a shrinking bracket.
fn beckmann_visible_slope(s: BeckmannStretched, u: f32) -> f32 {
    let cot = s.direction.z / s.sine;
    let wanted = u * beckmann_area_below(s, cot);
    var low = -1.0;
    var high = beckmann_erf(min(cot, 12.0));
    var b = low + (high - low) * u;
    var x = beckmann_inverse_erf(b);
    for (var i = 0u; i < 16u; i++) {
        let excess = 0.5 * s.direction.z * (1.0 + b) + s.sine * BECKMANN_HALF_RSQRT_PI * math_exp(-x * x) - wanted;
        if abs(excess) < 1e-7 {
            break;
        }
        if excess < 0.0 {
            low = b;
        } else {
            high = b;
        }
        let slope = 0.5 * (s.direction.z - x * s.sine);
        let step = b - excess / select(slope, 1e-9, abs(slope) < 1e-9);
        b = select(0.5 * (low + high), step, step > low && step < high);
        x = beckmann_inverse_erf(b);
    }
    return x;
}

fn beckmann_erf(x: f32) -> f32 {
    let z = abs(x);
    let t = 1.0 / (1.0 + 0.3275911 * z);
    let sum = ((((1.0614054 * t - 1.453152) * t + 1.4214137) * t - 0.28449674) * t + 0.2548296) * t;
    let value = 1.0 - sum * math_exp(-z * z);
    return select(value, -value, x < 0.0);
}

fn beckmann_inverse_erf(value: f32) -> f32 {
    let y = clamp(value, -0.9999999, 0.9999999);
    let w = -math_ln((1.0 - y) * (1.0 + y));
    if w < 5.0 {
        let v = w - 2.5;
        return ((((((((2.8102264e-8 * v + 3.4327394e-7) * v - 3.5233877e-6) * v - 4.3915065e-6) * v + 0.00021858087) * v
            - 0.001253725) * v - 0.0041776816) * v + 0.24664073) * v + 1.5014094) * y;
    }
    let v = sqrt(w) - 3.0;
    return ((((((((-0.00020021426 * v + 0.00010095056) * v + 0.0013493432) * v - 0.0036734285) * v + 0.0057395076) * v
        - 0.0076224613) * v + 0.0094388705) * v + 1.001674) * v + 2.8329768) * y;
}
