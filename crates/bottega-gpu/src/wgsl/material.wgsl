// Twin: `bottega-scene/src/material.rs`.
//
// The properties of a material other than its BSDF. `material_words`: a header, a record per material, then surfaces and tables.

struct MaterialRelief {
    kind: u32,
    // Handle of the texture, with a channel in the lowest bits; 0: none.
    map: u32,
    // Scale of the x and y of normals, or of heights.
    scale: f32,
    // `true`: Mitsuba's rule, with the options below; `false`: the normal is bent until it is seen.
    mitsuba: bool,
    turns: bool,
    shadows: bool,
    mirrored: bool,
}

fn material_word(at: u32) -> u32 {
    return material_words[at];
}

fn material_f32(at: u32) -> f32 {
    return bitcast<f32>(material_words[at]);
}

fn material_vec2(at: u32) -> vec2f {
    return vec2f(material_f32(at), material_f32(at + 1u));
}

fn material_vec3(at: u32) -> vec3f {
    return vec3f(material_f32(at), material_f32(at + 1u), material_f32(at + 2u));
}

fn material_head(material: u32) -> u32 {
    return MATERIALS_WORDS + MATERIAL_WORDS * material;
}

fn material_flags(material: u32) -> u32 {
    return material_words[material_head(material) + MATERIAL_FLAGS];
}

// Returns a colour (or in x a number): its factor, times a texture if there is one.
fn color_param_eval(at: u32, uv0: vec2f, uv1: vec2f, footprint: f32) -> vec3f {
    let factor = material_vec3(at + PARAM_FACTOR);
    let handle = material_words[at + PARAM_TEXTURE];
    if !HAS_TEXTURES || handle == 0u {
        return factor;
    }
    let texel = image_eval(handle, select(uv0, uv1, lookup_uv_set(handle) == 1u), footprint);
    switch handle & CHANNEL_MASK {
        case CHANNEL_R: { return factor * texel.x; }
        case CHANNEL_G: { return factor * texel.y; }
        case CHANNEL_B: { return factor * texel.z; }
        case CHANNEL_A: { return factor * texel.w; }
        default: { return factor * texel.xyz; }
    }
}

// Returns the opacity; see `Material::opacity_at`.
fn material_opacity_at(material: u32, uv0: vec2f, uv1: vec2f, footprint: f32, vertex_alpha: f32) -> f32 {
    let head = material_head(material);
    let flags = material_words[head + MATERIAL_FLAGS];
    if (flags & (MATERIAL_MASKS | MATERIAL_BLENDS_ALPHA)) == 0u {
        return 1.0;
    }
    let alpha = vertex_alpha * color_param_eval(head + MATERIAL_OPACITY, uv0, uv1, footprint).x;
    if (flags & MATERIAL_MASKS) != 0u {
        return select(0.0, 1.0, alpha >= material_f32(head + MATERIAL_CUTOFF));
    }
    return clamp(alpha, 0.0, 1.0);
}

// Returns the emitted radiance, on the sides given by the flags.
fn material_emission(material: u32, uv0: vec2f, uv1: vec2f, footprint: f32) -> vec3f {
    return color_param_eval(material_head(material) + MATERIAL_EMISSION, uv0, uv1, footprint);
}

// Returns the colour of an unlit surface, before vertex colours.
fn material_unlit(material: u32, uv0: vec2f, uv1: vec2f, footprint: f32) -> vec3f {
    return color_param_eval(material_head(material) + MATERIAL_UNLIT_COLOR, uv0, uv1, footprint);
}

// Returns the absorption per unit of distance, inside or outside.
fn material_absorption(material: u32, behind_front: bool) -> vec3f {
    return material_vec3(material_head(material) + select(MATERIAL_EXTERIOR, MATERIAL_INTERIOR, behind_front));
}

// Returns the record of the surface on a side; 0: nothing scatters.
fn material_surface_of(material: u32, front: bool) -> u32 {
    return material_words[material_head(material) + select(MATERIAL_BACK, MATERIAL_FRONT, front)];
}

fn material_relief(material: u32) -> MaterialRelief {
    let head = material_head(material);
    let bits = material_words[head + MATERIAL_RELIEF];
    return MaterialRelief(bits & RELIEF_KIND_MASK, material_words[head + MATERIAL_RELIEF_MAP],
        material_f32(head + MATERIAL_RELIEF_SCALE), (bits & RELIEF_MITSUBA) != 0u,
        (bits & RELIEF_TURNS) != 0u, (bits & RELIEF_SHADOWS) != 0u, (bits & RELIEF_MIRRORED) != 0u);
}

// Returns the clear coat's normal map (0: the coat has the smooth normal of the surface), and its scale.
fn material_coat_map(material: u32) -> u32 {
    return material_words[material_head(material) + MATERIAL_COAT_MAP];
}

fn material_coat_scale(material: u32) -> f32 {
    return material_f32(material_head(material) + MATERIAL_COAT_SCALE);
}

// Returns the direction of stretched highlights, in the tangent frame (x along u, y up the image).
fn material_anisotropy_way(material: u32, uv0: vec2f, uv1: vec2f, footprint: f32) -> vec2f {
    let head = material_head(material);
    let handle = material_words[head + MATERIAL_ANISOTROPY_MAP];
    var way = vec2f(1.0, 0.0);
    if handle != 0u {
        let texel = image_eval(handle, select(uv0, uv1, lookup_uv_set(handle) == 1u), footprint);
        let drawn = 2.0 * texel.xy - 1.0;
        if dot(drawn, drawn) > 1e-30 {
            way = normalize(drawn);
        }
    }
    let turn = material_vec2(head + MATERIAL_ANISOTROPY_TURN);
    return vec2f(turn.x * way.x - turn.y * way.y, turn.y * way.x + turn.x * way.y);
}
