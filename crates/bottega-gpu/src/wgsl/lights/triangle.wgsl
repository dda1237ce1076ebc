// Twin: `bottega-render/src/lights/triangle.rs`.
//
// Triangles projected to the sphere of directions around a point.

// The projection of a triangle to the unit sphere around a point (Arvo 1995).
struct SphericalTriangle {
    a: vec3<f32>,
    b: vec3<f32>,
    c: vec3<f32>,
    cos_alpha: f32,
    sin_alpha: f32,
    // Solid angle; 0: seen edge-on, too small, or too large.
    area: f32,
}

fn spherical_triangle_new(corner: vec3<f32>, x: vec3<f32>, y: vec3<f32>, origin: vec3<f32>) -> SphericalTriangle {
    var seen: SphericalTriangle;
    seen.a = direction_or(corner - origin, vec3<f32>(0.0));
    seen.b = direction_or(corner + x - origin, vec3<f32>(0.0));
    seen.c = direction_or(corner + y - origin, vec3<f32>(0.0));
    seen.area = 0.0;
    let ab = direction_or(cross(seen.a, seen.b), vec3<f32>(0.0));
    let ca = direction_or(cross(seen.c, seen.a), vec3<f32>(0.0));
    if is_black(ab) || is_black(ca) {
        return seen;
    }
    let volume = abs(dot(seen.a, cross(seen.b, seen.c)));
    let denominator = 1.0 + dot(seen.a, seen.b) + dot(seen.b, seen.c) + dot(seen.c, seen.a);
    let area = 2.0 * atan2_of(volume, denominator);
    seen.cos_alpha = clamp(-dot(ab, ca), -1.0, 1.0);
    seen.sin_alpha = sqrt(max(1.0 - seen.cos_alpha * seen.cos_alpha, 0.0));
    if area >= 1e-3 && area < 6.2 && seen.sin_alpha > 1e-4 {
        seen.area = area;
    }
    return seen;
}

// Samples the projection uniformly; returns barycentric coordinates, x below 0 for no sample.
fn spherical_triangle_sample(
    seen: SphericalTriangle,
    corner: vec3<f32>,
    e1: vec3<f32>,
    e2: vec3<f32>,
    origin: vec3<f32>,
    u: vec2<f32>,
) -> vec2<f32> {
    let direction = spherical_triangle_direction(seen, u);
    let s1 = cross(direction, e2);
    let divisor = dot(s1, e1);
    if divisor == 0.0 {
        return vec2(-1.0, 0.0);
    }
    let s = origin - corner;
    let b = clamp(vec2(dot(s, s1) / divisor, dot(direction, cross(s, e1)) / divisor), vec2<f32>(0.0), vec2<f32>(1.0));
    return b / max(b.x + b.y, 1.0);
}

fn spherical_triangle_direction(seen: SphericalTriangle, u: vec2<f32>) -> vec3<f32> {
    // Sample the area that the great circle through b and the new corner cuts off.
    let part = sin_cos(u.x * seen.area + PI);
    let sin_phi = part.x * seen.cos_alpha - part.y * seen.sin_alpha;
    let cos_phi = part.y * seen.cos_alpha + part.x * seen.sin_alpha;
    let cos_c = dot(seen.a, seen.b);
    let k1 = cos_phi + seen.cos_alpha;
    let k2 = sin_phi - seen.sin_alpha * cos_c;
    let divisor = (k2 * sin_phi + k1 * cos_phi) * seen.sin_alpha;
    var cos_side = 1.0;
    if abs(divisor) > 1e-30 {
        cos_side = clamp((k2 + (k2 * cos_phi - k1 * sin_phi) * seen.cos_alpha) / divisor, -1.0, 1.0);
    }
    let sin_side = sqrt(max(1.0 - cos_side * cos_side, 0.0));
    let corner = cos_side * seen.a + sin_side * orthogonal_part(seen.c, seen.a);
    // Sample uniformly by area along the arc from b to the new corner.
    let cos_theta = 1.0 - u.y * (1.0 - dot(corner, seen.b));
    let sin_theta = sqrt(max(1.0 - cos_theta * cos_theta, 0.0));
    return direction_or(cos_theta * seen.b + sin_theta * orthogonal_part(corner, seen.b), vec3<f32>(0.0));
}

fn orthogonal_part(v: vec3<f32>, axis: vec3<f32>) -> vec3<f32> {
    return direction_or(v - dot(v, axis) * axis, vec3<f32>(0.0));
}
