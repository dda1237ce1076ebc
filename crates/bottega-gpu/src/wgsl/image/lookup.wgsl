// Twin: `bottega-scene/src/image/lookup.rs`.
//
// Image lookups: wrapping, bilinear within a mip level, linear between levels; as `bottega_scene::Image::eval`.
//
// `texture_words`: the linear values of the 256 sRGB codes; then maps and images as `material/textures.rs` writes them.

// Derivatives of a lookup along u and v.
struct TextureSlopes {
    u: vec4f,
    v: vec4f,
}

struct TexturePlace {
    first: u32,
    second: u32,
    // Weight of the second level.
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

fn lookup_f32(at: u32) -> f32 {
    return bitcast<f32>(texture_words[at]);
}

fn lookup_vec2(at: u32) -> vec2f {
    return vec2f(lookup_f32(at), lookup_f32(at + 1u));
}

fn lookup_uv_set(map: u32) -> u32 {
    return texture_words[(map & TEXTURE_HANDLE) + MAP_FLAGS] & MAP_UV_SET;
}

// Returns one texel, linear; the texels of its level begin at `at`.
fn lookup_texel(format: u32, at: u32, index: u32) -> vec4f {
    let kind = format & IMAGE_FORMAT_MASK;
    if kind == TEXTURE_GRAY8 || kind == TEXTURE_RGBA8 {
        let is_gray = kind == TEXTURE_GRAY8;
        let word = texture_words[at + select(index, index >> 2u, is_gray)];
        let gray = vec3u((word >> ((index & 3u) * 8u)) & 0xffu);
        let code = select(vec3u(word & 0xffu, (word >> 8u) & 0xffu, (word >> 16u) & 0xffu), gray, is_gray);
        let alpha = select(f32(word >> 24u) / TEXEL_8_MAX, 1.0, is_gray);
        if (format >> IMAGE_SRGB_SHIFT) != 0u {
            return vec4f(lookup_f32(code.x), lookup_f32(code.y), lookup_f32(code.z), alpha);
        }
        return vec4f(vec3f(code) / TEXEL_8_MAX, alpha);
    }
    let is_short = kind == TEXTURE_RGBA16;
    let has_alpha = kind != TEXTURE_RGB32;
    let start = at + index * select(select(3u, 4u, has_alpha), 2u, is_short);
    var words = vec4u(texture_words[start], texture_words[start + 1u], 0u, 0u);
    if is_short {
        return vec4f(vec4u(words.x & 0xffffu, words.x >> 16u, words.y & 0xffffu, words.y >> 16u)) / TEXEL_16_MAX;
    }
    words.z = texture_words[start + 2u];
    words.w = bitcast<u32>(1.0);
    if has_alpha {
        words.w = texture_words[start + 3u];
    }
    return bitcast<vec4f>(words);
}

// The texels that a lookup reads from one level: one, or the four around a point, upper row first.
struct TextureTaps {
    start: u32,
    texels: vec4u,
    count: u32,
    // Weights of the second column and row.
    u: f32,
    v: f32,
}

// Returns a lookup of a single texel.
fn lookup_one(start: u32, texel: u32) -> TextureTaps {
    return TextureTaps(start, vec4u(texel), 1u, 0.0, 0.0);
}

// Reads all texels of a lookup in one piece of code: it is long, and compilers inline it at each call. A single texel has three
// more of value 0, which have no weight.
fn lookup_quad(format: u32, taps: TextureTaps) -> TextureQuad {
    var quad = TextureQuad(vec4f(0.0), vec4f(0.0), vec4f(0.0), vec4f(0.0), taps.u, taps.v);
    var texels = taps.texels;
    for (var i = 0u; i < taps.count; i++) {
        let value = lookup_texel(format, taps.start, texels.x);
        texels = texels.yzwx;
        quad.a = select(quad.a, value, i == 0u);
        quad.b = select(quad.b, value, i == 1u);
        quad.c = select(quad.c, value, i == 2u);
        quad.d = select(quad.d, value, i == 3u);
    }
    return quad;
}

// Returns the linear RGBA of a map; `footprint`: width of the lookup in units of `uv`.
fn image_eval(handle: u32, uv: vec2f, footprint: f32) -> vec4f {
    let map = handle & TEXTURE_HANDLE;
    let image = texture_words[map + MAP_IMAGE];
    let flags = texture_words[map + MAP_FLAGS];
    let at = lookup_place(map, uv);
    let format = texture_words[image + IMAGE_FORMAT];
    let last = texture_words[image + IMAGE_LEVEL_COUNT] - 1u;
    let levels = image + IMAGE_WORDS;
    let detail = lookup_level_of_detail(map, footprint);
    let level = min(u32(max(detail, 0.0)), last);
    let is_last = detail > 0.0 && level >= last;
    let is_nearest = detail <= 0.0 && (flags & MAP_SMOOTH) == 0u;
    let rest = select(max(detail, 0.0) - f32(level), 0.0, is_last);
    var value = vec4f(0.0);
    for (var i = 0u; i < 2u; i++) {
        let place = levels + LEVEL_WORDS * (level + i);
        var taps: TextureTaps;
        if is_last {
            taps = lookup_one(texture_words[place + LEVEL_TEXELS], 0u);
        } else if is_nearest {
            taps = lookup_nearest(place, flags, at);
        } else {
            taps = lookup_around(place, flags, at);
        }
        let q = lookup_quad(format, taps);
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

// Returns the derivatives of `image_eval` along u and v.
fn image_slopes(handle: u32, uv: vec2f, footprint: f32) -> TextureSlopes {
    let map = handle & TEXTURE_HANDLE;
    let image = texture_words[map + MAP_IMAGE];
    let flags = texture_words[map + MAP_FLAGS];
    let at = lookup_place(map, uv);
    let format = texture_words[image + IMAGE_FORMAT];
    let last = texture_words[image + IMAGE_LEVEL_COUNT] - 1u;
    let levels = image + IMAGE_WORDS;
    let detail = max(lookup_level_of_detail(map, footprint), 0.0);
    let level = u32(detail);
    let rest = detail - f32(level);
    if ((flags & MAP_SMOOTH) == 0u && detail == 0.0) || (level >= last && detail > 0.0) {
        return TextureSlopes(vec4f(0.0), vec4f(0.0));
    }
    // Every other copy of a mirrored image is reversed.
    let turned_u = ((flags >> MAP_WRAP_U_SHIFT) & MAP_WRAP_MASK) == TEXTURE_WRAP_MIRROR && lookup_fraction(0.5 * at.x) > 0.5;
    let turned_v = ((flags >> MAP_WRAP_V_SHIFT) & MAP_WRAP_MASK) == TEXTURE_WRAP_MIRROR && lookup_fraction(0.5 * at.y) > 0.5;
    var along_x = vec4f(0.0);
    var along_y = vec4f(0.0);
    for (var i = 0u; i < 2u; i++) {
        let place = levels + LEVEL_WORDS * (level + i);
        let q = lookup_quad(format, lookup_around(place, flags, at));
        let width = f32(texture_words[place + LEVEL_WIDTH]) * select(1.0, -1.0, turned_u);
        let height = f32(texture_words[place + LEVEL_HEIGHT]) * select(1.0, -1.0, turned_v);
        let x = ((q.b - q.a) * (1.0 - q.v) + (q.d - q.c) * q.v) * width;
        let y = ((q.c - q.a) * (1.0 - q.u) + (q.d - q.b) * q.u) * height;
        along_x = select(x, along_x + (x - along_x) * rest, i == 1u);
        along_y = select(y, along_y + (y - along_y) * rest, i == 1u);
        if rest == 0.0 {
            break;
        }
    }
    let x_axis = lookup_vec2(map + MAP_X_AXIS);
    let y_axis = lookup_vec2(map + MAP_Y_AXIS);
    return TextureSlopes(along_x * x_axis.x + along_y * x_axis.y, along_x * y_axis.x + along_y * y_axis.y);
}

// Returns log₂ of the footprint in texels of the finest level, linear between powers of two as on the CPU.
fn lookup_level_of_detail(map: u32, footprint: f32) -> f32 {
    if !(footprint > 0.0) {
        return 0.0;
    }
    let width = min(footprint, 1e9);
    let bits = bitcast<u32>(min(lookup_f32(map + MAP_TEXELS_SQUARED) * width * width, TEXELS_SQUARED_MAX));
    return 0.5 * (f32(i32(bits >> 23u) - 127) + f32(bits & 0x7fffffu) * (1.0 / 8388608.0));
}

fn lookup_place(map: u32, uv: vec2f) -> vec2f {
    let x_axis = lookup_vec2(map + MAP_X_AXIS);
    let y_axis = lookup_vec2(map + MAP_Y_AXIS);
    return x_axis * uv.x + y_axis * uv.y + lookup_vec2(map + MAP_OFFSET);
}

// Wraps a texture coordinate to [0, 1].
fn lookup_wrapped(x: f32, wrap: u32) -> f32 {
    switch wrap {
        case TEXTURE_WRAP_REPEAT: {
            return lookup_fraction(x);
        }
        case TEXTURE_WRAP_MIRROR: {
            let phase = 2.0 * lookup_fraction(0.5 * x);
            return select(phase, 2.0 - phase, phase > 1.0);
        }
        default: {
            return clamp(x, 0.0, 1.0);
        }
    }
}

// Returns x − ⌊x⌋, or 0 for floats without a fraction.
fn lookup_fraction(x: f32) -> f32 {
    if abs(x) < 8388608.0 {
        let rest = x - trunc(x);
        return select(rest, rest + 1.0, rest < 0.0);
    }
    return 0.0;
}

fn lookup_neighbors(x: f32, wrap: u32, size: u32) -> TexturePlace {
    let last = i32(size) - 1;
    let center = lookup_wrapped(x, wrap) * f32(size) + 0.5;
    let second = min(i32(center), last + 1);
    let first = second - 1;
    let weight = center - f32(second);
    if wrap == TEXTURE_WRAP_REPEAT {
        return TexturePlace(u32(select(first, last, first < 0)), u32(select(second, 0, second > last)), weight);
    }
    return TexturePlace(u32(max(first, 0)), u32(min(second, last)), weight);
}

// Returns the four texels around a point. `level`: the place of its record.
fn lookup_around(level: u32, flags: u32, at: vec2f) -> TextureTaps {
    let width = texture_words[level + LEVEL_WIDTH];
    let x = lookup_neighbors(at.x, (flags >> MAP_WRAP_U_SHIFT) & MAP_WRAP_MASK, width);
    let y = lookup_neighbors(at.y, (flags >> MAP_WRAP_V_SHIFT) & MAP_WRAP_MASK, texture_words[level + LEVEL_HEIGHT]);
    let upper = y.first * width;
    let lower = y.second * width;
    let texels = vec4u(upper + x.first, upper + x.second, lower + x.first, lower + x.second);
    return TextureTaps(texture_words[level + LEVEL_TEXELS], texels, 4u, x.weight, y.weight);
}

// Returns the nearest texel.
fn lookup_nearest(level: u32, flags: u32, at: vec2f) -> TextureTaps {
    let size = vec2u(texture_words[level + LEVEL_WIDTH], texture_words[level + LEVEL_HEIGHT]);
    let inside = vec2f(lookup_wrapped(at.x, (flags >> MAP_WRAP_U_SHIFT) & MAP_WRAP_MASK), lookup_wrapped(at.y, (flags >> MAP_WRAP_V_SHIFT) & MAP_WRAP_MASK));
    let texel = min(vec2u(inside * vec2f(size)), size - 1u);
    return lookup_one(texture_words[level + LEVEL_TEXELS], texel.y * size.x + texel.x);
}
