// No twin.
//
// Planning between kernels: computes the number of workgroups of the next ones. One thread.

@group(0) @binding(0) var<storage, read_write> control: array<atomic<u32>>;
@group(0) @binding(1) var<storage, read_write> groups: array<u32>;

// Writes the workgroups of a dispatch with `count` threads.
fn plan(kernel: u32, count: u32) {
    groups[DISPATCH_WORDS * kernel] = (count + GROUP_SIZE - 1u) / GROUP_SIZE;
    groups[DISPATCH_WORDS * kernel + 1u] = 1u;
    groups[DISPATCH_WORDS * kernel + 2u] = 1u;
}

@compute @workgroup_size(1)
fn plan_extend() {
    plan(GROUPS_EXTEND, atomicLoad(&control[CONTROL_ACTIVE]));
}

@compute @workgroup_size(1)
fn plan_shade() {
    plan(GROUPS_MISS, atomicLoad(&control[CONTROL_MISSED]));
    plan(GROUPS_SHADE, atomicLoad(&control[CONTROL_MET]));
}

// Ends a bounce.
@compute @workgroup_size(1)
fn plan_next() {
    let next = atomicLoad(&control[CONTROL_NEXT]);
    let lit = atomicLoad(&control[CONTROL_LIT]);
    plan(GROUPS_EXTEND, next);
    plan(GROUPS_SHADOW, lit);
    atomicStore(&control[CONTROL_ACTIVE], next);
    atomicStore(&control[CONTROL_LIT_NOW], lit);
    atomicStore(&control[CONTROL_NEXT], 0u);
    atomicStore(&control[CONTROL_MISSED], 0u);
    atomicStore(&control[CONTROL_LIT], 0u);
    atomicStore(&control[CONTROL_MET], 0u);
    atomicAdd(&control[CONTROL_DEPTH], 1u);
}
