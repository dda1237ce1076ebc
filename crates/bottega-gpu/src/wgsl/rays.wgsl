// No twin.
//
// Batches of rays, one per thread. Follows traverse.wgsl.

@group(0) @binding(2) var<storage, read> rays: array<Ray>;
@group(0) @binding(3) var<storage, read_write> answers: array<u32>;
@group(0) @binding(4) var<uniform> params: RayParams;

// No surface is cut out.
fn is_there(hit: Hit, ray: Ray) -> bool {
    return true;
}

@compute @workgroup_size(GROUP_SIZE)
fn intersect(@builtin(global_invocation_id) id: vec3<u32>) {
    if id.x >= params.ray_count {
        return;
    }
    let hit = traverse(rays[id.x], false);
    let at = id.x * ANSWER_WORDS;
    answers[at + ANSWER_T] = bitcast<u32>(hit.t);
    answers[at + ANSWER_U] = bitcast<u32>(hit.u);
    answers[at + ANSWER_V] = bitcast<u32>(hit.v);
    answers[at + ANSWER_INSTANCE] = hit.instance;
    answers[at + ANSWER_PRIMITIVE] = hit.primitive;
}

@compute @workgroup_size(GROUP_SIZE)
fn occluded(@builtin(global_invocation_id) id: vec3<u32>) {
    if id.x >= params.ray_count {
        return;
    }
    let hit = traverse(rays[id.x], true);
    answers[id.x] = select(0u, 1u, hit.instance != HIT_NOTHING);
}
