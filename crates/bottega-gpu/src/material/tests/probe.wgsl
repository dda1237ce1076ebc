// One case: a material, a point and directions; everything that the library says of them.

fn case_f32(at: u32) -> f32 {
    return bitcast<f32>(cases[at]);
}

fn case_vec2(at: u32) -> vec2f {
    return vec2f(case_f32(at), case_f32(at + 1u));
}

fn case_vec3(at: u32) -> vec3f {
    return vec3f(case_f32(at), case_f32(at + 1u), case_f32(at + 2u));
}

fn case_vec4(at: u32) -> vec4f {
    return vec4f(case_vec3(at), case_f32(at + 3u));
}

fn answer_vec3(at: u32, v: vec3f) {
    answers[at] = v.x;
    answers[at + 1u] = v.y;
    answers[at + 2u] = v.z;
}

@compute @workgroup_size(64)
fn main(@builtin(global_invocation_id) id: vec3u) {
    let c = id.x * 32u;
    if c >= arrayLength(&cases) {
        return;
    }
    var point: SurfacePoint;
    let material = cases[c];
    point.front = cases[c + 1u];
    point.uv0 = case_vec2(c + 2u);
    point.uv1 = case_vec2(c + 4u);
    point.footprint = case_f32(c + 6u);
    point.chance = case_f32(c + 7u);
    point.vertex_color = case_vec4(c + 8u);
    point.coat_normal = case_vec3(c + 12u);
    point.lifted = vec4f(0.0, 0.0, 1.0, -1.0);
    if case_f32(c + 18u) >= 0.0 {
        point.lifted = lifted_new(case_vec3(c + 15u), case_f32(c + 18u) > 0.0);
    }
    var b = surface_scattering(material, point, case_vec3(c + 19u), case_vec3(c + 28u));
    let value = bsdf_eval_pdf(&b, case_vec3(c + 22u));
    let drawn = bsdf_sample(&b, case_vec3(c + 25u));
    let a = id.x * 24u;
    answer_vec3(a, value.value);
    answers[a + 3u] = value.pdf;
    answer_vec3(a + 4u, drawn.wi);
    answer_vec3(a + 7u, drawn.weight);
    answers[a + 10u] = drawn.pdf;
    answers[a + 11u] = drawn.eta;
    answers[a + 12u] = f32(drawn.flags);
    answer_vec3(a + 13u, bsdf_albedo(&b));
    answers[a + 16u] = bsdf_roughness(&b);
    answers[a + 17u] = select(0.0, 1.0, bsdf_is_black(&b)) + select(0.0, 2.0, bsdf_is_delta_only(&b))
        + select(0.0, 4.0, bsdf_is_transmissive(&b));
    answers[a + 18u] = material_opacity_at(material, point.uv0, point.uv1, point.footprint, point.vertex_color.w);
    answer_vec3(a + 19u, material_emission(material, point.uv0, point.uv1, point.footprint));
}
