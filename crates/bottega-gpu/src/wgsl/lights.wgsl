// Everything that shines, and the choice of one light for a point: `bottega_render::lights`.

// Least probability with which light from infinitely far away is asked for, and least with which it is not.
const SHARE_MIN: f32 = 0.1;
const LIGHT_WORDS: u32 = 24u;
const LIGHT_SURFACE: u32 = 0u;
const LIGHT_SPHERE: u32 = 1u;
const LIGHT_POINT: u32 = 2u;
const LIGHT_SPOT: u32 = 3u;
const LIGHT_GONIOMETRIC: u32 = 4u;
const LIGHT_PROJECTOR: u32 = 5u;
const PARALLEL_WORDS: u32 = 7u;

fn parallel_importance(light: u32, receiver: Receiver) -> f32 {
    let illuminance = number_at(light + 6u);
    if is_black(receiver.n) {
        return illuminance;
    }
    return illuminance * max(dot(receiver.n, vec3_at(light)), 0.0);
}

// What light from infinitely far away does to a point, as far as it is sampled.
fn far_total(receiver: Receiver) -> f32 {
    var total = environment_illuminance();
    for (var i = 0u; i < scene_words[AT_PARALLEL_COUNT]; i += 1u) {
        total += parallel_importance(scene_words[AT_PARALLEL] + PARALLEL_WORDS * i, receiver);
    }
    return total;
}

// The probability of asking for light from infinitely far away.
fn far_share(receiver: Receiver) -> f32 {
    if scene_words[AT_HAS_FAR] == 0u {
        return 0.0;
    }
    if scene_words[AT_LIGHT_COUNT] == 0u {
        return 1.0;
    }
    let far = far_total(receiver);
    if !(far > 0.0) {
        return 0.0;
    }
    let near = tree_total(receiver);
    if !(near > 0.0) {
        return 1.0;
    }
    return clamp(far / (far + near), SHARE_MIN, 1.0 - SHARE_MIN);
}

fn has_lights() -> bool {
    return scene_words[AT_LIGHT_COUNT] > 0u || scene_words[AT_HAS_FAR] != 0u;
}

fn sample_far(receiver: Receiver, number: f32, share: f32, place: vec2<f32>) -> LightSample {
    let total = far_total(receiver);
    if !(total > 0.0) {
        return no_light();
    }
    var rest = number * total;
    for (var i = 0u; i < scene_words[AT_PARALLEL_COUNT]; i += 1u) {
        let light = scene_words[AT_PARALLEL] + PARALLEL_WORDS * i;
        let part = parallel_importance(light, receiver);
        if rest < part {
            return LightSample(vec3_at(light), -1.0, vec3_at(light + 3u), share * part / total, true);
        }
        rest -= part;
    }
    if scene_words[AT_ENVIRONMENT] == NONE {
        return no_light();
    }
    var light = sample_environment(place);
    light.pdf *= share * environment_illuminance() / total;
    return light;
}

// Draws one light and a place on it.
fn sample_light(receiver: Receiver, u: vec4<f32>) -> LightSample {
    let share = far_share(receiver);
    if u.x < share {
        return sample_far(receiver, u.x / share, share, u.yz);
    }
    let number = select(u.x, min((u.x - share) / (1.0 - share), ONE_MINUS_EPSILON), share > 0.0);
    let choice = choose_light(receiver, number);
    if choice.probability <= 0.0 {
        return no_light();
    }
    let record = scene_words[AT_LIGHTS] + LIGHT_WORDS * choice.light;
    var light: LightSample;
    switch scene_words[record] {
        case LIGHT_SURFACE: {
            light = sample_surface(record, receiver.p, u.yz);
        }
        case LIGHT_SPHERE: {
            light = sample_sphere(scene_words[record + 1u], receiver.p, u.yz);
        }
        default: {
            light = sample_point(record, receiver.p);
        }
    }
    light.pdf *= choice.probability * (1.0 - share);
    return light;
}

// Density per solid angle with which `sample_light` draws a direction that meets no surface.
fn environment_pdf(receiver: Receiver, direction: vec3<f32>) -> f32 {
    let illuminance = environment_illuminance();
    if !(illuminance > 0.0) {
        return 0.0;
    }
    return environment_direction_pdf(direction) * far_share(receiver) * illuminance / far_total(receiver);
}

// The place along the sides of a panel at barycentric coordinates of one of its triangles.
fn place_on_panel(shape: u32, is_second: bool, uv: vec2<f32>) -> vec2<f32> {
    if shape == 0u {
        return uv;
    }
    let weights = weights_of(uv);
    let turn = select(shape & 3u, (shape >> 2u) & 3u, is_second);
    let along = vec2(weights[(turn + 1u) % 3u], weights[(turn + 2u) % 3u]);
    return select(along, 1.0 - along, is_second);
}

// The part of a panel at a place, of a grid of `side` cells a side.
fn part_at(shape: u32, side: u32, place: vec2<f32>) -> u32 {
    let scaled = place * f32(side);
    let row = min(u32(max(scaled.y, 0.0)), side - 1u);
    let cell = min(u32(max(scaled.x, 0.0)), side - 1u);
    if shape != 0u {
        return row * side + cell;
    }
    let columns = side - row;
    let column = min(cell, columns - 1u);
    let within = scaled.x - f32(column) + scaled.y - f32(row);
    // Rows above have 2n − 1 parts, n of them shrinking by one a row.
    let above = side * side - columns * columns;
    return above + 2u * column + select(0u, 1u, within > 1.0 && column + 1u < columns);
}

// The number of the light that was hit; NONE where light sampling never finds it.
fn light_of(shape: Shape, uv: vec2<f32>) -> u32 {
    if (shape.instance & SPHERE) != 0u {
        return scene_words[sphere_at(shape.instance & ~SPHERE) + 9u];
    }
    let first = scene_words[instance_at(shape.instance) + FIRST_LIGHT];
    if first == NONE {
        return NONE;
    }
    let record = scene_words[AT_SHINING] + 4u * (first + shape.primitive);
    let panel = scene_words[record + 1u];
    let place = place_on_panel(panel, scene_words[record + 2u] != 0u, uv);
    return scene_words[scene_words[record] + part_at(panel, scene_words[record + 3u], place)];
}

// Density per solid angle with which `sample_light` draws the place that was hit on a surface that shines.
fn hit_pdf(shape: Shape, uv: vec2<f32>, receiver: Receiver, p: vec3<f32>) -> f32 {
    let light = light_of(shape, uv);
    if light == NONE {
        return 0.0;
    }
    let near = 1.0 - far_share(receiver);
    if !(near > 0.0) {
        return 0.0;
    }
    let probability = near * tree_probability(receiver, light);
    if !(probability > 0.0) {
        return 0.0;
    }
    let record = scene_words[AT_LIGHTS] + LIGHT_WORDS * light;
    switch scene_words[record] {
        case LIGHT_SURFACE: {
            return probability * surface_pdf(record, receiver.p, p);
        }
        case LIGHT_SPHERE: {
            return probability * sphere_pdf(scene_words[record + 1u], receiver.p, p);
        }
        default: {
            return 0.0;
        }
    }
}
