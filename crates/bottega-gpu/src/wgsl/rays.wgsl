// Batches of rays, one a thread. After traverse.wgsl.

struct Params {
    ray_count: u32,
}

@group(0) @binding(2) var<storage, read> rays: array<Ray>;
@group(0) @binding(3) var<storage, read_write> answers: array<u32>;
@group(0) @binding(4) var<uniform> params: Params;

// Nothing is cut out.
fn is_there(hit: Hit, ray: Ray) -> bool {
    return true;
}

@compute @workgroup_size(64)
fn intersect(@builtin(global_invocation_id) id: vec3<u32>) {
    if id.x >= params.ray_count {
        return;
    }
    let hit = traverse(rays[id.x], false);
    let at = id.x * 5u;
    answers[at] = bitcast<u32>(hit.t);
    answers[at + 1u] = bitcast<u32>(hit.u);
    answers[at + 2u] = bitcast<u32>(hit.v);
    answers[at + 3u] = hit.instance;
    answers[at + 4u] = hit.primitive;
}

@compute @workgroup_size(64)
fn occluded(@builtin(global_invocation_id) id: vec3<u32>) {
    if id.x >= params.ray_count {
        return;
    }
    let hit = traverse(rays[id.x], true);
    answers[id.x] = select(0u, 1u, hit.instance != NOTHING);
}
