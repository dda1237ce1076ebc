// What a path finds where it meets a surface or none, and where it goes on: `bottega_render::integrator::path`.

const ROULETTE_SURVIVAL_MAX: f32 = 0.95;
// How far from its target a shadow ray ends, as a share of its length.
const SHADOW_MARGIN: f32 = 1e-4;
// Growth of the beam after a scattering that spreads over one steradian.
const SCATTERED_SPREAD: f32 = 0.05;
// Sets the numbers that choose between blended surfaces apart from those that decide on opacity.
const BLEND: vec2<u32> = vec2(0x7f4a7c15u, 0x9e3779b9u);

// Weight of the strategy with density `chosen` against the other (Veach 1997, eq. 9.13, β = 2).
fn power_heuristic(chosen: f32, other: f32) -> f32 {
    // By the ratio, so that squares of large densities do not overflow.
    let ratio = min(other / max(chosen, 1e-37), 1e18);
    return 1.0 / (1.0 + ratio * ratio);
}

fn receiver_from(path: u32) -> Receiver {
    return Receiver(field(RECEIVER, path).xyz, field(RECEIVER_NORMAL, path).xyz);
}

// The weight of light that the path ran into with density `pdf`, which light sampling would have found with `light_pdf`.
fn found_by_bsdf(pdf: f32, light_pdf: f32) -> f32 {
    if pdf < 0.0 || batch.direct_light == BSDF_SAMPLING {
        return 1.0;
    }
    if batch.direct_light == LIGHT_SAMPLING {
        return 0.0;
    }
    return power_heuristic(pdf, f32(batch.light_samples) * light_pdf);
}

@compute @workgroup_size(64)
fn miss(@builtin(global_invocation_id) id: vec3<u32>) {
    if id.x >= atomicLoad(&control[MISSED]) {
        return;
    }
    let path = queued(MISSED_QUEUE, id.x);
    let direction = field(DIRECTION, path).xyz;
    let radiance = environment_radiance(direction);
    if is_black(radiance) {
        return;
    }
    let found = field(RADIANCE, path);
    var light_pdf = 0.0;
    if found.w >= 0.0 {
        light_pdf = environment_pdf(receiver_from(path), direction);
    }
    let weight = found_by_bsdf(found.w, light_pdf);
    set_field(RADIANCE, path, found + vec4(field(THROUGHPUT, path).xyz * radiance * weight, 0.0));
}

// What one light sample adds if nothing is between, and the ray that asks whether that is so.
fn connect(
    path: u32,
    slot: u32,
    point: ptr<function, Interaction>,
    receiver: Receiver,
    bsdf: ptr<function, Bsdf>,
    throughput: vec3<f32>,
    u: vec4<f32>,
) -> bool {
    set_field(slot + 2u, path, vec4<f32>(0.0));
    let light = sample_light(receiver, u);
    if !(light.pdf > 0.0) {
        return false;
    }
    let wi = to_local(point, light.wi);
    // A shading normal must not let light through the real surface.
    if (wi.z > 0.0) != is_reflection(point, light.wi) {
        return false;
    }
    let scattered = bsdf_eval(bsdf, wi);
    if is_black(scattered.value) {
        return false;
    }
    let expected = f32(batch.light_samples) * light.pdf;
    var weight = 1.0;
    if !light.is_delta && batch.direct_light == COMBINED {
        weight = power_heuristic(expected, scattered.pdf);
    }
    let brought = throughput * scattered.value * light.radiance * (abs(wi.z) * weight / expected);
    if is_black(brought) {
        return false;
    }
    let origin = ray_origin(point, light.wi);
    if light.distance < 0.0 {
        set_field(slot, path, vec4(origin, FAR));
        set_field(slot + 1u, path, vec4(light.wi, 0.0));
    } else {
        // Aim at the light's point itself: from the shifted origin it lies in a slightly different direction.
        let goal = (*point).p_outside + light.wi * light.distance;
        set_field(slot, path, vec4(origin, 1.0 - SHADOW_MARGIN));
        set_field(slot + 1u, path, vec4(goal - origin, 0.0));
    }
    set_field(slot + 2u, path, vec4(brought, 0.0));
    return true;
}

fn record_albedo(path: u32, wants_albedo: bool, albedo: vec3<f32>) {
    if wants_albedo {
        set_field(ALBEDO, path, vec4(albedo, 1.0));
    }
}

fn meet(path: u32, depth: u32) {
    let hit = bits(HIT, path);
    let t = bitcast<f32>(hit.x);
    let uv = bitcast<vec2<f32>>(hit.yz);
    let origin = field(ORIGIN, path);
    let direction = field(DIRECTION, path);
    let carried = field(THROUGHPUT, path);
    let absorption = field(ABSORPTION, path).xyz;
    var throughput = carried.xyz;
    if !is_black(absorption) {
        throughput *= vec3(math_exp(-absorption.x * t), math_exp(-absorption.y * t), math_exp(-absorption.z * t));
    }
    let width = origin.w + direction.w * t;
    var point = interaction_at(hit.w, t, uv, origin.xyz, direction.xyz, width);
    if depth == 0u {
        set_field(ALBEDO, path, vec4(0.0, 0.0, 0.0, 1.0));
        set_field(NORMAL, path, vec4(point.n, field(NORMAL, path).w + t));
    }
    var found = field(RADIANCE, path);
    let asked = field(RECEIVER, path);
    let wants_albedo = asked.w > 0.5;
    if (point.flags & MATERIAL_UNLIT) != 0u {
        let shown = material_unlit(point.material, point.uv0, point.uv1, point.footprint) * point.color.xyz;
        let color = min(shown, vec3(1.0));
        set_field(RADIANCE, path, found + vec4(throughput * color, 0.0));
        record_albedo(path, wants_albedo, color);
        return;
    }
    let side = select(MATERIAL_EMITS_BACK, MATERIAL_EMITS_FRONT, point.is_in_front);
    if (point.flags & MATERIAL_SHINES) != 0u && (point.flags & side) != 0u {
        let radiance = material_emission(point.material, point.uv0, point.uv1, 0.0);
        if !is_black(radiance) {
            var light_pdf = 0.0;
            if found.w >= 0.0 && batch.direct_light == COMBINED {
                light_pdf = hit_pdf(shapes[hit.w], uv, receiver_from(path), point.p);
            }
            found += vec4(throughput * radiance * found_by_bsdf(found.w, light_pdf), 0.0);
        }
    }
    let is_last = depth >= batch.max_depth;
    if is_last && !wants_albedo {
        set_field(RADIANCE, path, found);
        return;
    }
    let from_pixel = sampler_from(path);
    var chance = 0.0;
    if (point.flags & MATERIAL_BLENDED) != 0u {
        chance = hashed(from_pixel, BLEND ^ vec2(point.material, depth << 24u));
    }
    let surface = SurfacePoint(point.uv0, point.uv1, point.footprint, select(0u, 1u, point.is_in_front), point.color, chance,
        point.coat_normal, point.lifted);
    var bsdf = bsdf_at(point.material, surface, to_local(&point, point.wo), throughput);
    let is_delta_only = bsdf_is_delta_only(&bsdf);
    var still_wants_albedo = wants_albedo;
    if wants_albedo && (is_last || !is_delta_only) {
        record_albedo(path, true, bsdf_albedo(&bsdf));
        still_wants_albedo = false;
    }
    if is_last {
        set_field(RADIANCE, path, found);
        return;
    }
    let n = select(point.n, vec3<f32>(0.0), (point.flags & MATERIAL_TRANSMITS) != 0u);
    let receiver = Receiver(point.p_outside, n);
    if !is_delta_only && batch.direct_light != BSDF_SAMPLING && has_lights() {
        var is_lit = false;
        for (var part = 0u; part < batch.light_samples; part += 1u) {
            let u = split_quad(from_pixel, light_set(depth), part, batch.light_samples);
            is_lit |= connect(path, SHADOW + SHADOW_FIELDS * part, &point, receiver, &bsdf, throughput, u);
        }
        if is_lit {
            push(LIT_QUEUE, LIT, path);
        }
    }
    found.w = -1.0;
    // Where the path goes on.
    let u = quad(from_pixel, scattering_set(depth));
    let drawn = bsdf_sample(&bsdf, u.xyz);
    let wi = to_world(&point, drawn.wi);
    let reflects = is_reflection(&point, wi);
    if drawn.flags == 0u || (drawn.wi.z > 0.0) != reflects {
        set_field(RADIANCE, path, found);
        return;
    }
    let is_delta = (drawn.flags & BSDF_DELTA) != 0u;
    throughput *= drawn.weight;
    var scale = carried.w;
    if !reflects {
        // Into the solid when the path came from its outside, else out of it.
        if (point.flags & MATERIAL_KEEPS_MEDIUM) == 0u {
            set_field(ABSORPTION, path, vec4(material_absorption(point.material, point.is_in_front), 0.0));
        }
        scale *= drawn.eta * drawn.eta;
    }
    var spread = direction.w;
    if !is_delta {
        spread = max(spread, SCATTERED_SPREAD / sqrt(max(drawn.pdf, 1e-30)));
        found.w = drawn.pdf;
    }
    // Russian roulette, by the square root of what the path still carries.
    let remaining = math_max3(throughput) * scale;
    var survives = remaining > 0.0;
    if survives && depth + 1u > batch.roulette_depth {
        let survival = min(sqrt(remaining), ROULETTE_SURVIVAL_MAX);
        throughput /= survival;
        survives = u.w < survival;
    }
    set_field(RADIANCE, path, found);
    if !survives {
        return;
    }
    set_field(THROUGHPUT, path, vec4(throughput, scale));
    set_field(RECEIVER, path, vec4(receiver.p, select(0.0, 1.0, still_wants_albedo)));
    set_field(RECEIVER_NORMAL, path, vec4(receiver.n, field(RECEIVER_NORMAL, path).w));
    set_field(ORIGIN, path, vec4(ray_origin(&point, wi), width));
    set_field(DIRECTION, path, vec4(wi, spread));
    push(ACTIVE_QUEUE + ((depth + 1u) & 1u), NEXT, path);
}

@compute @workgroup_size(64)
fn shade(@builtin(global_invocation_id) id: vec3<u32>) {
    if id.x < atomicLoad(&control[MET]) {
        meet(queued(MET_QUEUE, id.x), atomicLoad(&control[DEPTH]));
    }
}
