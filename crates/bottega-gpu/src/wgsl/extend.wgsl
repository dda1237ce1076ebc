// No twin.
//
// Finds the next surface of active paths and queues them by hit or miss; traces shadow rays.

@compute @workgroup_size(GROUP_SIZE)
fn extend(@builtin(global_invocation_id) id: vec3<u32>) {
    if id.x >= atomicLoad(&control[CONTROL_ACTIVE]) {
        return;
    }
    let depth = atomicLoad(&control[CONTROL_DEPTH]);
    let path = queued(QUEUE_ACTIVE + (depth % QUEUES_ACTIVE), id.x);
    ask_as(path, depth, false);
    var reach = FAR;
    var start = 0.0;
    // A camera ray has a limited length.
    if depth == 0u {
        let first = field(PATH_HIT, path);
        reach = first.x;
        start = first.y;
    }
    let hit = traverse(Ray(field(PATH_ORIGIN, path).xyz, 0.0, field(PATH_DIRECTION, path).xyz, reach), false);
    // Queue the path by hit or miss.
    if hit.shape == HIT_NOTHING {
        push(QUEUE_MISSED, CONTROL_MISSED, path);
    } else {
        if depth == 0u {
            set_field(PATH_NORMAL, path, vec4(0.0, 0.0, 0.0, start));
        }
        set_bits(PATH_HIT, path, vec4(bitcast<u32>(hit.t), bitcast<u32>(hit.u), bitcast<u32>(hit.v), hit.shape));
        push(QUEUE_MET, CONTROL_MET, path);
    }
}

// Traces shadow rays, and adds the light samples that are visible.
@compute @workgroup_size(GROUP_SIZE)
fn shadow(@builtin(global_invocation_id) id: vec3<u32>) {
    if id.x >= atomicLoad(&control[CONTROL_LIT_NOW]) {
        return;
    }
    let path = queued(QUEUE_LIT, id.x);
    // The depth was advanced before this kernel.
    ask_as(path, atomicLoad(&control[CONTROL_DEPTH]) - 1u, true);
    var found = field(PATH_RADIANCE, path);
    for (var part = 0u; part < batch.light_samples; part += 1u) {
        let slot = PATH_SHADOW + SHADOW_FIELDS * part;
        let brought = field(slot + SHADOW_BROUGHT, path).xyz;
        if is_black(brought) {
            continue;
        }
        let origin = field(slot + SHADOW_ORIGIN, path);
        let hit = traverse(Ray(origin.xyz, 0.0, field(slot + SHADOW_DIRECTION, path).xyz, origin.w), true);
        if hit.shape == HIT_NOTHING {
            found += vec4(brought, 0.0);
        }
    }
    set_field(PATH_RADIANCE, path, found);
}
