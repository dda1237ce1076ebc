// Between the kernels: how many groups of threads the next ones need. One thread.

@group(0) @binding(0) var<storage, read_write> control: array<atomic<u32>>;
@group(0) @binding(1) var<storage, read_write> groups: array<u32>;

const GROUP_SIZE: u32 = 64u;
// Places in `groups`, three words each.
const EXTEND: u32 = 0u;
const MISS: u32 = 1u;
const SHADOW: u32 = 2u;
const SHADE: u32 = 3u;

fn plan(kernel: u32, count: u32) {
    groups[3u * kernel] = (count + GROUP_SIZE - 1u) / GROUP_SIZE;
    groups[3u * kernel + 1u] = 1u;
    groups[3u * kernel + 2u] = 1u;
}

@compute @workgroup_size(1)
fn plan_extend() {
    plan(EXTEND, atomicLoad(&control[ACTIVE]));
}

@compute @workgroup_size(1)
fn plan_shade() {
    plan(MISS, atomicLoad(&control[MISSED]));
    plan(SHADE, atomicLoad(&control[MET]));
}

// One bounce is done.
@compute @workgroup_size(1)
fn plan_next() {
    let next = atomicLoad(&control[NEXT]);
    let lit = atomicLoad(&control[LIT]);
    plan(EXTEND, next);
    plan(SHADOW, lit);
    atomicStore(&control[ACTIVE], next);
    atomicStore(&control[LIT_NOW], lit);
    atomicStore(&control[NEXT], 0u);
    atomicStore(&control[MISSED], 0u);
    atomicStore(&control[LIT], 0u);
    atomicStore(&control[MET], 0u);
    atomicAdd(&control[DEPTH], 1u);
}
