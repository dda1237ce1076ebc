// What a material is beside its scattering. `material_words` is laid out by `material/encode.rs`: a head of 8 words, 32 words
// for each material, then surfaces and tables.

const MATERIAL_HEADS: u32 = 8u;
const MATERIAL_STRIDE: u32 = 32u;

const MATERIAL_HAS_OPACITY: u32 = 1u;
const MATERIAL_NULL: u32 = 2u;
const MATERIAL_UNLIT: u32 = 4u;
const MATERIAL_SHINES: u32 = 8u;
const MATERIAL_TRANSMITS: u32 = 16u;
const MATERIAL_KEEPS_MEDIUM: u32 = 32u;
const MATERIAL_NEEDS_TANGENTS: u32 = 64u;
const MATERIAL_TEXTURED: u32 = 128u;
const MATERIAL_EMITS_FRONT: u32 = 256u;
const MATERIAL_EMITS_BACK: u32 = 512u;
const MATERIAL_BLENDED: u32 = 1024u;
const MATERIAL_HAS_RELIEF: u32 = 2048u;
const MATERIAL_HAS_COAT: u32 = 4096u;
const MATERIAL_HAS_ANISOTROPY: u32 = 8192u;
const MATERIAL_LAYERED: u32 = 16384u;
// How alpha is read; neither: it is not.
const MATERIAL_MASKS: u32 = 32768u;
const MATERIAL_BLENDS_ALPHA: u32 = 65536u;

fn material_word(at: u32) -> u32 {
    return material_words[at];
}

fn material_f32(at: u32) -> f32 {
    return bitcast<f32>(material_words[at]);
}

fn material_vec3(at: u32) -> vec3f {
    return vec3f(material_f32(at), material_f32(at + 1u), material_f32(at + 2u));
}

fn material_head(material: u32) -> u32 {
    return MATERIAL_HEADS + MATERIAL_STRIDE * material;
}

fn material_flags(material: u32) -> u32 {
    return material_words[material_head(material)];
}

// A colour (or in x a number): its factor, times a texture where there is one.
fn param_value(at: u32, uv0: vec2f, uv1: vec2f, footprint: f32) -> vec3f {
    let factor = material_vec3(at);
    let handle = material_words[at + 3u];
    if !HAS_TEXTURES || handle == 0u {
        return factor;
    }
    let texel = texture_eval(handle, select(uv0, uv1, texture_uv_set(handle) == 1u), footprint);
    switch handle & 7u {
        case 0u: { return factor * texel.x; }
        case 1u: { return factor * texel.y; }
        case 2u: { return factor * texel.z; }
        case 3u: { return factor * texel.w; }
        default: { return factor * texel.xyz; }
    }
}

// Probability that the surface is there; see `Material::opacity_at`.
fn material_opacity(material: u32, uv0: vec2f, uv1: vec2f, footprint: f32, vertex_alpha: f32) -> f32 {
    let head = material_head(material);
    let flags = material_words[head];
    if (flags & (MATERIAL_MASKS | MATERIAL_BLENDS_ALPHA)) == 0u {
        return 1.0;
    }
    let alpha = vertex_alpha * param_value(head + 4u, uv0, uv1, footprint).x;
    if (flags & MATERIAL_MASKS) != 0u {
        return select(0.0, 1.0, alpha >= material_f32(head + 3u));
    }
    return clamp(alpha, 0.0, 1.0);
}

// Radiance that the surface emits, on those sides that its flags tell of.
fn material_emission(material: u32, uv0: vec2f, uv1: vec2f, footprint: f32) -> vec3f {
    return param_value(material_head(material) + 8u, uv0, uv1, footprint);
}

// What an unlit surface shows, before vertex colours.
fn material_unlit(material: u32, uv0: vec2f, uv1: vec2f, footprint: f32) -> vec3f {
    return param_value(material_head(material) + 28u, uv0, uv1, footprint);
}

// Absorption per unit of distance behind the front or before it.
fn material_absorption(material: u32, behind_front: bool) -> vec3f {
    return material_vec3(material_head(material) + select(12u, 16u, behind_front));
}

// The record of what scatters on a side; 0: nothing does.
fn material_surface(material: u32, front: bool) -> u32 {
    return material_words[material_head(material) + select(2u, 1u, front)];
}
