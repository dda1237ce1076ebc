// Twin: `bottega-render/src/lights/distribution.rs`.
//
// Sampling of directions by a table of densities.

// The rows above and below a position of the bilinear table, and the weight of the lower one.
struct RowsAt {
    above: u32,
    below: u32,
    lower: f32,
}

fn cells_density(table: u32, place: vec2<f32>) -> f32 {
    let columns = scene_words[table + DENSITY_COLUMNS];
    let rows = scene_words[table + DENSITY_ROWS];
    let row = min(u32(place.y * f32(rows)), rows - 1u);
    let column = min(u32(place.x * f32(columns)), columns - 1u);
    let marginal = scene_words[table + DENSITY_MARGINAL] + row;
    let conditional = scene_words[table + DENSITY_SUMS] + row * (columns + 1u) + column;
    return (number_at(marginal + 1u) - number_at(marginal)) * f32(rows)
        * (number_at(conditional + 1u) - number_at(conditional)) * f32(columns);
}

// Inverts cumulative sums of cells: returns the position, the density there, and in z the cell.
fn distribution_invert(at: u32, cells: u32, u: f32) -> vec3<f32> {
    let cell = last_at_or_below(at, cells + 1u, u);
    let start = number_at(at + cell);
    let share = number_at(at + cell + 1u) - start;
    var part = 0.5;
    if share > 0.0 {
        part = (u - start) / share;
    }
    return vec3(min((f32(cell) + part) / f32(cells), ONE_MINUS_EPSILON), share * f32(cells), f32(cell));
}

fn bilinear_rows_at(rows: u32, y: f32) -> RowsAt {
    let place = y * f32(rows) - 0.5;
    let above = min(u32(max(place, 0.0)), rows - 1u);
    return RowsAt(above, min(above + 1u, rows - 1u), clamp(place - f32(above), 0.0, 1.0));
}

fn bilinear_sample(table: u32, u: vec2<f32>) -> vec2<f32> {
    let columns = scene_words[table + DENSITY_COLUMNS];
    let rows = scene_words[table + DENSITY_ROWS];
    let values = scene_words[table + DENSITY_VALUES];
    let sums = scene_words[table + DENSITY_SUMS];
    let marginal = scene_words[table + DENSITY_MARGINAL];
    let width = columns + 1u;
    // Interval k goes from the center of row k − 1 to that of row k.
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
    y = min(y / f32(rows), ONE_MINUS_EPSILON);
    let between = bilinear_rows_at(rows, y);
    let goal = u.x * sum_between(sums, width, between, columns);
    // Find the last center whose sum is at or below the target.
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

fn bilinear_density(table: u32, at: vec2<f32>) -> f32 {
    let columns = scene_words[table + DENSITY_COLUMNS];
    let values = scene_words[table + DENSITY_VALUES];
    let between = bilinear_rows_at(scene_words[table + DENSITY_ROWS], at.y);
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

// Samples [0, 1] by a density that is linear from a to b.
fn sample_linear(a: f32, b: f32, u: f32) -> f32 {
    let root = sqrt(max(a * a + (b * b - a * a) * u, 0.0));
    if a + root > 0.0 {
        return clamp(u * (a + b) / (a + root), 0.0, 1.0);
    }
    return sqrt(u);
}

// Returns the last of `count` sums from `at` on that is at or below u, excluding the final one.
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

// Returns the sum of the bilinear table up to a column's center, interpolated between two rows.
fn sum_between(sums: u32, width: u32, between: RowsAt, column: u32) -> f32 {
    let above = number_at(sums + between.above * width + column);
    return above + (number_at(sums + between.below * width + column) - above) * between.lower;
}
