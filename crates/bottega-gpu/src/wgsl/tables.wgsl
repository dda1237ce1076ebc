// How much of the light a rough layer sends on: lookups of the curves that the processor integrated. See `bsdf/tables.rs`.

// Numbers of a curve; the mean over the hemisphere, and the peak, are behind its 32 nodes of √μ.
const TABLE_CURVE: u32 = 34u;
const TABLE_PEAK: u32 = 33u;
const TABLE_MU: u32 = 32u;
const TABLE_ROUGH: u32 = 16u;
const TABLE_INDEX: u32 = 12u;
// First curves.
const TABLE_SINGLE: u32 = 0u;
const TABLE_SCHLICK: u32 = 16u;
const TABLE_RISE: u32 = 32u;
const TABLE_OUTSIDE: u32 = 224u;
const TABLE_INSIDE: u32 = 416u;
const TABLE_SHEEN: u32 = 608u;

// Two neighbouring nodes, and how near the second one is.
struct TablePlace {
    index: u32,
    fraction: f32,
}

// Stands for a cosine: the mean over the cosine-weighted hemisphere.
const TABLE_MEAN: TablePlace = TablePlace(32u, 0.0);

fn table_place(position: f32, nodes: u32) -> TablePlace {
    let inside = clamp(position, 0.0, f32(nodes - 1u));
    let index = min(u32(inside), nodes - 2u);
    return TablePlace(index, inside - f32(index));
}

fn table_mu(cosine: f32) -> TablePlace {
    return table_place(sqrt(max(cosine, 0.0)) * f32(TABLE_MU - 1u), TABLE_MU);
}

// `position`: √roughness, or the position along the axis of sheen.
fn table_rough(position: f32) -> TablePlace {
    return table_place(position * f32(TABLE_ROUGH - 1u), TABLE_ROUGH);
}

fn table_index(ior: f32) -> TablePlace {
    let most = (FRESNEL_IOR_MAX - 1.0) / (FRESNEL_IOR_MAX + 1.0);
    let root = sqrt(max((ior - 1.0) / (ior + 1.0) / most, 0.0));
    return table_place(root * f32(TABLE_INDEX - 1u), TABLE_INDEX);
}

fn table_pick(curve: u32, mu: TablePlace) -> f32 {
    let at = material_words[1] + TABLE_CURVE * curve + mu.index;
    let a = material_f32(at);
    return a + (material_f32(at + 1u) - a) * mu.fraction;
}

fn table_at(first: u32, rough: TablePlace, mu: TablePlace) -> f32 {
    let a = table_pick(first + rough.index, mu);
    return a + (table_pick(first + rough.index + 1u, mu) - a) * rough.fraction;
}

fn table_by_index(first: u32, index: TablePlace, rough: TablePlace, mu: TablePlace) -> f32 {
    let curve = first + TABLE_ROUGH * index.index;
    let a = table_at(curve, rough, mu);
    return a + (table_at(curve + TABLE_ROUGH, rough, mu) - a) * index.fraction;
}

// The largest albedo that sheen has at any cosine.
fn table_sheen_peak(rough: TablePlace) -> f32 {
    let at = material_words[1] + TABLE_CURVE * (TABLE_SHEEN + rough.index) + TABLE_PEAK;
    let a = material_f32(at);
    return a + (material_f32(at + TABLE_CURVE) - a) * rough.fraction;
}
