// Paths end: what they found is added to the sums of their pixels, sample by sample in their order.

@compute @workgroup_size(64)
fn accumulate(@builtin(global_invocation_id) id: vec3<u32>) {
    let pixel = id.x;
    if pixel >= batch.pixel_count {
        return;
    }
    let job = job_of(pixel, 6u);
    let pixels = batch_words[job + 3u];
    let begin = batch_words[job + 5u] + pixel - batch_words[job + 6u];
    let end = min(batch_words[job + 5u] + batch_words[job + 7u], batch.first_path + batch.path_count);
    // The first of its samples that is in this pass.
    var number = begin;
    if batch.first_path > begin {
        number += (batch.first_path - begin + pixels - 1u) / pixels * pixels;
    }
    // Summed here and added at the end: the sums are far away.
    var radiance_sum = vec3<f32>(0.0);
    var albedo_sum = vec4<f32>(0.0);
    var normal_sum = vec4<f32>(0.0);
    var square_sum = 0.0;
    var count = 0.0;
    var dropped = 0.0;
    for (; number < end; number += pixels) {
        let path = number - batch.first_path;
        // Asked of the bits: a compiler may take all numbers to be sound.
        let found = bits(RADIANCE, path).xyz;
        let is_sound = all((found & vec3(0x7f800000u)) != vec3(0x7f800000u));
        let factor = field(RECEIVER_NORMAL, path).w;
        let radiance = bitcast<vec3<f32>>(select(vec3(0u), found, is_sound)) * factor;
        let light = luminance(radiance);
        radiance_sum += radiance;
        albedo_sum += field(ALBEDO, path);
        square_sum += light * light;
        count += 1.0;
        dropped += select(1.0, 0.0, is_sound);
        if batch.normal_at != NONE || batch.depth_at != NONE {
            normal_sum += field(NORMAL, path);
        }
    }
    let at = pixel * batch.stride;
    add_sum(at, radiance_sum);
    sums[at + 3u] += albedo_sum.w;
    sums[at + 4u] += square_sum;
    sums[at + 5u] += count;
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
