// Looking a picture up: wrapping, bilinear within a mip level, linear between levels; as `bottega_scene::Image::eval`.
//
// `texture_words`: the linear values of the 256 codes of sRGB; then maps and pictures as `material/textures.rs` writes them.

const TEXTURE_GRAY8: u32 = 0u;
const TEXTURE_RGBA8: u32 = 1u;
const TEXTURE_RGBA16: u32 = 2u;
const TEXTURE_RGB32: u32 = 3u;
const TEXTURE_WRAP_REPEAT: u32 = 0u;
const TEXTURE_WRAP_MIRROR: u32 = 1u;
// Handles of maps carry a channel in their lowest bits.
const TEXTURE_HANDLE: u32 = 0xfffffff8u;

// By how much a lookup grows with u and with v.
struct TextureSlopes {
    u: vec4f,
    v: vec4f,
}

struct TexturePlace {
    first: u32,
    second: u32,
    // Of the second.
    weight: f32,
}

struct TextureQuad {
    a: vec4f,
    b: vec4f,
    c: vec4f,
    d: vec4f,
    // Weights of the second column and row.
    u: f32,
    v: f32,
}

fn texture_f32(at: u32) -> f32 {
    return bitcast<f32>(texture_words[at]);
}

fn texture_uv_set(map: u32) -> u32 {
    return texture_words[(map & TEXTURE_HANDLE) + 1u] & 1u;
}

// One texel of a level whose texels begin at `at`, linear.
fn texture_texel(format: u32, at: u32, index: u32) -> vec4f {
    let is_srgb = (format >> 8u) != 0u;
    switch format & 0xffu {
        case TEXTURE_GRAY8: {
            let code = (texture_words[at + (index >> 2u)] >> ((index & 3u) * 8u)) & 0xffu;
            if is_srgb {
                return vec4f(vec3f(texture_f32(code)), 1.0);
            }
            return vec4f(vec3f(f32(code) / 255.0), 1.0);
        }
        case TEXTURE_RGBA8: {
            let word = texture_words[at + index];
            let code = vec4u(word & 0xffu, (word >> 8u) & 0xffu, (word >> 16u) & 0xffu, word >> 24u);
            let alpha = f32(code.w) / 255.0;
            if is_srgb {
                return vec4f(texture_f32(code.x), texture_f32(code.y), texture_f32(code.z), alpha);
            }
            return vec4f(vec3f(code.xyz) / 255.0, alpha);
        }
        case TEXTURE_RGBA16: {
            let low = texture_words[at + 2u * index];
            let high = texture_words[at + 2u * index + 1u];
            return vec4f(vec4u(low & 0xffffu, low >> 16u, high & 0xffffu, high >> 16u)) / 65535.0;
        }
        case TEXTURE_RGB32: {
            let start = at + 3u * index;
            return vec4f(texture_f32(start), texture_f32(start + 1u), texture_f32(start + 2u), 1.0);
        }
        default: {
            let start = at + 4u * index;
            return vec4f(texture_f32(start), texture_f32(start + 1u), texture_f32(start + 2u), texture_f32(start + 3u));
        }
    }
}

// x − ⌊x⌋, or 0 where a float has no fraction any more.
fn texture_fraction(x: f32) -> f32 {
    if abs(x) < 8388608.0 {
        let rest = x - trunc(x);
        return select(rest, rest + 1.0, rest < 0.0);
    }
    return 0.0;
}

// A texture coordinate brought into [0, 1].
fn texture_wrapped(x: f32, wrap: u32) -> f32 {
    switch wrap {
        case TEXTURE_WRAP_REPEAT: {
            return texture_fraction(x);
        }
        case TEXTURE_WRAP_MIRROR: {
            let phase = 2.0 * texture_fraction(0.5 * x);
            return select(phase, 2.0 - phase, phase > 1.0);
        }
        default: {
            return clamp(x, 0.0, 1.0);
        }
    }
}

fn texture_neighbors(x: f32, wrap: u32, size: u32) -> TexturePlace {
    let last = i32(size) - 1;
    let center = texture_wrapped(x, wrap) * f32(size) + 0.5;
    let second = min(i32(center), last + 1);
    let first = second - 1;
    let weight = center - f32(second);
    if wrap == TEXTURE_WRAP_REPEAT {
        return TexturePlace(u32(select(first, last, first < 0)), u32(select(second, 0, second > last)), weight);
    }
    return TexturePlace(u32(max(first, 0)), u32(min(second, last)), weight);
}

// The four texels around a point, upper row first. `level`: the place of its record.
fn texture_around(format: u32, level: u32, flags: u32, at: vec2f) -> TextureQuad {
    let start = texture_words[level];
    let width = texture_words[level + 1u];
    let x = texture_neighbors(at.x, (flags >> 2u) & 3u, width);
    let y = texture_neighbors(at.y, (flags >> 4u) & 3u, texture_words[level + 2u]);
    var quad: TextureQuad;
    quad.a = texture_texel(format, start, y.first * width + x.first);
    quad.b = texture_texel(format, start, y.first * width + x.second);
    quad.c = texture_texel(format, start, y.second * width + x.first);
    quad.d = texture_texel(format, start, y.second * width + x.second);
    quad.u = x.weight;
    quad.v = y.weight;
    return quad;
}

fn texture_nearest(format: u32, level: u32, flags: u32, at: vec2f) -> vec4f {
    let size = vec2u(texture_words[level + 1u], texture_words[level + 2u]);
    let inside = vec2f(texture_wrapped(at.x, (flags >> 2u) & 3u), texture_wrapped(at.y, (flags >> 4u) & 3u));
    let texel = min(vec2u(inside * vec2f(size)), size - 1u);
    return texture_texel(format, texture_words[level], texel.y * size.x + texel.x);
}

// log₂ of the footprint in texels of the finest level, linear between powers of two as on the processor.
fn texture_detail(map: u32, footprint: f32) -> f32 {
    if !(footprint > 0.0) {
        return 0.0;
    }
    let width = min(footprint, 1e9);
    let bits = bitcast<u32>(min(texture_f32(map + 8u) * width * width, 1e37));
    return 0.5 * (f32(i32(bits >> 23u) - 127) + f32(bits & 0x7fffffu) * (1.0 / 8388608.0));
}

fn texture_place(map: u32, uv: vec2f) -> vec2f {
    let x_axis = vec2f(texture_f32(map + 2u), texture_f32(map + 3u));
    let y_axis = vec2f(texture_f32(map + 4u), texture_f32(map + 5u));
    return x_axis * uv.x + y_axis * uv.y + vec2f(texture_f32(map + 6u), texture_f32(map + 7u));
}

// Linear RGBA of the picture as a map lays it on a surface; `footprint`: width of the lookup in units of `uv`.
fn texture_eval(handle: u32, uv: vec2f, footprint: f32) -> vec4f {
    let map = handle & TEXTURE_HANDLE;
    let image = texture_words[map];
    let flags = texture_words[map + 1u];
    let at = texture_place(map, uv);
    let format = texture_words[image];
    let last = texture_words[image + 1u] - 1u;
    let levels = image + 2u;
    let detail = texture_detail(map, footprint);
    var level = 0u;
    var rest = 0.0;
    if detail > 0.0 {
        level = u32(detail);
        rest = detail - f32(level);
        if level >= last {
            return texture_texel(format, texture_words[levels + 3u * last], 0u);
        }
    } else if (flags & 2u) == 0u {
        return texture_nearest(format, levels, flags, at);
    }
    var value = vec4f(0.0);
    // Both levels by the same code: it is long.
    for (var i = 0u; i < 2u; i++) {
        let q = texture_around(format, levels + 3u * (level + i), flags, at);
        let upper = q.a * (1.0 - q.u) + q.b * q.u;
        let lower = q.c * (1.0 - q.u) + q.d * q.u;
        let here = upper * (1.0 - q.v) + lower * q.v;
        value = select(here, value + (here - value) * rest, i == 1u);
        if rest == 0.0 {
            break;
        }
    }
    return value;
}

// By how much `texture_eval` grows with u and with v.
fn texture_slopes(handle: u32, uv: vec2f, footprint: f32) -> TextureSlopes {
    let map = handle & TEXTURE_HANDLE;
    let image = texture_words[map];
    let flags = texture_words[map + 1u];
    let at = texture_place(map, uv);
    let format = texture_words[image];
    let last = texture_words[image + 1u] - 1u;
    let levels = image + 2u;
    let detail = max(texture_detail(map, footprint), 0.0);
    let level = u32(detail);
    let rest = detail - f32(level);
    if ((flags & 2u) == 0u && detail == 0.0) || (level >= last && detail > 0.0) {
        return TextureSlopes(vec4f(0.0), vec4f(0.0));
    }
    // Every other copy of a mirrored picture is turned round.
    let turned_u = ((flags >> 2u) & 3u) == TEXTURE_WRAP_MIRROR && texture_fraction(0.5 * at.x) > 0.5;
    let turned_v = ((flags >> 4u) & 3u) == TEXTURE_WRAP_MIRROR && texture_fraction(0.5 * at.y) > 0.5;
    var along_x = vec4f(0.0);
    var along_y = vec4f(0.0);
    for (var i = 0u; i < 2u; i++) {
        let place = levels + 3u * (level + i);
        let q = texture_around(format, place, flags, at);
        let width = f32(texture_words[place + 1u]) * select(1.0, -1.0, turned_u);
        let height = f32(texture_words[place + 2u]) * select(1.0, -1.0, turned_v);
        let x = ((q.b - q.a) * (1.0 - q.v) + (q.d - q.c) * q.v) * width;
        let y = ((q.c - q.a) * (1.0 - q.u) + (q.d - q.b) * q.u) * height;
        along_x = select(x, along_x + (x - along_x) * rest, i == 1u);
        along_y = select(y, along_y + (y - along_y) * rest, i == 1u);
        if rest == 0.0 {
            break;
        }
    }
    let x_axis = vec2f(texture_f32(map + 2u), texture_f32(map + 3u));
    let y_axis = vec2f(texture_f32(map + 4u), texture_f32(map + 5u));
    return TextureSlopes(along_x * x_axis.x + along_y * x_axis.y, along_x * y_axis.x + along_y * y_axis.y);
}
