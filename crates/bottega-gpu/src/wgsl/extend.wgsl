// Paths go on to the next surface, and those that meet none find the environment.

@compute @workgroup_size(64)
fn extend(@builtin(global_invocation_id) id: vec3<u32>) {
    if id.x >= atomicLoad(&control[ACTIVE]) {
        return;
    }
    let depth = atomicLoad(&control[DEPTH]);
    let path = queued(ACTIVE_QUEUE + (depth & 1u), id.x);
    ask_as(path, depth, false);
    var reach = FAR;
    var start = 0.0;
    if depth == 0u {
        let first = field(HIT, path);
        reach = first.x;
        start = first.y;
    }
    let hit = traverse(Ray(field(ORIGIN, path).xyz, 0.0, field(DIRECTION, path).xyz, reach), false);
    if hit.shape == NOTHING {
        push(MISSED_QUEUE, MISSED, path);
    } else {
        if depth == 0u {
            set_field(NORMAL, path, vec4(0.0, 0.0, 0.0, start));
        }
        set_bits(HIT, path, vec4(bitcast<u32>(hit.t), bitcast<u32>(hit.u), bitcast<u32>(hit.v), hit.shape));
        push(MET_QUEUE, MET, path);
    }
}

// Shadow rays: what is seen of the lights that were drawn is added.
@compute @workgroup_size(64)
fn shadow(@builtin(global_invocation_id) id: vec3<u32>) {
    if id.x >= atomicLoad(&control[LIT_NOW]) {
        return;
    }
    let path = queued(LIT_QUEUE, id.x);
    // The depth counts on before this kernel.
    ask_as(path, atomicLoad(&control[DEPTH]) - 1u, true);
    var found = field(RADIANCE, path);
    for (var part = 0u; part < batch.light_samples; part += 1u) {
        let slot = SHADOW + SHADOW_FIELDS * part;
        let brought = field(slot + 2u, path).xyz;
        if is_black(brought) {
            continue;
        }
        let origin = field(slot, path);
        let hit = traverse(Ray(origin.xyz, 0.0, field(slot + 1u, path).xyz, origin.w), true);
        if hit.shape == NOTHING {
            found += vec4(brought, 0.0);
        }
    }
    set_field(RADIANCE, path, found);
}
