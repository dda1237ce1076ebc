// Twin: `bottega-render/src/lights/rectangle.rs`.
//
// Rectangles projected to the sphere of directions around a point.

// The projection of a rectangle to the unit sphere around a point (Ureña, Fajardo and King 2013).
struct SphericalRectangle {
    low: vec2<f32>,
    high: vec2<f32>,
    height: f32,
    low_normal: f32,
    high_normal: f32,
    far_angles: f32,
    // Solid angle; 0: seen edge-on, or too small.
    area: f32,
}

fn plane_normal(offset: f32, height: f32) -> f32 {
    return offset / sqrt(height * height + offset * offset);
}

fn spherical_rectangle_new(corner: vec3<f32>, x: vec3<f32>, y: vec3<f32>, origin: vec3<f32>) -> SphericalRectangle {
    let width = length(x);
    let depth = length(y);
    let to_corner = corner - origin;
    let along_x = x / width;
    let along_y = y / depth;
    var seen: SphericalRectangle;
    seen.low = vec2(dot(to_corner, along_x), dot(to_corner, along_y));
    seen.high = seen.low + vec2(width, depth);
    seen.height = abs(dot(to_corner, cross(along_x, along_y)));
    seen.area = 0.0;
    if !(seen.height > 1e-4 * max(width, depth)) {
        return seen;
    }
    let low_y = -plane_normal(seen.low.y, seen.height);
    let high_x = plane_normal(seen.high.x, seen.height);
    let high_y = plane_normal(seen.high.y, seen.height);
    let low_x = -plane_normal(seen.low.x, seen.height);
    let g0 = acos_of(clamp(-low_y * high_x, -1.0, 1.0));
    let g1 = acos_of(clamp(-high_x * high_y, -1.0, 1.0));
    let g2 = acos_of(clamp(-high_y * low_x, -1.0, 1.0));
    let g3 = acos_of(clamp(-low_x * low_y, -1.0, 1.0));
    let area = g0 + g1 + g2 + g3 - 2.0 * PI;
    seen.low_normal = low_y;
    seen.high_normal = high_y;
    seen.far_angles = 2.0 * PI - g2 - g3;
    seen.area = select(0.0, area, area > 5e-3);
    return seen;
}

// Samples the projection uniformly; returns coordinates along both sides.
fn spherical_rectangle_sample(seen: SphericalRectangle, u: vec2<f32>) -> vec2<f32> {
    let turn = sin_cos(u.x * seen.area + seen.far_angles);
    let sine_floor = with_sign(max(abs(turn.x), 1e-18), turn.x);
    let f = clamp((turn.y * seen.low_normal - seen.high_normal) / sine_floor, -1e15, 1e15);
    let cosine = with_sign(min(1.0 / sqrt(max(f * f + seen.low_normal * seen.low_normal, 1e-20)), 1.0), f);
    let x = clamp(cosine * seen.height / sqrt(max(1.0 - cosine * cosine, 1e-12)), seen.low.x, seen.high.x);
    let distance = sqrt(x * x + seen.height * seen.height);
    let low = seen.low.y / sqrt(distance * distance + seen.low.y * seen.low.y);
    let high = seen.high.y / sqrt(distance * distance + seen.high.y * seen.high.y);
    let sine = low + u.y * (high - low);
    let y = clamp(sine * distance / sqrt(max(1.0 - sine * sine, 1e-12)), seen.low.y, seen.high.y);
    return clamp((vec2(x, y) - seen.low) / (seen.high - seen.low), vec2<f32>(0.0), vec2<f32>(1.0));
}
