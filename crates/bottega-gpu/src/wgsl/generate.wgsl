// No twin.
//
// The first kernel of a pass: camera rays for all samples of the batch.

fn batch_number(at: u32) -> f32 {
    return bitcast<f32>(batch_words[at]);
}

fn batch_vec2(at: u32) -> vec2<f32> {
    return vec2(batch_number(at), batch_number(at + 1u));
}

fn batch_vec3(at: u32) -> vec3<f32> {
    return vec3(batch_number(at), batch_number(at + 1u), batch_number(at + 2u));
}

// Returns the last job that starts at or before `number`; `begins`: the word of a job that holds its start.
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

// Starts a path: finds its pixel and sample, and stores its camera ray.
fn start_path(path: u32) {
    let number = batch.first_path + path;
    let job = job_of(number, JOB_FIRST_PATH);
    let pixels = batch_words[job + JOB_PIXELS];
    let within = number - batch_words[job + JOB_FIRST_PATH];
    let sample_index = batch_words[job + JOB_FIRST_SAMPLE] + within / pixels;
    let pixel = within % pixels;
    let columns = batch_words[job + JOB_COLUMNS];
    let x = batch_words[job + JOB_X] + pixel % columns;
    let y = batch_words[job + JOB_Y] + pixel / columns;
    // Sample a position in the pixel by the filter.
    let from_pixel = pixel_sampler_new(x, y, sample_index);
    let u = quad(from_pixel, 0u);
    let dx = filter_sample(u.x);
    let dy = filter_sample(u.y);
    let place = vec2(f32(x) + 0.5 + dx.x, f32(y) + 0.5 + dy.x);

    // Generate the camera ray.
    let camera = batch.picture_at + PICTURE_CAMERA;
    let ray = camera_ray(camera, place, u.zw);
    set_field(PATH_ORIGIN, path, vec4(ray.origin, batch_number(camera + CAMERA_CONE_WIDTH)));
    set_field(PATH_DIRECTION, path, vec4(ray.direction, batch_number(camera + CAMERA_CONE_SPREAD)));
    set_field(PATH_THROUGHPUT, path, vec4<f32>(1.0));
    set_field(PATH_RADIANCE, path, vec4(0.0, 0.0, 0.0, -1.0));
    set_field(PATH_RECEIVER, path, vec4(ray.origin, select(1.0, 0.0, batch.albedo_at == NONE)));
    set_field(PATH_RECEIVER_NORMAL, path, vec4(0.0, 0.0, 0.0, dx.y * dy.y));
    set_field(PATH_ABSORPTION, path, vec4<f32>(0.0));
    set_bits(PATH_KEY, path, vec4(from_pixel.pixel_key, sample_index, 0u));
    set_field(PATH_ALBEDO, path, vec4<f32>(0.0));
    set_field(PATH_NORMAL, path, vec4<f32>(0.0));
    set_field(PATH_HIT, path, vec4(ray.reach, ray.start, 0.0, 0.0));
}

@compute @workgroup_size(GROUP_SIZE)
fn generate(@builtin(global_invocation_id) id: vec3<u32>) {
    if id.x < batch.path_count {
        start_path(id.x);
        queues[QUEUE_ACTIVE * batch.capacity + id.x] = id.x;
    }
}
