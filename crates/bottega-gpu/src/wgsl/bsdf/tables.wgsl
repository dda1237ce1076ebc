// Twin: `bottega-render/src/bsdf/tables.rs`.
//
// Directional albedos of rough layers: lookups in the tables that the CPU integrated.

// Two neighbouring nodes, and the weight of the second.
struct TablePlace {
    index: u32,
    fraction: f32,
}

// In place of a cosine: the mean over the cosine-weighted hemisphere.
const TABLE_MEAN: TablePlace = TablePlace(TABLE_MU, 0.0);

fn tables_place_new(position: f32, nodes: u32) -> TablePlace {
    let inside = clamp(position, 0.0, f32(nodes - 1u));
    let index = min(u32(inside), nodes - 2u);
    return TablePlace(index, inside - f32(index));
}

fn tables_mu_new(cosine: f32) -> TablePlace {
    return tables_place_new(sqrt(max(cosine, 0.0)) * f32(TABLE_MU - 1u), TABLE_MU);
}

// `position`: √roughness, or the position on the sheen's axis.
fn tables_rough_at(position: f32) -> TablePlace {
    return tables_place_new(position * f32(TABLE_ROUGH - 1u), TABLE_ROUGH);
}

fn tables_by_rough(first: u32, rough: TablePlace, mu: TablePlace) -> f32 {
    let a = tables_pick(first + rough.index, mu);
    return a + (tables_pick(first + rough.index + 1u, mu) - a) * rough.fraction;
}

fn tables_by_index(first: u32, index: TablePlace, rough: TablePlace, mu: TablePlace) -> f32 {
    let curve = first + TABLE_ROUGH * index.index;
    let a = tables_by_rough(curve, rough, mu);
    return a + (tables_by_rough(curve + TABLE_ROUGH, rough, mu) - a) * index.fraction;
}

fn tables_index_new(ior: f32) -> TablePlace {
    let most = (FRESNEL_IOR_MAX - 1.0) / (FRESNEL_IOR_MAX + 1.0);
    let root = sqrt(max((ior - 1.0) / (ior + 1.0) / most, 0.0));
    return tables_place_new(root * f32(TABLE_INDEX - 1u), TABLE_INDEX);
}

fn tables_pick(curve: u32, mu: TablePlace) -> f32 {
    let at = material_words[MATERIALS_CURVES] + TABLE_CURVE * curve + mu.index;
    let a = material_f32(at);
    return a + (material_f32(at + 1u) - a) * mu.fraction;
}

// Returns the sheen's maximum albedo over all cosines.
fn tables_sheen_peak(rough: TablePlace) -> f32 {
    let at = material_words[MATERIALS_CURVES] + TABLE_CURVE * (TABLE_SHEEN + rough.index) + TABLE_PEAK;
    let a = material_f32(at);
    return a + (material_f32(at + TABLE_CURVE) - a) * rough.fraction;
}
