// Twin: `bottega-render/src/lights/punctual.rs`.
//
// Lights without extent.

fn punctual_sample(record: u32, origin: vec3<f32>) -> LightSample {
    let to_light = vec3_at(record + POINT_LIGHT_POSITION) - origin;
    let distance = length(to_light);
    if !(distance > 0.0) {
        return no_light();
    }
    let wi = to_light / distance;
    var intensity = vec3_at(record + POINT_LIGHT_INTENSITY);
    switch scene_words[record + POINT_LIGHT_KIND] {
        case LIGHT_POINT: {}
        case LIGHT_SPOT: {
            intensity *= punctual_fall_off(record, -dot(wi, vec3_at(record + SPOT_LIGHT_DIRECTION)));
        }
        case LIGHT_GONIOMETRIC: {
            let place = square_of(transpose(mat3_at(record + PICTURE_LIGHT_WORLD_FROM_LIGHT)) * -wi);
            intensity *= math_mean(image_eval(scene_words[record + PICTURE_LIGHT_PICTURE], place, 0.0).xyz);
        }
        case LIGHT_PROJECTOR: {
            intensity *= punctual_projected(record, wi);
        }
        default: {
            intensity = vec3<f32>(0.0);
        }
    }
    let radiance = intensity / (distance * distance);
    if is_black(radiance) {
        return no_light();
    }
    return LightSample(wi, distance, radiance, 1.0, true);
}

fn punctual_projected(record: u32, wi: vec3<f32>) -> vec3<f32> {
    let local = transpose(mat3_at(record + PICTURE_LIGHT_WORLD_FROM_LIGHT)) * -wi;
    if local.z >= 0.0 {
        return vec3<f32>(0.0);
    }
    let half_height = number_at(record + PICTURE_LIGHT_HALF_HEIGHT);
    let place = vec2(local.x / number_at(record + PICTURE_LIGHT_ASPECT), -local.y) / (-local.z * half_height);
    if max(abs(place.x), abs(place.y)) > 1.0 {
        return vec3<f32>(0.0);
    }
    let texel = image_eval(scene_words[record + PICTURE_LIGHT_PICTURE], place * 0.5 + 0.5, 0.0).xyz;
    let cosine = -local.z;
    return texel / (cosine * cosine * cosine);
}

fn punctual_fall_off(record: u32, cosine: f32) -> f32 {
    let cos_inner = number_at(record + SPOT_LIGHT_COS_INNER);
    let cos_outer = number_at(record + SPOT_LIGHT_COS_OUTER);
    if cosine >= cos_inner {
        return 1.0;
    }
    if cosine <= cos_outer {
        return 0.0;
    }
    let ramp = (cosine - cos_outer) / (cos_inner - cos_outer);
    switch scene_words[record + SPOT_LIGHT_FALLOFF] {
        case SPOT_SQUARED_COSINE: {
            return ramp * ramp;
        }
        case SPOT_SMOOTH_COSINE: {
            return ramp * ramp * (3.0 - 2.0 * ramp);
        }
        default: {
            let outer = acos_of(cos_outer);
            return (outer - acos_of(cosine)) / (outer - acos_of(cos_inner));
        }
    }
}
