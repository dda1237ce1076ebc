// Paths begin: the camera's rays of all samples of the batch.

// Places in the picture's record, from its beginning.
const CAMERA_HALF_EXTENT: u32 = 12u;
const CAMERA_SHIFT: u32 = 14u;
const CAMERA_DOUBLE_PIXEL: u32 = 16u;
const CAMERA_KIND: u32 = 18u;
const CAMERA_LENS: u32 = 19u;
const CAMERA_FOCUS: u32 = 20u;
const CAMERA_CONE: u32 = 21u;
const CAMERA_NEAR: u32 = 23u;
const CAMERA_FAR: u32 = 24u;
const FILTER_RADIUS: u32 = 25u;
const FILTER_TABLE: u32 = 26u;
const FILTER_FACTOR: u32 = 27u;
const FILTER_SIGN_CHANGE: u32 = 28u;
const FILTER_INTERVALS: u32 = 512u;

// A job: first column and row, columns, pixels, first sample, first path, first pixel of the sums, paths.
const JOB_WORDS: u32 = 8u;

fn batch_number(at: u32) -> f32 {
    return bitcast<f32>(batch_words[at]);
}

fn batch_vec3(at: u32) -> vec3<f32> {
    return vec3(batch_number(at), batch_number(at + 1u), batch_number(at + 2u));
}

// The last job that begins at or before a number, by the word of the job that tells where it begins.
fn job_of(number: u32, begins: u32) -> u32 {
    var first = 0u;
    var last = batch.job_count;
    while last - first > 1u {
        let middle = (first + last) / 2u;
        if batch_words[batch.jobs_at + middle * JOB_WORDS + begins] <= number {
            first = middle;
        } else {
            last = middle;
        }
    }
    return batch.jobs_at + first * JOB_WORDS;
}

// Offset from the center of the pixel along one axis, and the factor of the sample.
fn filter_offset(u: f32) -> vec2<f32> {
    let picture = batch.picture_at;
    let radius = batch_number(picture + FILTER_RADIUS);
    let table = batch_words[picture + FILTER_TABLE];
    if table == NONE {
        return vec2(radius * (2.0 * u - 1.0), 1.0);
    }
    let scaled = u * f32(FILTER_INTERVALS);
    let index = min(u32(scaled), FILTER_INTERVALS - 1u);
    let low = batch_number(picture + table + index);
    let high = batch_number(picture + table + index + 1u);
    let x = low + (scaled - f32(index)) * (high - low);
    let factor = batch_number(picture + FILTER_FACTOR);
    return vec2(radius * x, select(-factor, factor, abs(x) < batch_number(picture + FILTER_SIGN_CHANGE)));
}

// The concentric map (Shirley and Chiu 1997).
fn uniform_disk(u: vec2<f32>) -> vec2<f32> {
    let a = 2.0 * u.x - 1.0;
    let b = 2.0 * u.y - 1.0;
    if a == 0.0 && b == 0.0 {
        return vec2<f32>(0.0);
    }
    let is_flat = abs(a) > abs(b);
    let radius = select(b, a, is_flat);
    let angle = select(0.5 * PI - 0.25 * PI * (a / select(b, 1.0, is_flat)), 0.25 * PI * (b / select(1.0, a, is_flat)), is_flat);
    return radius * sin_cos(angle).yx;
}

// The direction at a place of a panorama, both from 0 to 1; beyond its edges the sphere goes on.
fn around(is_equal_area: bool, place: vec2<f32>) -> vec3<f32> {
    if !is_equal_area {
        let theta = sin_cos(PI * place.y);
        let phi = sin_cos(2.0 * PI * place.x);
        return vec3(theta.x * phi.y, theta.y, -theta.x * phi.x);
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

fn start_path(path: u32) {
    let number = batch.first_path + path;
    let job = job_of(number, 5u);
    let pixels = batch_words[job + 3u];
    let within = number - batch_words[job + 5u];
    let sample_index = batch_words[job + 4u] + within / pixels;
    let pixel = within % pixels;
    let columns = batch_words[job + 2u];
    let x = batch_words[job] + pixel % columns;
    let y = batch_words[job + 1u] + pixel / columns;
    let from_pixel = sampler_of(x, y, sample_index);
    let u = quad(from_pixel, 0u);
    let dx = filter_offset(u.x);
    let dy = filter_offset(u.y);
    let place = vec2(f32(x) + 0.5 + dx.x, f32(y) + 0.5 + dy.x);

    let camera = batch.picture_at;
    let double_pixel = vec2(batch_number(camera + CAMERA_DOUBLE_PIXEL), batch_number(camera + CAMERA_DOUBLE_PIXEL + 1u));
    let shift = vec2(batch_number(camera + CAMERA_SHIFT), batch_number(camera + CAMERA_SHIFT + 1u));
    let half_extent = vec2(batch_number(camera + CAMERA_HALF_EXTENT), batch_number(camera + CAMERA_HALF_EXTENT + 1u));
    let offset = place * double_pixel - 1.0;
    let film = (vec2(offset.x, -offset.y) - shift) * half_extent;
    let kind = batch_words[camera + CAMERA_KIND];
    let is_parallel = kind == 1u;
    var origin = select(vec3<f32>(0.0), vec3(film, 0.0), is_parallel);
    var direction = select(vec3(film, -1.0), vec3(0.0, 0.0, -1.0), is_parallel);
    if kind > 1u {
        direction = around(kind == 3u, 0.5 * place * double_pixel);
    }
    let lens = batch_number(camera + CAMERA_LENS);
    if lens > 0.0 {
        // All rays of one place meet in the plane in focus.
        let focus = origin + direction * batch_number(camera + CAMERA_FOCUS);
        origin += vec3(lens * uniform_disk(u.zw), 0.0);
        direction = focus - origin;
    }
    var start = 0.0;
    var reach = FAR;
    let near = batch_number(camera + CAMERA_NEAR);
    let far = batch_number(camera + CAMERA_FAR);
    if kind <= 1u && (near > 0.0 || far < FAR) {
        // The line of sight is -z; a ray that slants comes to a plane later.
        let slant = length(direction) / -direction.z;
        start = near * slant;
        if far < FAR {
            reach = (far - near) * slant;
        }
        origin += direction * (near / -direction.z);
    }
    let turn = mat3x3<f32>(batch_vec3(camera), batch_vec3(camera + 3u), batch_vec3(camera + 6u));
    let world_origin = turn * origin + batch_vec3(camera + 9u);
    set_field(ORIGIN, path, vec4(world_origin, batch_number(camera + CAMERA_CONE)));
    set_field(DIRECTION, path, vec4(normalize(turn * direction), batch_number(camera + CAMERA_CONE + 1u)));
    set_field(THROUGHPUT, path, vec4<f32>(1.0));
    set_field(RADIANCE, path, vec4(0.0, 0.0, 0.0, -1.0));
    set_field(RECEIVER, path, vec4(world_origin, select(1.0, 0.0, batch.albedo_at == NONE)));
    set_field(RECEIVER_NORMAL, path, vec4(0.0, 0.0, 0.0, dx.y * dy.y));
    set_field(ABSORPTION, path, vec4<f32>(0.0));
    set_bits(KEY, path, vec4(from_pixel.pixel_key, sample_index, 0u));
    set_field(ALBEDO, path, vec4<f32>(0.0));
    set_field(NORMAL, path, vec4<f32>(0.0));
    set_field(HIT, path, vec4(reach, start, 0.0, 0.0));
}

@compute @workgroup_size(64)
fn generate(@builtin(global_invocation_id) id: vec3<u32>) {
    if id.x < batch.path_count {
        start_path(id.x);
        queues[ACTIVE_QUEUE * batch.capacity + id.x] = id.x;
    }
}
