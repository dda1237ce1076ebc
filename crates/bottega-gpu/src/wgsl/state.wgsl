// What the kernels of paths share: the batch, the state of every path under way, and the queues between kernels.

struct Batch {
    // Of the seed.
    mixed_seed: vec2<u32>,
    // Paths that there is room for, and those of this pass.
    capacity: u32,
    path_count: u32,
    // Number of the first path of this pass among all of the batch.
    first_path: u32,
    job_count: u32,
    pixel_count: u32,
    // Place of the picture and of the jobs among the batch's words.
    picture_at: u32,
    jobs_at: u32,
    max_depth: u32,
    roulette_depth: u32,
    light_samples: u32,
    // 0: combined, 1: light sampling alone, 2: BSDF sampling alone.
    direct_light: u32,
    // Floats of a pixel, the last of them counting samples that were dropped, and where the values beside radiance are among
    // them; NONE: not kept.
    stride: u32,
    albedo_at: u32,
    normal_at: u32,
    depth_at: u32,
    padding: u32,
}

const COMBINED: u32 = 0u;
const LIGHT_SAMPLING: u32 = 1u;
const BSDF_SAMPLING: u32 = 2u;

@group(0) @binding(3) var<storage, read> batch_words: array<u32>;
@group(0) @binding(4) var<storage, read> material_words: array<u32>;
@group(0) @binding(5) var<storage, read> texture_words: array<u32>;
@group(0) @binding(6) var<uniform> batch: Batch;
@group(1) @binding(0) var<storage, read_write> state: array<vec4<u32>>;
@group(1) @binding(1) var<storage, read_write> queues: array<u32>;
@group(1) @binding(2) var<storage, read_write> control: array<atomic<u32>>;
@group(1) @binding(3) var<storage, read_write> sums: array<f32>;

// Fields of a path, each of them an array over all paths.
// Where the ray begins, and the width of its cone there.
const ORIGIN: u32 = 0u;
// Where it goes, and the growth of the cone.
const DIRECTION: u32 = 1u;
// What the path still carries, and the scale of its roulette.
const THROUGHPUT: u32 = 2u;
// What it found, and the density of the direction taken; −1: light sampling could not have found what comes.
const RADIANCE: u32 = 3u;
// Point for which lights were sampled; whether an albedo is still wanted (0 or 1).
const RECEIVER: u32 = 4u;
// Its normal; the factor with which the sample counts.
const RECEIVER_NORMAL: u32 = 5u;
// Absorption of the solid that the path is in.
const ABSORPTION: u32 = 6u;
// Key of the pixel (two words), index of the sample.
const KEY: u32 = 7u;
// The hit: t, u, v, number of the shape. Before the first one: how far the ray reaches, and how far from the camera it starts.
const HIT: u32 = 8u;
// Albedo, alpha.
const ALBEDO: u32 = 9u;
// Normal, depth; before the first surface is shaded, how far from the camera the ray starts.
const NORMAL: u32 = 10u;
// From here on, for each light sample: origin of the shadow ray and its end; its direction; what it brings.
const SHADOW: u32 = 11u;
const SHADOW_FIELDS: u32 = 3u;

// Queues, each as long as there is room for paths. Paths under way are in the first or the second by turns.
const ACTIVE_QUEUE: u32 = 0u;
const MISSED_QUEUE: u32 = 2u;
const LIT_QUEUE: u32 = 3u;
const MET_QUEUE: u32 = 4u;

fn bits(which: u32, path: u32) -> vec4<u32> {
    return state[which * batch.capacity + path];
}

fn set_bits(which: u32, path: u32, value: vec4<u32>) {
    state[which * batch.capacity + path] = value;
}

fn field(which: u32, path: u32) -> vec4<f32> {
    return bitcast<vec4<f32>>(bits(which, path));
}

fn set_field(which: u32, path: u32, value: vec4<f32>) {
    set_bits(which, path, bitcast<vec4<u32>>(value));
}

fn queued(queue: u32, index: u32) -> u32 {
    return queues[queue * batch.capacity + index];
}

fn push(queue: u32, counter: u32, path: u32) {
    queues[queue * batch.capacity + atomicAdd(&control[counter], 1u)] = path;
}

fn sampler_from(path: u32) -> Sampler {
    let key = bits(KEY, path);
    return Sampler(key.xy, key.z);
}
