// Twin: `bottega-render/src/camera.rs`.
//
// Camera rays.

// A ray in world space, and the part of it that is traced.
struct CameraRay {
    origin: vec3<f32>,
    // Distance from the camera to its start, and its length from there.
    start: f32,
    direction: vec3<f32>,
    reach: f32,
}

// Returns the ray through a position of the image, in pixels. `lens`: two uniform numbers.
fn camera_ray(camera: u32, place: vec2<f32>, lens: vec2<f32>) -> CameraRay {
    let double_pixel = batch_vec2(camera + CAMERA_DOUBLE_PIXEL);
    let offset = place * double_pixel - 1.0;
    let film = (vec2(offset.x, -offset.y) - batch_vec2(camera + CAMERA_SHIFT)) * batch_vec2(camera + CAMERA_HALF_EXTENT);
    let kind = batch_words[camera + CAMERA_KIND];
    let is_parallel = kind == CAMERA_PARALLEL;
    let is_panorama = kind == CAMERA_EQUIRECTANGULAR || kind == CAMERA_EQUAL_AREA;
    var origin = select(vec3<f32>(0.0), vec3(film, 0.0), is_parallel);
    var direction = select(vec3(film, -1.0), vec3(0.0, 0.0, -1.0), is_parallel);
    if is_panorama {
        direction = around(kind == CAMERA_EQUAL_AREA, 0.5 * place * double_pixel);
    }
    let radius = batch_number(camera + CAMERA_LENS_RADIUS);
    if radius > 0.0 {
        // All rays of one position meet in the plane in focus.
        let focus = origin + direction * batch_number(camera + CAMERA_FOCUS);
        origin += vec3(radius * uniform_disk(lens), 0.0);
        direction = focus - origin;
    }
    var start = 0.0;
    var reach = FAR;
    let near = batch_number(camera + CAMERA_NEAR);
    let far = batch_number(camera + CAMERA_FAR);
    if !is_panorama && (near > 0.0 || far < FAR) {
        // The line of sight is -z; an oblique ray travels farther to reach a plane.
        let slant = length(direction) / -direction.z;
        start = near * slant;
        if far < FAR {
            reach = (far - near) * slant;
        }
        origin += direction * (near / -direction.z);
    }
    let turn = camera + CAMERA_WORLD_FROM_CAMERA;
    let world_from_camera = mat3x3<f32>(batch_vec3(turn), batch_vec3(turn + 3u), batch_vec3(turn + 6u));
    let world_origin = world_from_camera * origin + batch_vec3(camera + CAMERA_POSITION);
    return CameraRay(world_origin, start, normalize(world_from_camera * direction), reach);
}

// Returns the direction at a position of a panorama, both coordinates from 0 to 1; beyond the edges the sphere continues.
fn around(is_equal_area: bool, place: vec2<f32>) -> vec3<f32> {
    if !is_equal_area {
        let theta = sin_cos(PI * place.y);
        let phi = sin_cos(2.0 * PI * (place.x - 0.5));
        return vec3(theta.x * phi.x, theta.y, -theta.x * phi.y);
    }
    var at = place;
    if at.x < 0.0 || at.x > 1.0 {
        at = vec2(select(2.0, 0.0, at.x < 0.0) - at.x, 1.0 - at.y);
    }
    if at.y < 0.0 || at.y > 1.0 {
        at = vec2(1.0 - at.x, select(2.0, 0.0, at.y < 0.0) - at.y);
    }
    at = at * 2.0 - 1.0;
    let flat = abs(at);
    let from_edge = 1.0 - (flat.x + flat.y);
    let radius = 1.0 - abs(from_edge);
    let angle = select(0.0, 0.25 * PI * ((flat.y - flat.x) / max(radius, 1e-30) + 1.0), radius > 0.0);
    let up = select(1.0 - radius * radius, radius * radius - 1.0, from_edge < 0.0);
    let turn = sin_cos(angle) * (radius * sqrt(max(2.0 - radius * radius, 0.0)));
    return vec3(select(turn.y, -turn.y, at.x < 0.0), up, select(-turn.x, turn.x, at.y < 0.0));
}
