// No twin.
//
// The state shared by the path kernels: the batch, the fields of every path under way, and the queues between kernels.

@group(0) @binding(3) var<storage, read> batch_words: array<u32>;
@group(0) @binding(4) var<storage, read> material_words: array<u32>;
@group(0) @binding(5) var<storage, read> texture_words: array<u32>;
@group(0) @binding(6) var<uniform> batch: BatchParams;
@group(1) @binding(0) var<storage, read_write> state: array<vec4<u32>>;
@group(1) @binding(1) var<storage, read_write> queues: array<u32>;
@group(1) @binding(2) var<storage, read_write> control: array<atomic<u32>>;
@group(1) @binding(3) var<storage, read_write> sums: array<f32>;

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
    let key = bits(PATH_KEY, path);
    return Sampler(key.xy, key.z);
}
