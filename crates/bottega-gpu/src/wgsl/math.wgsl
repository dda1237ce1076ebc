// Twin: `bottega-kernels/src/math.rs`.
//
// Elementary functions that WGSL leaves to the driver (a sine within 2⁻¹¹, a power within 16 units in the last place), computed
// by + − × ÷ as on the CPU, so that all devices agree to a few units in the last place.

// Returns sine and cosine of `turns` full turns, a number in [0, 1].
fn math_sin_cos_of_turns(turns: f32) -> vec2f {
    let quarters = 4.0 * turns;
    let nearest = i32(quarters + 0.5);
    let x = (quarters - f32(nearest)) * 1.57079633;
    let x2 = x * x;
    let s = x + x * x2 * (-1.6666655e-1 + x2 * (8.332161e-3 + x2 * -1.9515296e-4));
    let c = 1.0 - 0.5 * x2 + x2 * x2 * (4.1666646e-2 + x2 * (-1.3887316e-3 + x2 * 2.4433157e-5));
    let even = (nearest & 1) == 0;
    let sine = select(c, s, even);
    let cosine = select(s, c, even);
    return vec2f(select(sine, -sine, (nearest & 2) != 0), select(cosine, -cosine, ((nearest + 1) & 2) != 0));
}

fn math_exp(x: f32) -> f32 {
    return math_exp2(x * 1.44269504);
}

// Returns 2^x; 0 below the smallest normal number.
fn math_exp2(x: f32) -> f32 {
    if x < -126.0 {
        return 0.0;
    }
    let k = floor(min(x, 127.0) + 0.5);
    let r = min(x, 127.0) - k;
    let p = 1.0 + r * (0.69314718 + r * (0.240226507 + r * (0.0555041087
        + r * (0.00961812911 + r * (0.00133335581 + r * (0.000154035304 + r * 0.0000152527338))))));
    return p * bitcast<f32>(u32(clamp(i32(k), -126, 127) + 127) << 23u);
}

fn math_ln(x: f32) -> f32 {
    return math_log2(x) * 0.693147181;
}

// Returns the base-2 logarithm of a positive number.
fn math_log2(x: f32) -> f32 {
    // Cut at √½ so that the mantissa is around 1.
    let bits = bitcast<u32>(max(x, 1.2e-38));
    let above = bits - 0x3f3504f3u;
    let exponent = i32(above) >> 23u;
    let m = bitcast<f32>(bits - (u32(exponent) << 23u));
    let s = (m - 1.0) / (m + 1.0);
    let s2 = s * s;
    let p = 2.88539008 + s2 * (0.961796694 + s2 * (0.577077942 + s2 * (0.412209293 + s2 * (0.319903814 + s2 * 0.28293016))));
    return f32(exponent) + s * p;
}

// Returns x^y of a non-negative number; 0 for x = 0.
fn math_powf(x: f32, y: f32) -> f32 {
    if x <= 0.0 {
        return 0.0;
    }
    return math_exp2(y * math_log2(x));
}

// Returns the arc cosine of a number in [0, 1] (Abramowitz and Stegun 1964, 4.4.46).
fn math_acos(x: f32) -> f32 {
    let p = 1.570796305 + x * (-0.2145988016 + x * (0.0889789874 + x * (-0.0501743046
        + x * (0.0308918810 + x * (-0.0170881256 + x * (0.0066700901 + x * -0.0012624911))))));
    return sqrt(max(1.0 - x, 0.0)) * p;
}

// Returns 1 or −1; 1 for 0.
fn math_sign(x: f32) -> f32 {
    return select(1.0, -1.0, x < 0.0);
}

fn math_mean(color: vec3f) -> f32 {
    return (color.x + color.y + color.z) * (1.0 / 3.0);
}

fn math_max3(color: vec3f) -> f32 {
    return max(color.x, max(color.y, color.z));
}

fn math_min3(color: vec3f) -> f32 {
    return min(color.x, min(color.y, color.z));
}

// Returns the unit vector, or `other` for a zero vector.
fn math_normalize_or(v: vec3f, other: vec3f) -> vec3f {
    let length2 = dot(v, v);
    if length2 < 1e-30 {
        return other;
    }
    return v / sqrt(length2);
}
