//! Visual importance: how visible an error is.
//!
//! The mean of one estimate per channel; the literature has no formula that combines them. Sources of the parts: Itti,
//! Koch and Niebur 1998 (saliency); Ferwerda, Pattanaik, Shirley and Greenberg 1997, *A Model of Visual Masking for
//! Computer Graphics* (texture hides errors).

use bottega_engines::Survey;

use super::{Channel, ChannelSet};

/// Returns the visual importance of every cell, row-major, 0..=1: the mean over the active channels; ½ everywhere
/// without any.
pub(super) fn importance(survey: &Survey, channels: ChannelSet) -> Vec<f32> {
    let parts: Vec<Vec<f32>> = channels
        .iter()
        .filter_map(|channel| {
            let says = says(channel)?;
            Some(channel.values(survey).into_iter().map(says).collect())
        })
        .collect();
    let share = 1.0 / parts.len().max(1) as f32;
    let of_cell = |i: usize| if parts.is_empty() { 0.5 } else { parts.iter().map(|part| part[i] * share).sum::<f32>() };
    (0..survey.pixels.len()).map(|i| of_cell(i).clamp(0.0, 1.0)).collect()
}

/// Returns the function from a channel's value to the visibility of an error, 0..=1; `None`: the channel has no
/// effect on it.
fn says(channel: Channel) -> Option<fn(f32) -> f32> {
    match channel {
        // Expensive places do not attract the eye for that reason.
        Channel::Steps | Channel::Path | Channel::Shadow | Channel::Material => None,
        // Mirrors and glass show their surroundings sharply.
        Channel::Recursion => Some(|levels| levels / (1.0 + levels)),
        Channel::Depth | Channel::Indirect | Channel::Saliency => Some(|value| value),
        // A standard deviation of 0.2 in reflectance halves the visibility of noise.
        Channel::Texture => Some(|deviation| 0.2 / (0.2 + deviation)),
        // Noise as strong as the luminance of the surroundings dominates.
        Channel::Noise => Some(|noise| noise / (1.0 + noise)),
    }
}

#[cfg(test)]
mod tests {
    use bottega_engines::SurveyPixel;

    use super::*;

    fn of(change: impl Fn(&mut SurveyPixel), channel: Channel) -> [f32; 2] {
        let plain = SurveyPixel { color: [0.5; 3], depth: 4.0, ..SurveyPixel::default() };
        let mut pixels = vec![plain; 64];
        change(&mut pixels[27]);
        let importance =
            importance(&Survey { width: 8, height: 8, pixels, zones_max: None }, ChannelSet::NONE.with(channel));
        [importance[27], importance[3]]
    }

    #[test]
    fn each_channel_moves_importance_its_own_way() {
        let [changed, plain] = of(|pixel| pixel.noise = 0.4, Channel::Noise);
        assert!(changed > plain);
        let [changed, plain] = of(|pixel| pixel.indirect = 0.9, Channel::Indirect);
        assert!(changed > plain);
        let [changed, plain] = of(|pixel| pixel.recursion_levels = 3.0, Channel::Recursion);
        assert!(changed > plain);
        let [changed, plain] = of(|pixel| pixel.depth = 9.0, Channel::Depth);
        assert!(changed < plain);
        let [changed, plain] = of(|pixel| pixel.detail = 0.3, Channel::Texture);
        assert!(changed < plain);
        let [changed, plain] = of(|pixel| pixel.color = [4.0; 3], Channel::Saliency);
        assert!(changed > plain);
        assert_eq!(of(|pixel| pixel.steps = 1e4, Channel::Steps), [0.5; 2]);
    }
}
