// Twin: `bottega-render/src/integrator/path/light.rs`.
//
// MIS of light found by BSDF sampling and by light sampling.

// Returns the MIS weight of light found by BSDF sampling with `pdf`; `light_pdf`: the pdf of light sampling.
fn found_by_bsdf(pdf: f32, light_pdf: f32) -> f32 {
    if pdf < 0.0 || batch.direct_light == DIRECT_BSDF_SAMPLING {
        return 1.0;
    }
    if batch.direct_light == DIRECT_LIGHT_SAMPLING {
        return 0.0;
    }
    return power_heuristic(pdf, f32(batch.light_samples) * light_pdf);
}

// Computes the contribution of a light sample, and its shadow ray.
fn light_contribution(
    path: u32,
    slot: u32,
    point: ptr<function, Interaction>,
    receiver: Receiver,
    bsdf: ptr<function, Bsdf>,
    throughput: vec3<f32>,
    u: vec4<f32>,
) -> bool {
    set_field(slot + SHADOW_BROUGHT, path, vec4<f32>(0.0));
    let light = lights_sample(receiver, u);
    if !(light.pdf > 0.0) {
        return false;
    }
    let wi = to_local(point, light.wi);
    // Prevent light leaks through shading normals.
    if (wi.z > 0.0) != is_reflection(point, light.wi) {
        return false;
    }
    let scattered = bsdf_eval_pdf(bsdf, wi);
    if is_black(scattered.value) {
        return false;
    }
    let expected = f32(batch.light_samples) * light.pdf;
    var weight = 1.0;
    if !light.is_delta && batch.direct_light == DIRECT_COMBINED {
        weight = power_heuristic(expected, scattered.pdf);
    }
    let brought = throughput * scattered.value * light.radiance * (abs(wi.z) * weight / expected);
    if is_black(brought) {
        return false;
    }
    let origin = ray_origin(point, light.wi);
    if light.distance < 0.0 {
        set_field(slot + SHADOW_ORIGIN, path, vec4(origin, FAR));
        set_field(slot + SHADOW_DIRECTION, path, vec4(light.wi, 0.0));
    } else {
        // Aim at the light's point itself: from the shifted origin it lies in a slightly different direction.
        let goal = (*point).p_outside + light.wi * light.distance;
        set_field(slot + SHADOW_ORIGIN, path, vec4(origin, 1.0 - SHADOW_MARGIN));
        set_field(slot + SHADOW_DIRECTION, path, vec4(goal - origin, 0.0));
    }
    set_field(slot + SHADOW_BROUGHT, path, vec4(brought, 0.0));
    return true;
}

// Weight of the strategy with density `chosen` against the other (Veach 1997, eq. 9.13, β = 2).
fn power_heuristic(chosen: f32, other: f32) -> f32 {
    // By the ratio, so that squares of large densities do not overflow.
    let ratio = min(other / max(chosen, 1e-37), 1e18);
    return 1.0 / (1.0 + ratio * ratio);
}
