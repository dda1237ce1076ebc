//! The choices of a request: enums whose names and meanings are defined here alone.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use strum::{EnumMessage, IntoStaticStr, VariantArray};

/// The name of the built-in engine.
pub const BUILTIN: &str = "builtin";

/// A choice among a few words.
pub trait WordChoice: Copy + PartialEq + Send + Sync + VariantArray + EnumMessage + 'static {
    /// Returns the word of this choice, as in JSON and on the command line.
    fn word(self) -> &'static str;

    /// Returns the meaning of the word, in a sentence or two.
    fn meaning(self) -> String {
        self.get_documentation().unwrap_or_default().replace('\n', " ")
    }

    /// Returns the choice of a word; `None`: there is no such word.
    fn of_word(word: &str) -> Option<Self> {
        Self::VARIANTS.iter().copied().find(|choice| choice.word() == word)
    }
}

/// Declares choices: enums whose variants are words in JSON, on command lines and in schemas.
macro_rules! choices {
    ($($(#[$attribute:meta])* $name:ident { $($(#[$variant_attribute:meta])* $variant:ident,)* })*) => {
        $(
            $(#[$attribute])*
            #[derive(
                Clone, Copy, Debug, PartialEq, Eq, Hash, Serialize, Deserialize, JsonSchema, EnumMessage, IntoStaticStr,
                VariantArray,
            )]
            #[serde(rename_all = "kebab-case")]
            #[strum(serialize_all = "kebab-case")]
            pub enum $name {
                $($(#[$variant_attribute])* $variant,)*
            }

            impl WordChoice for $name {
                fn word(self) -> &'static str {
                    self.into()
                }
            }
        )*
    };
}

choices! {
    /// How light is followed.
    IntegratorChoice {
        /// Path tracing: no error but noise.
        Path,
        /// Photon mapping: photons from the lights first, then the picture by what they know. Less noise, and light through
        /// glass that paths hardly find; a little blurred. No fog.
        Photon,
        /// Autonomous Lighting Agents: a few agents look the scene over first, and answer where light is hidden and how much of
        /// it comes from all around. No fog.
        Ala,
    }

    /// By which rules lighting agents answer.
    OracleChoice {
        /// By the error that is to be expected: they look around more where it is great, and answer where it is small.
        Error,
        /// Those of Herubel, Biri and Deverly 2009.
        Paper,
    }

    /// What lighting agents can be asked.
    OracleQuestion {
        /// Which shadow rays must be traced.
        Shadows,
        /// Where indirect light may be interpolated.
        Irradiance,
        /// What light comes from where to surfaces that are not matte, with the oracle `error`.
        Radiance,
        /// Whether a path goes on that has come to where they do not know the light well enough, with the oracle `error`.
        Halting,
    }

    /// What paths learn of the light before the first sample.
    GuideChoice {
        /// Nothing: paths go where materials send them.
        None,
        /// Where light comes from.
        Directions,
        /// All that lighting agents can tell: as well which lights matter, whether they are seen, and what a path is worth. The
        /// default.
        Ala,
    }

    /// What paths use lighting agents for.
    GuideUse {
        /// Shadow rays only where it is not known well enough whether a light is seen.
        Shadows,
        /// Lights are chosen by what comes of them.
        Lights,
        /// Paths go where light was found to come from.
        Directions,
        /// Paths end, or go on as several, by what they are worth.
        Roulette,
    }

    /// How samples are spread over a pixel.
    PixelFilter {
        /// Sharp and clean: the default.
        BlackmanHarris,
        /// Softer.
        Gaussian,
        /// Softer still at the edges.
        Tent,
        /// Sharper, with a little ringing.
        Mitchell,
        /// Just the pixel itself: for comparisons.
        Box,
    }

    /// How a PNG's highlights are brought into range.
    ToneCurve {
        /// Like film: colours fade to white.
        Agx,
        /// Contrasty, after the Academy's reference.
        Aces,
        /// As it is; what is above 1 is cut off.
        Linear,
    }

    /// How a PNG's values are stored.
    PngEncoding {
        /// For screens.
        Srgb,
        /// Linear light.
        Linear,
    }

    /// Which measure makes the importance map.
    ImportanceChoice {
        /// Predicted cost, from what a small path-traced look at the scene took.
        Predicted,
        /// Levels of recursion in mirrors and glass, as in the MAGarRO paper.
        Paper,
        /// How much an error would be seen.
        Visual,
    }

    /// What zones of level 3 have in common.
    BalanceChoice {
        /// The expected time, so that none is waited for: the default.
        Time,
        /// The complexity/size ratio, as the MAGarRO paper says.
        Ratio,
    }

    /// How the winners of an auction are found.
    AuctionChoice {
        /// An agent gets the largest zone that it finishes before the whole is expected to end, its promises weighed by how far
        /// they held before: the default.
        FinishingTime,
        /// The same, but each agent is taken at its word: what it promised before, and what came of it, counts for nothing.
        Promised,
        /// The most complex zone goes to the bidder with the most credit, as in the MAGarRO paper.
        Paper,
        /// No auction: zones are dealt out at once, each to the agent that would finish it soonest, and agents take from each other
        /// what waits.
        Stealing,
    }

    /// How agents learn their speed.
    AdaptationChoice {
        /// By the median of the last ratios of own to reference time: the default.
        Ratio,
        /// By equation (1) of the MAGarRO paper, as printed.
        Paper,
    }

    /// How far expert rules may trade quality for time.
    OptimizationChoice {
        /// Every zone at exactly the settings asked for.
        Off,
        /// Very small savings.
        Vs,
        /// Small savings.
        S,
        /// Normal savings.
        N,
        /// Big savings.
        B,
        /// Very big savings.
        Vb,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_choice_has_one_word_everywhere() {
        for &filter in PixelFilter::VARIANTS {
            assert_eq!(serde_json::to_value(filter).unwrap(), filter.word());
            assert_eq!(PixelFilter::of_word(filter.word()), Some(filter));
            assert!(!filter.meaning().is_empty());
        }
        assert_eq!(PixelFilter::BlackmanHarris.word(), "blackman-harris");
        let meaning = GuideChoice::Ala.meaning();
        assert!(meaning.contains("worth. The default."), "{meaning}");
    }
}
