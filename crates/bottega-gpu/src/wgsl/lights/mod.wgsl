// Twin: `bottega-render/src/lights/mod.rs`.
//
// All lights, and the selection of one for a point.

// A sampled point on a light.
struct LightSample {
    wi: vec3<f32>,
    // Distance to the point; −1: infinitely far.
    distance: f32,
    radiance: vec3<f32>,
    // Density per solid angle; for a light without extent its probability. 0: no sample.
    pdf: f32,
    is_delta: bool,
}

// Samples a light, and a point on it.
fn lights_sample(receiver: Receiver, u: vec4<f32>) -> LightSample {
    let share = far_share(receiver);
    // Select the environment and distant lights, or the light tree.
    if u.x < share {
        return sample_far(receiver, u.x / share, share, u.yz);
    }
    let number = select(u.x, min((u.x - share) / (1.0 - share), ONE_MINUS_EPSILON), share > 0.0);
    let choice = light_tree_sample(receiver, number);
    if choice.probability <= 0.0 {
        return no_light();
    }
    // Sample a point on the light.
    let record = scene_words[HEADER_LIGHTS] + LIGHT_WORDS * choice.light;
    var light: LightSample;
    switch scene_words[record + POINT_LIGHT_KIND] {
        case LIGHT_SURFACE: {
            light = surface_light_sample(record, receiver.p, u.yz);
        }
        case LIGHT_SPHERE: {
            light = sphere_sample(scene_words[record + SPHERE_LIGHT_SPHERE], receiver.p, u.yz);
        }
        default: {
            light = punctual_sample(record, receiver.p);
        }
    }
    // Multiply by the probability of the selection.
    light.pdf *= choice.probability * (1.0 - share);
    return light;
}

// Returns the probability of sampling the environment and distant lights.
fn far_share(receiver: Receiver) -> f32 {
    if scene_words[HEADER_HAS_FAR] == 0u {
        return 0.0;
    }
    if scene_words[HEADER_LIGHT_COUNT] == 0u {
        return 1.0;
    }
    let far = far_total(receiver);
    if !(far > 0.0) {
        return 0.0;
    }
    let near = light_tree_total(receiver);
    if !(near > 0.0) {
        return 1.0;
    }
    return clamp(far / (far + near), SHARE_MIN, 1.0 - SHARE_MIN);
}

fn has_lights() -> bool {
    return scene_words[HEADER_LIGHT_COUNT] > 0u || scene_words[HEADER_HAS_FAR] != 0u;
}

fn sample_far(receiver: Receiver, number: f32, share: f32, place: vec2<f32>) -> LightSample {
    let total = far_total(receiver);
    if !(total > 0.0) {
        return no_light();
    }
    var rest = number * total;
    for (var i = 0u; i < scene_words[HEADER_PARALLEL_COUNT]; i += 1u) {
        let light = scene_words[HEADER_PARALLEL] + PARALLEL_WORDS * i;
        let part = parallel_importance(light, receiver);
        if rest < part {
            return LightSample(vec3_at(light + PARALLEL_TO_LIGHT), -1.0, vec3_at(light + PARALLEL_IRRADIANCE), share * part / total, true);
        }
        rest -= part;
    }
    if scene_words[HEADER_ENVIRONMENT] == NONE {
        return no_light();
    }
    var light = environment_light_sample(place);
    light.pdf *= share * environment_light_illuminance() / total;
    return light;
}

// Estimates the illuminance by the environment and distant lights, as far as they are sampled.
fn far_total(receiver: Receiver) -> f32 {
    var total = environment_light_illuminance();
    for (var i = 0u; i < scene_words[HEADER_PARALLEL_COUNT]; i += 1u) {
        total += parallel_importance(scene_words[HEADER_PARALLEL] + PARALLEL_WORDS * i, receiver);
    }
    return total;
}

// Returns the pdf per solid angle with which `lights_sample` samples a direction that hits no surface.
fn environment_pdf(receiver: Receiver, direction: vec3<f32>) -> f32 {
    let illuminance = environment_light_illuminance();
    if !(illuminance > 0.0) {
        return 0.0;
    }
    return environment_light_pdf(direction) * far_share(receiver) * illuminance / far_total(receiver);
}

// Returns the index of the light that was hit; NONE if light sampling never selects it.
fn light_of(shape: Shape, uv: vec2<f32>) -> u32 {
    if (shape.instance & HIT_SPHERE) != 0u {
        return scene_words[sphere_at(shape.instance & ~HIT_SPHERE) + SPHERE_LIGHT];
    }
    let first = scene_words[instance_at(shape.instance) + INSTANCE_FIRST_LIGHT];
    if first == NONE {
        return NONE;
    }
    let record = scene_words[HEADER_SHINING] + SHINING_WORDS * (first + shape.primitive);
    let panel = scene_words[record + SHINING_SHAPE];
    let place = shape_place_of(panel, scene_words[record + SHINING_IS_SECOND] != 0u, uv);
    return scene_words[scene_words[record + SHINING_PARTS] + grid_part_at(panel, scene_words[record + SHINING_SIDE], place)];
}

// Returns the pdf per solid angle with which `lights_sample` samples the point that was hit on an emitter.
fn hit_pdf(shape: Shape, uv: vec2<f32>, receiver: Receiver, p: vec3<f32>) -> f32 {
    let light = light_of(shape, uv);
    if light == NONE {
        return 0.0;
    }
    let near = 1.0 - far_share(receiver);
    if !(near > 0.0) {
        return 0.0;
    }
    let probability = near * light_tree_pmf(receiver, light);
    if !(probability > 0.0) {
        return 0.0;
    }
    let record = scene_words[HEADER_LIGHTS] + LIGHT_WORDS * light;
    switch scene_words[record + POINT_LIGHT_KIND] {
        case LIGHT_SURFACE: {
            return probability * surface_light_pdf(record, receiver.p, p);
        }
        case LIGHT_SPHERE: {
            return probability * sphere_pdf(scene_words[record + SPHERE_LIGHT_SPHERE], receiver.p, p);
        }
        default: {
            return 0.0;
        }
    }
}

fn no_light() -> LightSample {
    return LightSample(vec3<f32>(0.0), 0.0, vec3<f32>(0.0), 0.0, false);
}

fn parallel_importance(light: u32, receiver: Receiver) -> f32 {
    let illuminance = number_at(light + PARALLEL_ILLUMINANCE);
    if is_black(receiver.n) {
        return illuminance;
    }
    return illuminance * max(dot(receiver.n, vec3_at(light + PARALLEL_TO_LIGHT)), 0.0);
}
