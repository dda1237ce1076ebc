// Twin: `bottega-render/src/sampler.rs`.
//
// The random numbers of a path, bit-identical to the CPU's sampler. 64-bit numbers are a low and a high word.

// The state that determines the numbers of one sample of one pixel.
struct Sampler {
    pixel_key: vec2<u32>,
    sample_index: u32,
}

fn add64(a: vec2<u32>, b: vec2<u32>) -> vec2<u32> {
    let low = a.x + b.x;
    return vec2(low, a.y + b.y + select(0u, 1u, low < a.x));
}

fn high_product(a: u32, b: u32) -> u32 {
    let al = a & 0xffffu;
    let ah = a >> 16u;
    let bl = b & 0xffffu;
    let bh = b >> 16u;
    let lh = al * bh;
    let hl = ah * bl;
    let middle = ((al * bl) >> 16u) + (lh & 0xffffu) + (hl & 0xffffu);
    return ah * bh + (lh >> 16u) + (hl >> 16u) + (middle >> 16u);
}

fn mul64(a: vec2<u32>, b: vec2<u32>) -> vec2<u32> {
    return vec2(a.x * b.x, high_product(a.x, b.x) + a.x * b.y + a.y * b.x);
}

fn xor_shifted(x: vec2<u32>, bits: u32) -> vec2<u32> {
    return x ^ vec2((x.x >> bits) | (x.y << (32u - bits)), x.y >> bits);
}

fn dimension_set_light(depth: u32) -> u32 {
    return 1u + 2u * depth;
}

fn dimension_set_scattering(depth: u32) -> u32 {
    return 2u + 2u * depth;
}

fn pixel_sampler_new(x: u32, y: u32, sample_index: u32) -> Sampler {
    return Sampler(sampler_mix(batch.mixed_seed ^ vec2(x, y)), sample_index);
}

// Returns a point of the first four dimensions of the Sobol' sequence, by the table at the front of the batch.
fn sobol_reversed(reversed_index: u32) -> vec4<u32> {
    var point = vec4<u32>(0u);
    for (var group = 0u; group < SOBOL_GROUPS; group += 1u) {
        let at = SOBOL_DIMENSIONS * (SOBOL_VALUES * group + ((reversed_index >> (SOBOL_BITS * group)) & (SOBOL_VALUES - 1u)));
        point ^= vec4(batch_words[at], batch_words[at + 1u], batch_words[at + 2u], batch_words[at + 3u]);
    }
    return point;
}

fn quad(from_pixel: Sampler, dimensions: u32) -> vec4<f32> {
    return scrambled_point(from_pixel, dimensions, reverseBits(from_pixel.sample_index));
}

fn split_quad(from_pixel: Sampler, dimensions: u32, part: u32, part_count: u32) -> vec4<f32> {
    return scrambled_point(from_pixel, dimensions, reverseBits(from_pixel.sample_index * part_count + part));
}

fn hashed(from_pixel: Sampler, key: vec2<u32>) -> f32 {
    return unit_interval(sampler_mix(sampler_mix(from_pixel.pixel_key ^ key) ^ vec2(from_pixel.sample_index, 0u)).y);
}

fn scrambled_point(from_pixel: Sampler, dimensions: u32, reversed_index: u32) -> vec4<f32> {
    let key = sampler_mix(add64(from_pixel.pixel_key, mul64(vec2(dimensions, 0u), vec2(0x7f4a7c15u, 0x9e3779b9u))));
    let point = sobol_reversed(owen_scramble_reversed(reversed_index, key.y));
    var numbers = vec4<f32>(0.0);
    for (var d = 0u; d < 4u; d += 1u) {
        var seed = key.x + d * 0x9e3779b9u;
        seed = (seed ^ (seed >> 16u)) * 0x7feb352du;
        seed = (seed ^ (seed >> 15u)) * 0x846ca68bu;
        seed = seed ^ (seed >> 16u);
        numbers[d] = unit_interval(reverseBits(owen_scramble_reversed(point[d], seed)));
    }
    return numbers;
}

fn unit_interval(bits: u32) -> f32 {
    return f32(bits >> 8u) * (1.0 / 16777216.0);
}

// The finalizer of SplitMix64.
fn sampler_mix(x: vec2<u32>) -> vec2<u32> {
    let y = mul64(xor_shifted(x, 30u), vec2(0x1ce4e5b9u, 0xbf58476du));
    let z = mul64(xor_shifted(y, 27u), vec2(0x133111ebu, 0x94d049bbu));
    return xor_shifted(z, 31u);
}

fn owen_scramble_reversed(value: u32, seed: u32) -> u32 {
    var x = value;
    x ^= x * 0x3d20adeau;
    x += seed;
    x *= (seed >> 16u) | 1u;
    x ^= x * 0x05526c56u;
    return x ^ (x * 0x53a22864u);
}
