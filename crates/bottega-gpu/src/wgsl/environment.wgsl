// Light from infinitely far away, all around: `bottega_render::lights::{environment, distribution}`. Places in its record: kind
// of the table, whether areas are equal, factor, world from environment, integral, picture, then columns, rows, values, sums,
// marginal of the table, and scale and offset that lead from latitudes to places on the picture.

const TABLE_NONE: u32 = 0u;
const TABLE_UNIFORM: u32 = 1u;
const TABLE_BILINEAR: u32 = 2u;
const ONE_BELOW: f32 = 0.99999994;

// The place of a direction on a picture of equal areas (Clarberg 2008).
fn square_of(direction: vec3<f32>) -> vec2<f32> {
    let flat = abs(direction.xy);
    let radius = sqrt(max(1.0 - abs(direction.z), 0.0));
    let angle = atan2_of(flat.y, flat.x) * (2.0 / PI);
    let upper = vec2(radius - angle * radius, angle * radius);
    let place = select(upper, 1.0 - upper.yx, direction.z < 0.0);
    let signed = vec2(with_sign(place.x, direction.x), with_sign(place.y, direction.y));
    return clamp(signed * 0.5 + 0.5, vec2<f32>(0.0), vec2<f32>(ONE_BELOW));
}

fn direction_of_square(place: vec2<f32>) -> vec3<f32> {
    let centered = place * 2.0 - 1.0;
    let flat = abs(centered);
    // Above 0 in the upper hemisphere, and as far from the edge of its diamond.
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

// Texture coordinates of a direction in environment space: the upper edge is +y, the center column −z.
fn latitude_longitude(direction: vec3<f32>) -> vec2<f32> {
    return vec2(0.5 + atan2_of(direction.x, -direction.z) / (2.0 * PI), acos_of(direction.y) / PI);
}

fn environment_place(environment: u32, local: vec3<f32>) -> vec2<f32> {
    if scene_words[environment + 1u] != 0u {
        return square_of(local);
    }
    let place = latitude_longitude(local);
    return vec2(place.x, place.y * number_at(environment + 21u) + number_at(environment + 22u));
}

fn environment_color(environment: u32, uv: vec2<f32>) -> vec3<f32> {
    let picture = scene_words[environment + 15u];
    let factor = vec3_at(environment + 2u);
    if picture == NONE {
        return factor;
    }
    return texture_eval(picture, uv, 0.0).xyz * factor;
}

// The radiance that comes from a direction.
fn environment_radiance(direction: vec3<f32>) -> vec3<f32> {
    let environment = scene_words[AT_ENVIRONMENT];
    if environment == NONE {
        return vec3<f32>(0.0);
    }
    let local = transpose(mat3_at(environment + 5u)) * direction;
    return environment_color(environment, environment_place(environment, local));
}

// An estimate of the illuminance that sampled directions bring to a surface.
fn environment_illuminance() -> f32 {
    let environment = scene_words[AT_ENVIRONMENT];
    if environment == NONE {
        return 0.0;
    }
    return select(0.25 * number_at(environment + 14u), 0.0, scene_words[environment] == TABLE_NONE);
}

// Rows above and below a place of the bilinear table, and the share of the lower one.
struct RowsAt {
    above: u32,
    below: u32,
    lower: f32,
}

fn rows_at(rows: u32, y: f32) -> RowsAt {
    let place = y * f32(rows) - 0.5;
    let above = min(u32(max(place, 0.0)), rows - 1u);
    return RowsAt(above, min(above + 1u, rows - 1u), clamp(place - f32(above), 0.0, 1.0));
}

fn bilinear_density(environment: u32, at: vec2<f32>) -> f32 {
    let columns = scene_words[environment + 16u];
    let values = scene_words[environment + 18u];
    let between = rows_at(scene_words[environment + 17u], at.y);
    let place = at.x * f32(columns) + f32(columns) - 0.5;
    let whole = u32(place);
    let right = place - f32(whole);
    let first = whole % columns;
    let second = (whole + 1u) % columns;
    let upper = values + between.above * columns;
    let lower = values + between.below * columns;
    let above = mix(number_at(upper + first), number_at(upper + second), right);
    let below = mix(number_at(lower + first), number_at(lower + second), right);
    return mix(above, below, between.lower);
}

// A place in [0, 1] by a density that goes linearly from a to b.
fn sample_linear(a: f32, b: f32, u: f32) -> f32 {
    let root = sqrt(max(a * a + (b * b - a * a) * u, 0.0));
    if a + root > 0.0 {
        return clamp(u * (a + b) / (a + root), 0.0, 1.0);
    }
    return sqrt(u);
}

// The last of `count` sums from `at` on that is at or below u, but not the last of all.
fn last_at_or_below(at: u32, count: u32, u: f32) -> u32 {
    var first = 0u;
    var last = count - 1u;
    while last - first > 1u {
        let middle = (first + last) / 2u;
        if number_at(at + middle) <= u {
            first = middle;
        } else {
            last = middle;
        }
    }
    return first;
}

// The sum of the bilinear table up to the centre of a column, between two rows.
fn sum_between(sums: u32, width: u32, between: RowsAt, column: u32) -> f32 {
    let above = number_at(sums + between.above * width + column);
    return above + (number_at(sums + between.below * width + column) - above) * between.lower;
}

fn sample_bilinear(environment: u32, u: vec2<f32>) -> vec2<f32> {
    let columns = scene_words[environment + 16u];
    let rows = scene_words[environment + 17u];
    let values = scene_words[environment + 18u];
    let sums = scene_words[environment + 19u];
    let marginal = scene_words[environment + 20u];
    let width = columns + 1u;
    // Interval k goes from the centre of row k − 1 to that of row k.
    let interval = last_at_or_below(marginal, rows + 2u, u.y);
    let start = number_at(marginal + interval);
    let share = number_at(marginal + interval + 1u) - start;
    var part = 0.5;
    if share > 0.0 {
        part = min((u.y - start) / share, 1.0);
    }
    var y = 0.5 * part;
    if interval == rows {
        y = f32(rows) - 0.5 + 0.5 * part;
    } else if interval > 0u {
        let above = number_at(sums + (interval - 1u) * width + columns);
        let below = number_at(sums + interval * width + columns);
        y = f32(interval) - 0.5 + sample_linear(above, below, part);
    }
    y = min(y / f32(rows), ONE_BELOW);
    let between = rows_at(rows, y);
    let goal = u.x * sum_between(sums, width, between, columns);
    // The last centre whose sum is at or below the goal.
    var first = 0u;
    var last = columns;
    while last - first > 1u {
        let middle = (first + last) / 2u;
        if sum_between(sums, width, between, middle) <= goal {
            first = middle;
        } else {
            last = middle;
        }
    }
    let begin = sum_between(sums, width, between, first);
    let gain = sum_between(sums, width, between, first + 1u) - begin;
    part = 0.5;
    if gain > 0.0 {
        part = clamp((goal - begin) / gain, 0.0, 1.0);
    }
    let second = (first + 1u) % columns;
    let upper = values + between.above * columns;
    let lower = values + between.below * columns;
    let a = mix(number_at(upper + first), number_at(lower + first), between.lower);
    let b = mix(number_at(upper + second), number_at(lower + second), between.lower);
    let x = (f32(first) + 0.5 + sample_linear(a, b, part)) / f32(columns);
    return vec2(select(x, x - 1.0, x >= 1.0), y);
}

// A place in cumulative sums of cells, and the density there; the cell in z.
fn invert_sums(at: u32, cells: u32, u: f32) -> vec3<f32> {
    let cell = last_at_or_below(at, cells + 1u, u);
    let start = number_at(at + cell);
    let share = number_at(at + cell + 1u) - start;
    var part = 0.5;
    if share > 0.0 {
        part = (u - start) / share;
    }
    return vec3(min((f32(cell) + part) / f32(cells), ONE_BELOW), share * f32(cells), f32(cell));
}

fn cells_density(environment: u32, place: vec2<f32>) -> f32 {
    let columns = scene_words[environment + 16u];
    let rows = scene_words[environment + 17u];
    let row = min(u32(place.y * f32(rows)), rows - 1u);
    let column = min(u32(place.x * f32(columns)), columns - 1u);
    let marginal = scene_words[environment + 20u] + row;
    let conditional = scene_words[environment + 19u] + row * (columns + 1u) + column;
    return (number_at(marginal + 1u) - number_at(marginal)) * f32(rows)
        * (number_at(conditional + 1u) - number_at(conditional)) * f32(columns);
}

// Draws a direction of the whole sphere.
fn sample_environment(u: vec2<f32>) -> LightSample {
    let environment = scene_words[AT_ENVIRONMENT];
    let turn = mat3_at(environment + 5u);
    var uv: vec2<f32>;
    var local: vec3<f32>;
    var pdf: f32;
    switch scene_words[environment] {
        case TABLE_NONE: {
            return no_light();
        }
        case TABLE_UNIFORM: {
            let direction = uniform_sphere(u);
            return LightSample(direction, -1.0, environment_radiance(direction), 1.0 / (4.0 * PI), false);
        }
        case TABLE_BILINEAR: {
            uv = sample_bilinear(environment, u);
            let latitude = (uv.y - number_at(environment + 22u)) / number_at(environment + 21u);
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
            pdf = number_at(environment + 21u) * bilinear_density(environment, uv) / (2.0 * PI * PI * theta.x);
        }
        default: {
            let columns = scene_words[environment + 16u];
            let down = invert_sums(scene_words[environment + 20u], scene_words[environment + 17u], u.y);
            let along = invert_sums(scene_words[environment + 19u] + u32(down.z) * (columns + 1u), columns, u.x);
            uv = vec2(along.x, down.x);
            local = direction_of_square(uv);
            pdf = down.y * along.y / (4.0 * PI);
        }
    }
    if !(pdf > 0.0) || !(pdf < FAR) {
        return no_light();
    }
    return LightSample(turn * local, -1.0, environment_color(environment, uv), pdf, false);
}

// The density per solid angle with which `sample_environment` draws a direction.
fn environment_direction_pdf(direction: vec3<f32>) -> f32 {
    let environment = scene_words[AT_ENVIRONMENT];
    let local = transpose(mat3_at(environment + 5u)) * direction;
    switch scene_words[environment] {
        case TABLE_NONE: {
            return 0.0;
        }
        case TABLE_UNIFORM: {
            return 1.0 / (4.0 * PI);
        }
        case TABLE_BILINEAR: {
            let sin_theta = sqrt(local.x * local.x + local.z * local.z);
            if !(sin_theta > 1e-20) {
                return 0.0;
            }
            let density = bilinear_density(environment, environment_place(environment, local));
            return number_at(environment + 21u) * density / (2.0 * PI * PI * sin_theta);
        }
        default: {
            return cells_density(environment, square_of(local)) / (4.0 * PI);
        }
    }
}
