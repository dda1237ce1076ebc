// Twin: `bottega-render/src/lights/sphere.rs`.
//
// Spherical lights.

// Returns the cone of directions that a sphere covers, seen from outside: its axis, and 1 − cos of its half angle; that is 0 at,
// below, or extremely close above the surface.
fn cone_new(center: vec3<f32>, radius: f32, origin: vec3<f32>) -> vec4<f32> {
    let to_center = center - origin;
    let distance = length(to_center);
    if !(distance > radius) {
        return vec4<f32>(0.0);
    }
    let sine = radius / distance;
    let sine_squared = sine * sine;
    if sine_squared >= 0.9999 {
        return vec4<f32>(0.0);
    }
    return vec4(to_center / distance, sine_squared / (1.0 + sqrt(1.0 - sine_squared)));
}

fn sphere_sample(index: u32, origin: vec3<f32>, u: vec2<f32>) -> LightSample {
    let sphere = sphere_at(index);
    let center = vec3_at(sphere + SPHERE_CENTER);
    let radius = number_at(sphere + SPHERE_RADIUS);
    let cone = cone_new(center, radius, origin);
    var wi: vec3<f32>;
    var distance: f32;
    var pdf: f32;
    if cone.w > 0.0 {
        let one_minus_cos = u.x * cone.w;
        let sine_squared = one_minus_cos * (2.0 - one_minus_cos);
        let turn = math_sin_cos_of_turns(u.y);
        let basis = orthonormal_basis(cone.xyz);
        let sine = sqrt(sine_squared);
        let away = length(center - origin);
        wi = normalize(basis.s * (sine * turn.y) + basis.t * (sine * turn.x) + cone.xyz * (1.0 - one_minus_cos));
        distance = away * (1.0 - one_minus_cos) - sqrt(max(radius * radius - away * away * sine_squared, 0.0));
        pdf = 1.0 / (2.0 * PI * cone.w);
    } else {
        let n = uniform_sphere(u);
        let to_light = center + radius * n - origin;
        distance = length(to_light);
        if !(distance > 0.0) {
            return no_light();
        }
        wi = to_light / distance;
        pdf = sphere_area_pdf(radius, abs(dot(wi, n)), distance);
    }
    let n = direction_or(origin + distance * wi - center, vec3<f32>(0.0));
    let material = scene_words[sphere + SPHERE_MATERIAL];
    let side = select(MATERIAL_EMITS_BACK, MATERIAL_EMITS_FRONT, dot(wi, n) < 0.0);
    if (material_flags(material) & side) == 0u || !(pdf > 0.0) || !(pdf < FAR) {
        return no_light();
    }
    let uv = sphere_uv(sphere, n);
    let there = material_opacity_at(material, uv, uv, 0.0, 1.0);
    return LightSample(wi, distance, material_emission(material, uv, uv, 0.0) * there, pdf, false);
}

fn sphere_area_pdf(radius: f32, cosine: f32, distance: f32) -> f32 {
    if !(cosine > 0.0) {
        return 0.0;
    }
    return min(distance * distance / (cosine * 4.0 * PI * radius * radius), FAR);
}

fn sphere_pdf(index: u32, origin: vec3<f32>, p: vec3<f32>) -> f32 {
    let sphere = sphere_at(index);
    let center = vec3_at(sphere + SPHERE_CENTER);
    let radius = number_at(sphere + SPHERE_RADIUS);
    let cone = cone_new(center, radius, origin);
    if cone.w > 0.0 {
        return 1.0 / (2.0 * PI * cone.w);
    }
    let to_light = p - origin;
    let distance = length(to_light);
    if !(distance > 0.0) {
        return 0.0;
    }
    return sphere_area_pdf(radius, abs(dot(to_light / distance, direction_or(p - center, vec3<f32>(0.0)))), distance);
}
