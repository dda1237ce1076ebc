// Twin: `bottega-render/src/bsdf/cover.rs`.
//
// The transmittance of a rough dielectric boundary to a matte base, from curves that `material/covers.rs` wrote.

struct Cover {
    // The curve of the lower node of α, and the weight of the next node.
    at: u32,
    fraction: f32,
    // Words to the curve of the next thickness, and its weight.
    stride: u32,
    deeper: f32,
}

fn cover_new(block: u32, alpha: vec2f, thickness: f32) -> Cover {
    let first = material_words[block + COVER_BLOCK_FIRST_NODE];
    let count = material_words[block + COVER_BLOCK_NODE_COUNT];
    let position = min(sqrt(max(sqrt(alpha.x * alpha.y), 0.0)), 1.0) * f32(COVER_NODES - 1u);
    let node = clamp(u32(position), first, first + count - 2u);
    let stride = count * COVER_CURVE;
    var cover = Cover(block + COVER_BLOCK_WORDS + (node - first) * COVER_CURVE, position - f32(node), stride, 0.0);
    let slots = material_words[block + COVER_BLOCK_SLOT_COUNT];
    if slots > 1u {
        let least = f32(bitcast<i32>(material_words[block + COVER_BLOCK_FIRST_STEP]));
        let thinnest = math_exp2(least / COVER_STEPS_PER_OCTAVE);
        var slot = thickness / thinnest;
        if thickness > thinnest {
            slot = 1.0 + COVER_STEPS_PER_OCTAVE * math_log2(thickness) - least;
        }
        let below = min(u32(max(slot, 0.0)), slots - 2u);
        cover.at += below * stride;
        cover.deeper = clamp(slot - f32(below), 0.0, 1.0);
    }
    return cover;
}

fn cover_value(cover: Cover, index: u32) -> f32 {
    let at = cover.at + index;
    let a = material_f32(at);
    let value = a + (material_f32(at + COVER_CURVE) - a) * cover.fraction;
    if cover.deeper == 0.0 {
        return value;
    }
    let b = material_f32(at + cover.stride);
    let deep = b + (material_f32(at + cover.stride + COVER_CURVE) - b) * cover.fraction;
    return value + (deep - value) * cover.deeper;
}

// Returns the transmittance to the base at a cosine.
fn cover_through(cover: Cover, cosine: f32) -> f32 {
    let position = clamp(cosine, 0.0, 1.0) * f32(COVER_COSINES - 1u);
    let index = min(u32(position), COVER_COSINES - 2u);
    let a = cover_value(cover, index);
    return a + (cover_value(cover, index + 1u) - a) * (position - f32(index));
}

// Returns the fraction of diffuse light from the base that is reflected back to it.
fn cover_back(cover: Cover) -> f32 {
    return cover_value(cover, COVER_COSINES);
}
