// Lights with extent, seen from a point: `bottega_render::lights::{surface, rectangle, triangle, sphere}`.

// A light that is seen under a larger solid angle than this is sampled by solid angle, in sr.
const SOLID_ANGLE_MIN: f32 = 0.25;

// A place on a light, drawn for a point.
struct LightSample {
    wi: vec3<f32>,
    // −1: infinitely far.
    distance: f32,
    radiance: vec3<f32>,
    // Per solid angle; of a light without extent the probability alone. 0: these numbers give no light.
    pdf: f32,
    is_delta: bool,
}

fn no_light() -> LightSample {
    return LightSample(vec3<f32>(0.0), 0.0, vec3<f32>(0.0), 0.0, false);
}

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

fn spherical_rectangle(corner: vec3<f32>, x: vec3<f32>, y: vec3<f32>, origin: vec3<f32>) -> SphericalRectangle {
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

// Coordinates along both sides of a place whose direction is uniform over the projection.
fn sample_rectangle(seen: SphericalRectangle, u: vec2<f32>) -> vec2<f32> {
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

// The projection of a triangle to the unit sphere around a point (Arvo 1995).
struct SphericalTriangle {
    a: vec3<f32>,
    b: vec3<f32>,
    c: vec3<f32>,
    cos_alpha: f32,
    sin_alpha: f32,
    // Solid angle; 0: seen edge-on, or too small, or too large.
    area: f32,
}

fn spherical_triangle(corner: vec3<f32>, x: vec3<f32>, y: vec3<f32>, origin: vec3<f32>) -> SphericalTriangle {
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

fn orthogonal_part(v: vec3<f32>, axis: vec3<f32>) -> vec3<f32> {
    return direction_or(v - dot(v, axis) * axis, vec3<f32>(0.0));
}

fn triangle_direction(seen: SphericalTriangle, u: vec2<f32>) -> vec3<f32> {
    // The area of the part that the great circle through b and the new corner cuts off.
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
    // Uniform by area along the arc from b to the new corner.
    let cos_theta = 1.0 - u.y * (1.0 - dot(corner, seen.b));
    let sin_theta = sqrt(max(1.0 - cos_theta * cos_theta, 0.0));
    return direction_or(cos_theta * seen.b + sin_theta * orthogonal_part(corner, seen.b), vec3<f32>(0.0));
}

// Barycentric coordinates of a place whose direction is uniform over the projection; x below 0: none.
fn sample_triangle(
    seen: SphericalTriangle,
    corner: vec3<f32>,
    e1: vec3<f32>,
    e2: vec3<f32>,
    origin: vec3<f32>,
    u: vec2<f32>,
) -> vec2<f32> {
    let direction = triangle_direction(seen, u);
    let s1 = cross(direction, e2);
    let divisor = dot(s1, e1);
    if divisor == 0.0 {
        return vec2(-1.0, 0.0);
    }
    let s = origin - corner;
    let b = clamp(vec2(dot(s, s1) / divisor, dot(direction, cross(s, e1)) / divisor), vec2<f32>(0.0), vec2<f32>(1.0));
    return b / max(b.x + b.y, 1.0);
}

// Barycentric coordinates uniform over a triangle (Heitz 2019).
fn uniform_triangle(u: vec2<f32>) -> vec2<f32> {
    if u.y > u.x {
        return vec2(0.5 * u.x, u.y - 0.5 * u.x);
    }
    return vec2(u.x - 0.5 * u.y, 0.5 * u.y);
}

// A surface that shines, or a part of it: its record, corner and sides.
struct Panel {
    record: u32,
    is_rectangle: bool,
    corner: vec3<f32>,
    x: vec3<f32>,
    y: vec3<f32>,
    normal: vec3<f32>,
    double_area: f32,
}

fn panel_of(record: u32) -> Panel {
    let corner = vec3_at(record + 4u);
    let x = vec3_at(record + 7u);
    let y = vec3_at(record + 10u);
    let part = vec3_at(record + 13u);
    var panel: Panel;
    panel.record = record;
    panel.is_rectangle = scene_words[record + 3u] != 0u;
    panel.corner = corner + x * part.x + y * part.y;
    panel.x = x * part.z;
    panel.y = y * part.z;
    panel.normal = cross(panel.x, panel.y);
    panel.double_area = length_of(panel.normal);
    return panel;
}

// Whether it is seen under so large an angle that it is sampled by that: an upper bound, good enough from afar.
fn is_near(panel: ptr<function, Panel>, origin: vec3<f32>) -> bool {
    let share = select(1.0 / 3.0, 0.5, (*panel).is_rectangle);
    let middle = (*panel).corner + ((*panel).x + (*panel).y) * share - origin;
    return panel_area(panel) > SOLID_ANGLE_MIN * dot(middle, middle);
}

fn panel_area(panel: ptr<function, Panel>) -> f32 {
    return (*panel).double_area * select(0.5, 1.0, (*panel).is_rectangle);
}

// The place of a triangle at a place along the sides: barycentric coordinates, and whether it is the second of a rectangle.
fn triangle_of_panel(shape: u32, place: vec2<f32>) -> vec3<f32> {
    if shape == 0u {
        return vec3(place, 0.0);
    }
    let corner = shape & 3u;
    let opposite = (shape >> 2u) & 3u;
    let is_second = place.x + place.y > 1.0;
    let along = select(
        vec3(1.0 - place.x - place.y, place),
        vec3(place.x + place.y - 1.0, 1.0 - place),
        is_second,
    );
    let turn = select(corner, opposite, is_second);
    // weights[(turn + i) % 3] = along[i].
    let b = vec2(along[(4u - turn) % 3u], along[(5u - turn) % 3u]);
    return vec3(b, select(0.0, 1.0, is_second));
}

fn sample_surface(record: u32, origin: vec3<f32>, u: vec2<f32>) -> LightSample {
    var panel = panel_of(record);
    var place = u;
    var solid_angle = 0.0;
    if panel.is_rectangle {
        if is_near(&panel, origin) {
            let seen = spherical_rectangle(panel.corner, panel.x, panel.y, origin);
            solid_angle = seen.area;
            if seen.area > 0.0 {
                place = sample_rectangle(seen, u);
            }
        }
    } else {
        place = uniform_triangle(u);
        if is_near(&panel, origin) {
            let seen = spherical_triangle(panel.corner, panel.x, panel.y, origin);
            solid_angle = seen.area;
            if seen.area > 0.0 {
                place = sample_triangle(seen, panel.corner, panel.x, panel.y, origin, u);
                if place.x < 0.0 {
                    return no_light();
                }
            }
        }
    }
    let to_light = panel.corner + panel.x * place.x + panel.y * place.y - origin;
    let distance = length_of(to_light);
    // The projected area times the distance, above 0 where the front is seen.
    let facing = -dot(panel.normal, to_light);
    let material = scene_words[record + 16u];
    let flags = material_flags(material);
    let side = select(MATERIAL_EMITS_BACK, MATERIAL_EMITS_FRONT, facing > 0.0);
    if !(distance > 0.0) || facing == 0.0 || (flags & side) == 0u {
        return no_light();
    }
    var pdf = 0.0;
    if solid_angle > 0.0 {
        pdf = 1.0 / solid_angle;
    } else {
        let projected = abs(facing) * (panel_area(&panel) / panel.double_area);
        pdf = distance * distance * distance / max(projected, 1e-37);
    }
    if !(pdf < FAR) {
        return no_light();
    }
    var radiance: vec3<f32>;
    if (flags & (MATERIAL_TEXTURED | MATERIAL_HAS_OPACITY)) == 0u {
        radiance = material_emission(material, vec2<f32>(0.0), vec2<f32>(0.0), 0.0);
    } else {
        let on_panel = vec2(number_at(record + 13u), number_at(record + 14u)) + place * number_at(record + 15u);
        let at = triangle_of_panel(scene_words[record + 3u], on_panel);
        let surface = place_of(scene_words[record + 1u], scene_words[record + 2u] + u32(at.z), at.xy);
        radiance = emitted(surface) * opacity(surface);
    }
    return LightSample(to_light / distance, distance, radiance, pdf, false);
}

fn surface_pdf(record: u32, origin: vec3<f32>, p: vec3<f32>) -> f32 {
    var panel = panel_of(record);
    if is_near(&panel, origin) {
        var solid_angle = 0.0;
        if panel.is_rectangle {
            solid_angle = spherical_rectangle(panel.corner, panel.x, panel.y, origin).area;
        } else {
            solid_angle = spherical_triangle(panel.corner, panel.x, panel.y, origin).area;
        }
        if solid_angle > 0.0 {
            return 1.0 / solid_angle;
        }
    }
    let to_light = p - origin;
    let distance = length_of(to_light);
    let projected = abs(dot(panel.normal, to_light)) * (panel_area(&panel) / panel.double_area);
    return select(0.0, distance * distance * distance / max(projected, 1e-37), projected > 0.0);
}

// The part of the sphere of directions that a sphere covers, seen from outside: its axis, and 1 − cos of its half angle; that
// is 0 at or below the surface, and a hair's breadth above it.
fn sphere_cone(center: vec3<f32>, radius: f32, origin: vec3<f32>) -> vec4<f32> {
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

fn sphere_area_pdf(radius: f32, cosine: f32, distance: f32) -> f32 {
    if !(cosine > 0.0) {
        return 0.0;
    }
    return min(distance * distance / (cosine * 4.0 * PI * radius * radius), FAR);
}

fn uniform_sphere(u: vec2<f32>) -> vec3<f32> {
    let z = 1.0 - 2.0 * u.x;
    let r = sqrt(max(1.0 - z * z, 0.0));
    let turn = math_turns(u.y);
    return vec3(r * turn.y, r * turn.x, z);
}

fn sample_sphere(index: u32, origin: vec3<f32>, u: vec2<f32>) -> LightSample {
    let sphere = sphere_at(index);
    let center = vec3_at(sphere);
    let radius = number_at(sphere + 3u);
    let cone = sphere_cone(center, radius, origin);
    var wi: vec3<f32>;
    var distance: f32;
    var pdf: f32;
    if cone.w > 0.0 {
        let one_minus_cos = u.x * cone.w;
        let sine_squared = one_minus_cos * (2.0 - one_minus_cos);
        let turn = math_turns(u.y);
        let basis = basis_of(cone.xyz);
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
    let material = scene_words[sphere + 8u];
    let side = select(MATERIAL_EMITS_BACK, MATERIAL_EMITS_FRONT, dot(wi, n) < 0.0);
    if (material_flags(material) & side) == 0u || !(pdf > 0.0) || !(pdf < FAR) {
        return no_light();
    }
    let uv = sphere_uv(sphere, n);
    return LightSample(wi, distance, material_emission(material, uv, uv, 0.0), pdf, false);
}

fn sphere_pdf(index: u32, origin: vec3<f32>, p: vec3<f32>) -> f32 {
    let sphere = sphere_at(index);
    let center = vec3_at(sphere);
    let radius = number_at(sphere + 3u);
    let cone = sphere_cone(center, radius, origin);
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
