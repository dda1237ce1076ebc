//! Channels of the survey: one quantity per cell each.

use std::{fmt, str::FromStr};

use bottega_engines::{Survey, SurveyPixel};
use bottega_image::luminance;
use serde::{Deserialize, Serialize};

use super::saliency::saliency;

/// A quantity from which importance maps are made.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Channel {
    /// Traversal steps per path: nodes and leaves that all its rays visit.
    Steps,
    /// Vertices per path.
    Path,
    /// Shadow rays per path.
    Shadow,
    /// Vertices per path at surfaces with several lobes, plus texture lookups: the cost of scattering.
    Material,
    /// Levels of recursion in mirror and transparent surfaces: mean number of consecutive mirrored or refracted
    /// bounces.
    Recursion,
    /// Nearness of the first surface: 1 for the nearest, falling with the reciprocal of distance, 0 without a surface.
    Depth,
    /// Share of the light that was scattered more than once.
    Indirect,
    /// Standard deviation of the first surface's reflectance within the cell.
    Texture,
    /// Standard deviation of a sample's luminance, relative to the luminance of the surroundings.
    Noise,
    /// Saliency, 0..=1: how strongly the place attracts the eye (Itti, Koch and Niebur 1998).
    Saliency,
}

impl Channel {
    /// All channels, in the order of their declaration.
    pub const ALL: [Self; 10] = [
        Self::Steps,
        Self::Path,
        Self::Shadow,
        Self::Material,
        Self::Recursion,
        Self::Depth,
        Self::Indirect,
        Self::Texture,
        Self::Noise,
        Self::Saliency,
    ];

    /// Returns the name in the command line, JSON and file names.
    pub fn name(self) -> &'static str {
        match self {
            Self::Steps => "steps",
            Self::Path => "path",
            Self::Shadow => "shadow",
            Self::Material => "material",
            Self::Recursion => "recursion",
            Self::Depth => "depth",
            Self::Indirect => "indirect",
            Self::Texture => "texture",
            Self::Noise => "noise",
            Self::Saliency => "saliency",
        }
    }

    /// Returns a short description of the channel's values, for users.
    pub fn meaning(self) -> &'static str {
        match self {
            Self::Steps => "traversal steps of a path",
            Self::Path => "vertices of a path",
            Self::Shadow => "rays towards lights of a path",
            Self::Material => "vertices at surfaces of several lobes, and textures looked up, of a path",
            Self::Recursion => "levels of recursion in mirror and transparent surfaces",
            Self::Depth => "nearness of the first surface, from 0 (none) to 1 (nearest)",
            Self::Indirect => "share of the light that came over more than one scattering",
            Self::Texture => "standard deviation of the first surface's reflectance",
            Self::Noise => "standard deviation of a sample relative to the surroundings",
            Self::Saliency => "where the eye goes first, from 0 to 1",
        }
    }

    /// Returns the value of every cell, row-major, `[width × height]`: finite and not negative for any survey.
    pub fn values(self, survey: &Survey) -> Vec<f32> {
        let of_pixel = |value: fn(&SurveyPixel) -> f32| survey.pixels.iter().map(|pixel| sane(value(pixel))).collect();
        match self {
            Self::Steps => of_pixel(|pixel| pixel.steps),
            Self::Path => of_pixel(|pixel| pixel.path_length),
            Self::Shadow => of_pixel(|pixel| pixel.shadow_rays),
            Self::Material => of_pixel(|pixel| sane(pixel.layered) + sane(pixel.lookups)),
            Self::Recursion => of_pixel(|pixel| pixel.recursion_levels),
            Self::Depth => nearness(survey),
            Self::Indirect => of_pixel(|pixel| sane(pixel.indirect).min(1.0)),
            Self::Texture => of_pixel(|pixel| pixel.detail),
            Self::Noise => relative_noise(survey),
            Self::Saliency => {
                let colors: Vec<[f32; 3]> = survey.pixels.iter().map(|pixel| pixel.color.map(sane)).collect();
                saliency(survey.width, survey.height, &colors)
            }
        }
    }
}

impl fmt::Display for Channel {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.name())
    }
}

impl FromStr for Channel {
    type Err = UnknownChannel;

    fn from_str(name: &str) -> Result<Self, UnknownChannel> {
        let found = Self::ALL.into_iter().find(|channel| channel.name() == name.trim());
        found.ok_or_else(|| UnknownChannel { found: name.to_owned() })
    }
}

/// The error of parsing a name that no channel has.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("unknown channel `{found}`: there are {}", Channel::ALL.map(Channel::name).join(", "))]
pub struct UnknownChannel {
    /// The name that was given.
    pub found: String,
}

/// A set of channels. A channel outside the set counts everywhere as its mean over the picture, so it does not
/// distinguish places, and the others keep their weight.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct ChannelSet(u16);

impl ChannelSet {
    /// The set of all channels.
    pub const ALL: Self = Self((1 << Channel::ALL.len()) - 1);
    /// No channel: a uniform map.
    pub const NONE: Self = Self(0);

    /// Returns the set with `channel` added.
    #[must_use]
    pub fn with(self, channel: Channel) -> Self {
        Self(self.0 | 1 << channel as u16)
    }

    /// Returns true if `channel` is in the set.
    pub fn contains(self, channel: Channel) -> bool {
        self.0 & (1 << channel as u16) != 0
    }

    /// Returns the channels in the set, in the order of [`Channel::ALL`].
    pub fn iter(self) -> impl Iterator<Item = Channel> {
        Channel::ALL.into_iter().filter(move |&channel| self.contains(channel))
    }
}

impl Default for ChannelSet {
    fn default() -> Self {
        Self::ALL
    }
}

impl FromIterator<Channel> for ChannelSet {
    fn from_iter<I: IntoIterator<Item = Channel>>(channels: I) -> Self {
        channels.into_iter().fold(Self::NONE, Self::with)
    }
}

/// Replaces values that are not finite or not positive by 0, and bounds them by 10⁹.
pub(super) fn sane(value: f32) -> f32 {
    if value.is_finite() && value > 0.0 { value.min(1e9) } else { 0.0 }
}

/// Returns the near distance over each cell's distance, at most 1. The near distance is the 5 % quantile, so that a
/// single very near cell does not make everything else far.
fn nearness(survey: &Survey) -> Vec<f32> {
    const NEAREST_SHARE: usize = 20;
    let mut distances: Vec<f32> = survey.pixels.iter().map(|pixel| sane(pixel.depth)).filter(|&d| d > 0.0).collect();
    if distances.is_empty() {
        return vec![0.0; survey.pixels.len()];
    }
    let place = distances.len() / NEAREST_SHARE;
    let (_, &mut near, _) = distances.select_nth_unstable_by(place, f32::total_cmp);
    let of_pixel = |pixel: &SurveyPixel| match sane(pixel.depth) {
        0.0 => 0.0,
        distance => (near / distance).min(1.0),
    };
    survey.pixels.iter().map(of_pixel).collect()
}

/// Returns the noise over the luminance of the surroundings. Darker surroundings than a tenth of the picture's mean
/// count as that tenth, below which noise is not visible.
fn relative_noise(survey: &Survey) -> Vec<f32> {
    const DARK: f64 = 0.1;
    let surround = smoothed(survey, |pixel| luminance(pixel.color.map(sane)));
    let mean = surround.iter().map(|&value| f64::from(value)).sum::<f64>() / surround.len().max(1) as f64;
    let dark = ((mean * DARK) as f32).max(f32::MIN_POSITIVE);
    survey.pixels.iter().zip(&surround).map(|(pixel, &around)| sane(sane(pixel.noise) / around.max(dark))).collect()
}

/// Returns a value per cell, smoothed with its neighbors by the weights 1 2 1 in both directions: surveys have few
/// samples per cell and are noisy, while costs of neighboring pixels are similar.
pub(super) fn smoothed(survey: &Survey, value: impl Fn(&SurveyPixel) -> f32) -> Vec<f32> {
    let (width, height) = (survey.width as usize, survey.height as usize);
    let values: Vec<f32> = survey.pixels.iter().map(value).collect();
    let blurred_x: Vec<f32> = (0..values.len())
        .map(|i| {
            let (x, row) = (i % width, i - i % width);
            0.25 * values[row + x.saturating_sub(1)] + 0.5 * values[i] + 0.25 * values[row + (x + 1).min(width - 1)]
        })
        .collect();
    (0..values.len())
        .map(|i| {
            let (x, y) = (i % width, i / width);
            let above = blurred_x[y.saturating_sub(1) * width + x];
            let below = blurred_x[(y + 1).min(height - 1) * width + x];
            0.25 * above + 0.5 * blurred_x[i] + 0.25 * below
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn channels_are_written_as_they_are_read() {
        for channel in Channel::ALL {
            assert_eq!(channel.to_string().parse(), Ok(channel));
        }
        assert!("glamour".parse::<Channel>().unwrap_err().to_string().contains("saliency"));
        assert_eq!(ChannelSet::ALL.iter().collect::<ChannelSet>(), ChannelSet::ALL);
        assert_eq!(ChannelSet::NONE.with(Channel::Depth).iter().collect::<Vec<_>>(), [Channel::Depth]);
    }

    #[test]
    fn what_is_near_is_nearer_and_the_sky_is_not() {
        let depths = [0.0, 1.0, 2.0, 4.0];
        let pixels = depths.map(|depth| SurveyPixel { depth, ..SurveyPixel::default() }).to_vec();
        let survey = Survey { width: 4, height: 1, pixels, zones_max: None };
        assert_eq!(Channel::Depth.values(&survey), [0.0, 1.0, 0.5, 0.25]);
    }

    #[test]
    fn no_channel_believes_what_is_no_number() {
        let wild = |v: f32| SurveyPixel {
            recursion_levels: v,
            steps: v,
            color: [v; 3],
            noise: v,
            albedo: [v; 3],
            depth: v,
            path_length: v,
            shadow_rays: v,
            layered: v,
            lookups: v,
            media: v,
            indirect: v,
            detail: v,
        };
        let values = [f32::NAN, f32::INFINITY, -1.0, f32::MAX, 0.0, 1.0];
        let pixels = (0..36).map(|i| wild(values[(i * 5 + i / 7) % 6])).collect();
        let survey = Survey { width: 6, height: 6, pixels, zones_max: None };
        for channel in Channel::ALL {
            let values = channel.values(&survey);
            assert!(values.iter().all(|value| value.is_finite() && *value >= 0.0), "{channel}: {values:?}");
        }
    }
}
