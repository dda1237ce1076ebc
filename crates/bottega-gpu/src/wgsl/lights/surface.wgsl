// Twin: `bottega-render/src/lights/surface.rs`.
//
// Emissive surfaces.

// An emissive surface, or a part of it: its record, corner and sides.
struct SurfaceLight {
    record: u32,
    is_rectangle: bool,
    corner: vec3<f32>,
    x: vec3<f32>,
    y: vec3<f32>,
    normal: vec3<f32>,
    double_area: f32,
}

fn surface_light_new(record: u32) -> SurfaceLight {
    let corner = vec3_at(record + SURFACE_LIGHT_CORNER);
    let x = vec3_at(record + SURFACE_LIGHT_X);
    let y = vec3_at(record + SURFACE_LIGHT_Y);
    let part = vec3_at(record + SURFACE_LIGHT_PART);
    var light: SurfaceLight;
    light.record = record;
    light.is_rectangle = scene_words[record + SURFACE_LIGHT_SHAPE] != PANEL_TRIANGLE;
    light.corner = corner + x * part.x + y * part.y;
    light.x = x * part.z;
    light.y = y * part.z;
    light.normal = cross(light.x, light.y);
    light.double_area = length_of(light.normal);
    return light;
}

// Checks that the solid angle is large enough to sample by it, by an upper bound that is tight from afar.
fn surface_light_is_near(light: ptr<function, SurfaceLight>, origin: vec3<f32>) -> bool {
    let share = select(1.0 / 3.0, 0.5, (*light).is_rectangle);
    let middle = (*light).corner + ((*light).x + (*light).y) * share - origin;
    return surface_light_area(light) > SOLID_ANGLE_MIN * dot(middle, middle);
}

fn surface_light_area(light: ptr<function, SurfaceLight>) -> f32 {
    return (*light).double_area * select(0.5, 1.0, (*light).is_rectangle);
}

fn surface_light_sample(record: u32, origin: vec3<f32>, u: vec2<f32>) -> LightSample {
    var light = surface_light_new(record);
    var place = u;
    var solid_angle = 0.0;
    if light.is_rectangle {
        if surface_light_is_near(&light, origin) {
            let seen = spherical_rectangle_new(light.corner, light.x, light.y, origin);
            solid_angle = seen.area;
            if seen.area > 0.0 {
                place = spherical_rectangle_sample(seen, u);
            }
        }
    } else {
        place = uniform_triangle(u);
        if surface_light_is_near(&light, origin) {
            let seen = spherical_triangle_new(light.corner, light.x, light.y, origin);
            solid_angle = seen.area;
            if seen.area > 0.0 {
                place = spherical_triangle_sample(seen, light.corner, light.x, light.y, origin, u);
                if place.x < 0.0 {
                    return no_light();
                }
            }
        }
    }
    let to_light = light.corner + light.x * place.x + light.y * place.y - origin;
    let distance = length_of(to_light);
    // Projected area times distance; positive if the front is seen.
    let facing = -dot(light.normal, to_light);
    let material = scene_words[record + SURFACE_LIGHT_MATERIAL];
    let flags = material_flags(material);
    let side = select(MATERIAL_EMITS_BACK, MATERIAL_EMITS_FRONT, facing > 0.0);
    if !(distance > 0.0) || facing == 0.0 || (flags & side) == 0u {
        return no_light();
    }
    var pdf = 0.0;
    if solid_angle > 0.0 {
        pdf = 1.0 / solid_angle;
    } else {
        let projected = abs(facing) * (surface_light_area(&light) / light.double_area);
        pdf = distance * distance * distance / max(projected, 1e-37);
    }
    if !(pdf < FAR) {
        return no_light();
    }
    var radiance: vec3<f32>;
    if (flags & (MATERIAL_TEXTURED | MATERIAL_HAS_OPACITY)) == 0u {
        radiance = material_emission(material, vec2<f32>(0.0), vec2<f32>(0.0), 0.0);
    } else {
        let part = vec3_at(record + SURFACE_LIGHT_PART);
        let on_panel = part.xy + place * part.z;
        let at = panel_triangle_at(scene_words[record + SURFACE_LIGHT_SHAPE], on_panel);
        let surface = place_of(scene_words[record + SURFACE_LIGHT_INSTANCE], scene_words[record + SURFACE_LIGHT_TRIANGLE] + u32(at.z), at.xy);
        radiance = emitted(surface) * opacity(surface);
    }
    return LightSample(to_light / distance, distance, radiance, pdf, false);
}

fn surface_light_pdf(record: u32, origin: vec3<f32>, p: vec3<f32>) -> f32 {
    var light = surface_light_new(record);
    if surface_light_is_near(&light, origin) {
        var solid_angle = 0.0;
        if light.is_rectangle {
            solid_angle = spherical_rectangle_new(light.corner, light.x, light.y, origin).area;
        } else {
            solid_angle = spherical_triangle_new(light.corner, light.x, light.y, origin).area;
        }
        if solid_angle > 0.0 {
            return 1.0 / solid_angle;
        }
    }
    let to_light = p - origin;
    let distance = length_of(to_light);
    let projected = abs(dot(light.normal, to_light)) * (surface_light_area(&light) / light.double_area);
    return select(0.0, distance * distance * distance / max(projected, 1e-37), projected > 0.0);
}
