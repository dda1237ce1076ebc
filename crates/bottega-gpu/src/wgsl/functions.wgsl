// No twin.
//
// Functions that WGSL leaves imprecise, to a few units in the last place. Coefficients: Moshier, Cephes (single precision).

fn atan_of(x: f32) -> f32 {
    let size = abs(x);
    var base = 0.0;
    var y = size;
    if size > 2.41421356 {
        base = 0.5 * PI;
        y = -1.0 / size;
    } else if size > 0.41421356 {
        base = 0.25 * PI;
        y = (size - 1.0) / (size + 1.0);
    }
    let z = y * y;
    let part = (((8.05374449538e-2 * z - 1.38776856032e-1) * z + 1.99777106478e-1) * z - 3.33329491539e-1) * z * y + y;
    return with_sign(base + part, x);
}

fn atan2_of(y: f32, x: f32) -> f32 {
    let wide = max(abs(x), abs(y));
    if !(wide > 0.0) {
        return 0.0;
    }
    var angle = atan_of(min(abs(x), abs(y)) / wide);
    if abs(y) > abs(x) {
        angle = 0.5 * PI - angle;
    }
    if x < 0.0 {
        angle = PI - angle;
    }
    return with_sign(angle, y);
}

fn acos_of(x: f32) -> f32 {
    let size = min(abs(x), 1.0);
    let is_steep = size > 0.5;
    let z = select(size * size, 0.5 * (1.0 - size), is_steep);
    let y = select(size, sqrt(z), is_steep);
    let part = ((((4.2163199048e-2 * z + 2.4181311049e-2) * z + 4.5470025998e-2) * z + 7.4953002686e-2) * z
        + 1.6666752422e-1) * z * y + y;
    if is_steep {
        return select(2.0 * part, PI - 2.0 * part, x < 0.0);
    }
    return 0.5 * PI - with_sign(part, x);
}

// Returns sine and cosine, for angles of a few turns.
fn sin_cos(x: f32) -> vec2<f32> {
    let quadrant = round(x * 0.636619772367581);
    // Subtract π/2 in three parts.
    let r = ((x - quadrant * 1.5703125) - quadrant * 4.837512969970703e-4) - quadrant * 7.549789948768648e-8;
    let z = r * r;
    let s = ((-1.9515295891e-4 * z + 8.3321608736e-3) * z - 1.6666654611e-1) * z * r + r;
    let c = ((2.443315711809948e-5 * z - 1.388731625493765e-3) * z + 4.166664568298827e-2) * z * z - 0.5 * z + 1.0;
    let q = i32(quadrant) & 3;
    let swapped = select(vec2(s, c), vec2(c, s), (q & 1) == 1);
    return vec2(select(swapped.x, -swapped.x, q >= 2), select(swapped.y, -swapped.y, q == 1 || q == 2));
}
