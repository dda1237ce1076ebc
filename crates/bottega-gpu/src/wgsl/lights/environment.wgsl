// Twin: `bottega-render/src/lights/environment.rs`.
//
// The environment light.

// Estimates the illuminance by sampled directions at a surface.
fn environment_light_illuminance() -> f32 {
    let environment = scene_words[HEADER_ENVIRONMENT];
    if environment == NONE {
        return 0.0;
    }
    let is_sampled = scene_words[environment + ENVIRONMENT_KIND] != DENSITY_NONE;
    return select(0.0, 0.25 * number_at(environment + ENVIRONMENT_INTEGRAL), is_sampled);
}

// Returns the radiance from a direction.
fn environment_light_radiance(direction: vec3<f32>) -> vec3<f32> {
    let environment = scene_words[HEADER_ENVIRONMENT];
    if environment == NONE {
        return vec3<f32>(0.0);
    }
    let local = transpose(mat3_at(environment + ENVIRONMENT_WORLD_FROM_ENVIRONMENT)) * direction;
    return environment_light_lookup(environment, environment_light_uv_of(environment, local));
}

fn environment_light_uv_of(environment: u32, local: vec3<f32>) -> vec2<f32> {
    if scene_words[environment + ENVIRONMENT_IS_EQUAL_AREA] != 0u {
        return square_of(local);
    }
    let place = latitude_longitude(local);
    return vec2(place.x, place.y * number_at(environment + ENVIRONMENT_ROWS_SCALE) + number_at(environment + ENVIRONMENT_ROWS_OFFSET));
}

fn environment_light_lookup(environment: u32, uv: vec2<f32>) -> vec3<f32> {
    let picture = scene_words[environment + ENVIRONMENT_PICTURE];
    let factor = vec3_at(environment + ENVIRONMENT_FACTOR);
    if picture == NONE {
        return factor;
    }
    return image_eval(picture, uv, 0.0).xyz * factor;
}

// Samples a direction of the whole sphere.
fn environment_light_sample(u: vec2<f32>) -> LightSample {
    let environment = scene_words[HEADER_ENVIRONMENT];
    let turn = mat3_at(environment + ENVIRONMENT_WORLD_FROM_ENVIRONMENT);
    var uv: vec2<f32>;
    var local: vec3<f32>;
    var pdf: f32;
    switch scene_words[environment + ENVIRONMENT_KIND] {
        case DENSITY_NONE: {
            return no_light();
        }
        case DENSITY_UNIFORM: {
            let direction = uniform_sphere(u);
            return LightSample(direction, -1.0, environment_light_radiance(direction), 1.0 / (4.0 * PI), false);
        }
        case DENSITY_BILINEAR: {
            uv = bilinear_sample(environment + ENVIRONMENT_TABLE, u);
            let latitude = (uv.y - number_at(environment + ENVIRONMENT_ROWS_OFFSET)) / number_at(environment + ENVIRONMENT_ROWS_SCALE);
            // Beyond a pole there is no direction.
            if !(latitude >= 0.0 && latitude <= 1.0) {
                return no_light();
            }
            let theta = sin_cos(PI * latitude);
            let phi = sin_cos(2.0 * PI * (uv.x - 0.5));
            local = vec3(theta.x * phi.x, theta.y, -theta.x * phi.y);
            if !(theta.x > 1e-20) {
                return no_light();
            }
            pdf = number_at(environment + ENVIRONMENT_ROWS_SCALE) * bilinear_density(environment + ENVIRONMENT_TABLE, uv) / (2.0 * PI * PI * theta.x);
        }
        default: {
            let table = environment + ENVIRONMENT_TABLE;
            let columns = scene_words[table + DENSITY_COLUMNS];
            let down = distribution_invert(scene_words[table + DENSITY_MARGINAL], scene_words[table + DENSITY_ROWS], u.y);
            let along = distribution_invert(scene_words[table + DENSITY_SUMS] + u32(down.z) * (columns + 1u), columns, u.x);
            uv = vec2(along.x, down.x);
            local = direction_of_square(uv);
            pdf = down.y * along.y / (4.0 * PI);
        }
    }
    if !(pdf > 0.0) || !(pdf < FAR) {
        return no_light();
    }
    return LightSample(turn * local, -1.0, environment_light_lookup(environment, uv), pdf, false);
}

// Returns the pdf per solid angle with which `environment_light_sample` samples a direction.
fn environment_light_pdf(direction: vec3<f32>) -> f32 {
    let environment = scene_words[HEADER_ENVIRONMENT];
    let local = transpose(mat3_at(environment + ENVIRONMENT_WORLD_FROM_ENVIRONMENT)) * direction;
    switch scene_words[environment + ENVIRONMENT_KIND] {
        case DENSITY_NONE: {
            return 0.0;
        }
        case DENSITY_UNIFORM: {
            return 1.0 / (4.0 * PI);
        }
        case DENSITY_BILINEAR: {
            let sin_theta = sqrt(local.x * local.x + local.z * local.z);
            if !(sin_theta > 1e-20) {
                return 0.0;
            }
            let density = bilinear_density(environment + ENVIRONMENT_TABLE, environment_light_uv_of(environment, local));
            return number_at(environment + ENVIRONMENT_ROWS_SCALE) * density / (2.0 * PI * PI * sin_theta);
        }
        default: {
            return cells_density(environment + ENVIRONMENT_TABLE, square_of(local)) / (4.0 * PI);
        }
    }
}

// Returns texture coordinates of a direction in environment space: the upper edge is +y, the center column −z.
fn latitude_longitude(direction: vec3<f32>) -> vec2<f32> {
    return vec2(0.5 + atan2_of(direction.x, -direction.z) / (2.0 * PI), acos_of(direction.y) / PI);
}

// Returns the position of a direction on an equal-area image (Clarberg 2008).
fn square_of(direction: vec3<f32>) -> vec2<f32> {
    let flat = abs(direction.xy);
    let radius = sqrt(max(1.0 - abs(direction.z), 0.0));
    let angle = atan2_of(flat.y, flat.x) * (2.0 / PI);
    let upper = vec2(radius - angle * radius, angle * radius);
    let place = select(upper, 1.0 - upper.yx, direction.z < 0.0);
    let signed = vec2(with_sign(place.x, direction.x), with_sign(place.y, direction.y));
    return clamp(signed * 0.5 + 0.5, vec2<f32>(0.0), vec2<f32>(ONE_MINUS_EPSILON));
}

fn direction_of_square(place: vec2<f32>) -> vec3<f32> {
    let centered = place * 2.0 - 1.0;
    let flat = abs(centered);
    // Positive in the upper hemisphere; the distance from the edge of its diamond.
    let from_edge = 1.0 - (flat.x + flat.y);
    let radius = 1.0 - abs(from_edge);
    var angle = 0.0;
    if radius > 0.0 {
        angle = ((flat.y - flat.x) / radius + 1.0) * (0.25 * PI);
    }
    let turn = sin_cos(angle);
    let sine = radius * sqrt(max(2.0 - radius * radius, 0.0));
    let z = with_sign(1.0 - radius * radius, from_edge);
    return vec3(with_sign(turn.y * sine, centered.x), with_sign(turn.x * sine, centered.y), z);
}
