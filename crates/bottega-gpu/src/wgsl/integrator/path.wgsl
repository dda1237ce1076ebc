// Twin: `bottega-render/src/integrator/path.rs`.
//
// Shading of a path's vertex: emission, light sampling, scattering, Russian roulette.

fn receiver_from(path: u32) -> Receiver {
    return Receiver(field(PATH_RECEIVER, path).xyz, field(PATH_RECEIVER_NORMAL, path).xyz);
}

// Ends the paths that hit no surface: adds the environment's radiance.
@compute @workgroup_size(GROUP_SIZE)
fn miss(@builtin(global_invocation_id) id: vec3<u32>) {
    if id.x >= atomicLoad(&control[CONTROL_MISSED]) {
        return;
    }
    let path = queued(QUEUE_MISSED, id.x);
    let direction = field(PATH_DIRECTION, path).xyz;
    let radiance = environment_light_radiance(direction);
    if is_black(radiance) {
        return;
    }
    // Weight by MIS with light sampling.
    let found = field(PATH_RADIANCE, path);
    var light_pdf = 0.0;
    if found.w >= 0.0 {
        light_pdf = environment_pdf(receiver_from(path), direction);
    }
    let weight = found_by_bsdf(found.w, light_pdf);
    set_field(PATH_RADIANCE, path, found + vec4(field(PATH_THROUGHPUT, path).xyz * radiance * weight, 0.0));
}

// Shades a path at the surface that it hit.
fn meet(path: u32, depth: u32) {
    let hit = bits(PATH_HIT, path);
    let t = bitcast<f32>(hit.x);
    let uv = bitcast<vec2<f32>>(hit.yz);
    let origin = field(PATH_ORIGIN, path);
    let direction = field(PATH_DIRECTION, path);
    let carried = field(PATH_THROUGHPUT, path);
    let absorption = field(PATH_ABSORPTION, path).xyz;
    var throughput = carried.xyz;
    // Attenuate by the medium since the last vertex.
    if !is_black(absorption) {
        throughput *= vec3(math_exp(-absorption.x * t), math_exp(-absorption.y * t), math_exp(-absorption.z * t));
    }
    // Compute the surface interaction.
    let width = origin.w + direction.w * t;
    var point = interaction_new(hit.w, t, uv, origin.xyz, direction.xyz, width);
    if depth == 0u {
        set_field(PATH_ALBEDO, path, vec4(0.0, 0.0, 0.0, 1.0));
        set_field(PATH_NORMAL, path, vec4(point.n, field(PATH_NORMAL, path).w + t));
    }
    var found = field(PATH_RADIANCE, path);
    let receiver_field = field(PATH_RECEIVER, path);
    let wants_albedo = receiver_field.w > 0.5;
    // End at an unlit surface, with its color.
    if (point.flags & MATERIAL_UNLIT) != 0u {
        let shown = material_unlit(point.material, point.uv0, point.uv1, point.footprint) * point.color.xyz;
        let color = min(shown, vec3(1.0));
        set_field(PATH_RADIANCE, path, found + vec4(throughput * color, 0.0));
        record_albedo(path, wants_albedo, color);
        return;
    }
    // Add emitted radiance, by MIS with light sampling.
    let side = select(MATERIAL_EMITS_BACK, MATERIAL_EMITS_FRONT, point.is_in_front);
    if (point.flags & MATERIAL_SHINES) != 0u && (point.flags & side) != 0u {
        let radiance = material_emission(point.material, point.uv0, point.uv1, 0.0);
        if !is_black(radiance) {
            var light_pdf = 0.0;
            if found.w >= 0.0 && batch.direct_light == DIRECT_COMBINED {
                light_pdf = hit_pdf(shapes[hit.w], uv, receiver_from(path), point.p);
            }
            found += vec4(throughput * radiance * found_by_bsdf(found.w, light_pdf), 0.0);
        }
    }
    // End at the maximum depth.
    let is_last = depth >= batch.max_depth;
    if is_last && !wants_albedo {
        set_field(PATH_RADIANCE, path, found);
        return;
    }
    // Evaluate the material: select a blended surface, look up textures.
    let from_pixel = sampler_from(path);
    var chance = 0.0;
    if (point.flags & MATERIAL_BLENDED) != 0u {
        chance = hashed(from_pixel, BLEND ^ vec2(point.material, depth << DEPTH_SHIFT));
    }
    let surface = SurfacePoint(point.uv0, point.uv1, point.footprint, select(0u, 1u, point.is_in_front), point.color, chance,
        point.coat_normal, point.lifted);
    var bsdf = surface_scattering(point.material, surface, to_local(&point, point.wo), throughput);
    let is_delta_only = bsdf_is_delta_only(&bsdf);
    var still_wants_albedo = wants_albedo;
    // Record the albedo at the first surface that is not purely specular.
    if wants_albedo && (is_last || !is_delta_only) {
        record_albedo(path, true, bsdf_albedo(&bsdf));
        still_wants_albedo = false;
    }
    if is_last {
        set_field(PATH_RADIANCE, path, found);
        return;
    }
    // Sample direct illumination; the shadow rays are traced later.
    let n = select(point.n, vec3<f32>(0.0), (point.flags & MATERIAL_TRANSMITS) != 0u);
    let receiver = Receiver(point.p_outside, n);
    if !is_delta_only && batch.direct_light != DIRECT_BSDF_SAMPLING && has_lights() {
        var is_lit = false;
        for (var part = 0u; part < batch.light_samples; part += 1u) {
            let u = split_quad(from_pixel, dimension_set_light(depth), part, batch.light_samples);
            is_lit |= light_contribution(path, PATH_SHADOW + SHADOW_FIELDS * part, &point, receiver, &bsdf, throughput, u);
        }
        if is_lit {
            push(QUEUE_LIT, CONTROL_LIT, path);
        }
    }
    found.w = -1.0;
    // Sample the BSDF for the next direction.
    let u = quad(from_pixel, dimension_set_scattering(depth));
    let drawn = bsdf_sample(&bsdf, u.xyz);
    let wi = to_world(&point, drawn.wi);
    let reflects = is_reflection(&point, wi);
    if drawn.flags == 0u || (drawn.wi.z > 0.0) != reflects {
        set_field(PATH_RADIANCE, path, found);
        return;
    }
    let is_delta = (drawn.flags & BSDF_DELTA) != 0u;
    throughput *= drawn.weight;
    var scale = carried.w;
    if !reflects {
        // Update the medium: the inside when the path came from outside, else the outside.
        if (point.flags & MATERIAL_KEEPS_MEDIUM) == 0u {
            set_field(PATH_ABSORPTION, path, vec4(material_absorption(point.material, point.is_in_front), 0.0));
        }
        scale *= drawn.eta * drawn.eta;
    }
    var spread = direction.w;
    if !is_delta {
        spread = max(spread, SCATTERED_SPREAD / sqrt(max(drawn.pdf, 1e-30)));
        found.w = drawn.pdf;
    }
    // Terminate with Russian roulette, by the square root of the throughput.
    let remaining = math_max3(throughput) * scale;
    var survives = remaining > 0.0;
    if survives && depth + 1u > batch.roulette_depth {
        let survival = min(sqrt(remaining), ROULETTE_SURVIVAL_MAX);
        throughput /= survival;
        survives = u.w < survival;
    }
    set_field(PATH_RADIANCE, path, found);
    if !survives {
        return;
    }
    // Store the next ray.
    set_field(PATH_THROUGHPUT, path, vec4(throughput, scale));
    set_field(PATH_RECEIVER, path, vec4(receiver.p, select(0.0, 1.0, still_wants_albedo)));
    set_field(PATH_RECEIVER_NORMAL, path, vec4(receiver.n, field(PATH_RECEIVER_NORMAL, path).w));
    set_field(PATH_ORIGIN, path, vec4(ray_origin(&point, wi), width));
    set_field(PATH_DIRECTION, path, vec4(wi, spread));
    push(QUEUE_ACTIVE + ((depth + 1u) % QUEUES_ACTIVE), CONTROL_NEXT, path);
}

@compute @workgroup_size(GROUP_SIZE)
fn shade(@builtin(global_invocation_id) id: vec3<u32>) {
    if id.x < atomicLoad(&control[CONTROL_MET]) {
        meet(queued(QUEUE_MET, id.x), atomicLoad(&control[CONTROL_DEPTH]));
    }
}

fn record_albedo(path: u32, wants_albedo: bool, albedo: vec3<f32>) {
    if wants_albedo {
        set_field(PATH_ALBEDO, path, vec4(albedo, 1.0));
    }
}
