// Twin: `bottega-render/src/filter.rs`.
//
// Sampling of positions in a pixel by a reconstruction filter.

// Returns an offset from the center of the pixel along one axis, and the weight of the sample.
fn filter_sample(u: f32) -> vec2<f32> {
    let filter_at = batch.picture_at + PICTURE_FILTER;
    let radius = batch_number(filter_at + FILTER_RADIUS);
    let table = batch_words[filter_at + FILTER_QUANTILES];
    if table == NONE {
        return vec2(radius * (2.0 * u - 1.0), 1.0);
    }
    let scaled = u * f32(FILTER_INTERVALS);
    let index = min(u32(scaled), FILTER_INTERVALS - 1u);
    let low = batch_number(batch.picture_at + table + index);
    let high = batch_number(batch.picture_at + table + index + 1u);
    let x = low + (scaled - f32(index)) * (high - low);
    let factor = batch_number(filter_at + FILTER_FACTOR);
    return vec2(radius * x, select(-factor, factor, abs(x) < batch_number(filter_at + FILTER_SIGN_CHANGE)));
}
