// No twin.
//
// The last kernel of a pass: adds the radiance of its paths to the sums of their pixels, in the order of the samples.

@compute @workgroup_size(GROUP_SIZE)
fn accumulate(@builtin(global_invocation_id) id: vec3<u32>) {
    let pixel = id.x;
    if pixel >= batch.pixel_count {
        return;
    }
    let job = job_of(pixel, JOB_FIRST_PIXEL);
    let pixels = batch_words[job + JOB_PIXELS];
    let begin = batch_words[job + JOB_FIRST_PATH] + pixel - batch_words[job + JOB_FIRST_PIXEL];
    let end = min(batch_words[job + JOB_FIRST_PATH] + batch_words[job + JOB_PATHS], batch.first_path + batch.path_count);
    // The first sample of the pixel in this pass.
    var number = begin;
    if batch.first_path > begin {
        number += (batch.first_path - begin + pixels - 1u) / pixels * pixels;
    }
    // Sum in registers and write once: memory is far away.
    var radiance_sum = vec3<f32>(0.0);
    var albedo_sum = vec4<f32>(0.0);
    var normal_sum = vec4<f32>(0.0);
    var square_sum = 0.0;
    var count = 0.0;
    var dropped = 0.0;
    for (; number < end; number += pixels) {
        let path = number - batch.first_path;
        // Check the bits: a compiler may assume that all floats are finite.
        let found = bits(PATH_RADIANCE, path).xyz;
        let is_sound = all((found & vec3(0x7f800000u)) != vec3(0x7f800000u));
        let factor = field(PATH_RECEIVER_NORMAL, path).w;
        // Drop invalid samples, and clamp bright ones.
        let whole = bitcast<vec3<f32>>(select(vec3(0u), found, is_sound));
        let greatest = max(max(whole.x, whole.y), whole.z);
        let sample_max = bitcast<f32>(batch.sample_max);
        let radiance = whole * select(1.0, sample_max / greatest, greatest > sample_max) * factor;
        let light = luminance(radiance);
        radiance_sum += radiance;
        albedo_sum += field(PATH_ALBEDO, path);
        square_sum += light * light;
        count += 1.0;
        dropped += select(1.0, 0.0, is_sound);
        if batch.normal_at != NONE || batch.depth_at != NONE {
            normal_sum += field(PATH_NORMAL, path);
        }
    }
    // Add to the pixel's sums.
    let at = pixel * batch.stride;
    add_sum(at, radiance_sum);
    sums[at + SUM_ALPHA] += albedo_sum.w;
    sums[at + SUM_SQUARE] += square_sum;
    sums[at + SUM_COUNT] += count;
    sums[at + batch.stride - 1u] += dropped;
    if batch.albedo_at != NONE {
        add_sum(at + batch.albedo_at, albedo_sum.xyz);
    }
    if batch.normal_at != NONE {
        add_sum(at + batch.normal_at, normal_sum.xyz);
    }
    if batch.depth_at != NONE {
        sums[at + batch.depth_at] += normal_sum.w;
    }
}

fn add_sum(at: u32, value: vec3<f32>) {
    sums[at] += value.x;
    sums[at + 1u] += value.y;
    sums[at + 2u] += value.z;
}
