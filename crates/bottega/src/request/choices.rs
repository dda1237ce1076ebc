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
    /// The integrator.
    IntegratorChoice {
        /// Path tracing: unbiased; the only error is noise.
        Path,
        /// Photon mapping: photons from the lights first, then the picture from their density. Less noise, and light through
        /// glass that paths hardly find; slightly blurred. No fog.
        Photon,
        /// Autonomous Lighting Agents: a few agents explore the scene first, and answer which points are lit and how much
        /// indirect light they get. No fog.
        Ala,
        /// Paths or photons, zone by zone, whichever a trial before the picture finds better for its time. Photons are slightly
        /// blurred, so they are tried only with an `optimization` of the work; without it, paths render everything.
        Auto,
    }

    /// The projection of a camera.
    ProjectionChoice {
        /// The whole sphere: longitude along the rows, latitude down the columns; the view ahead is in the middle.
        Equirectangular,
        /// The whole sphere in a square, in which equal areas cover equal solid angles; the view up is in the middle.
        EqualArea,
        /// Six square pictures side by side: towards +x, -x, +y, -y, +z and -z of the camera.
        Cube,
        /// A circle in which distance from the middle is in proportion to the angle; see `view.fisheye_fov`.
        Fisheye,
        /// A circle in which equal areas cover equal solid angles; see `view.fisheye_fov`.
        EquisolidFisheye,
    }

    /// The places of the pictures for two eyes, or one of the eyes.
    StereoChoice {
        /// The left eye's picture is the left half.
        SideBySide,
        /// The left eye's picture is the upper half.
        TopBottom,
        /// The left eye's picture alone.
        Left,
        /// The right eye's picture alone.
        Right,
    }

    /// The rules by which lighting agents answer.
    OracleChoice {
        /// By the expected error: agents sample more where it is large, and answer where it is small.
        Error,
        /// The rules of Herubel, Biri and Deverly 2009.
        Paper,
    }

    /// The questions for lighting agents.
    OracleQuestion {
        /// Shadow rays: the agents decide which of them must be traced.
        Shadows,
        /// Indirect light: the agents decide where it is interpolated.
        Irradiance,
        /// Incident light at surfaces that are not matte, with the oracle `error`.
        Radiance,
    }

    /// Path guiding: knowledge of the light, learned before the first sample.
    GuideChoice {
        /// No guiding: directions are sampled by the materials alone.
        None,
        /// The directions that light comes from.
        Directions,
        /// All uses of lighting agents: directions, the choice of lights, their visibility, and what a path is worth. The
        /// default.
        Ala,
    }

    /// The uses of lighting agents in path tracing.
    GuideUse {
        /// Traces shadow rays only where the visibility of the light is uncertain.
        Shadows,
        /// Chooses lights by their contribution.
        Lights,
        /// Samples the directions that light comes from.
        Directions,
        /// Russian roulette and splitting by the expected contribution of a path.
        Roulette,
    }

    /// The pixel filter.
    PixelFilter {
        /// Sharp and clean: the default.
        BlackmanHarris,
        /// Softer than the default.
        Gaussian,
        /// Softer still at the edges.
        Tent,
        /// Sharper, with a little ringing.
        Mitchell,
        /// A box of one pixel: for comparisons.
        Box,
    }

    /// The tone curve of a PNG.
    ToneCurve {
        /// Like film: bright colors fade to white.
        Agx,
        /// Contrasty, after the Academy's reference.
        Aces,
        /// Linear; values above 1 are clipped.
        Linear,
    }

    /// The encoding of PNG values.
    PngEncoding {
        /// The sRGB curve, for screens.
        Srgb,
        /// Linear light, without a curve.
        Linear,
    }

    /// The compression of an EXR file.
    Compression {
        /// Lossless, in blocks of 16 rows; every program reads it: the default.
        Zip,
        /// Lossless, row by row: for programs that read parts of a picture, such as Nuke.
        Zips,
        /// Lossless; the smallest for noisy pictures, slower.
        Piz,
        /// Lossless and fast; good for flat colors.
        Rle,
        /// Lossy, a third of the size or less; the eye sees no difference. Rounds colors: the picture, light and
        /// albedo. Keeps all other layers, such as alpha, depth, normals and Cryptomattes, without loss, because a rounded
        /// number or identity misleads compositing.
        Dwaa,
        /// As `dwaa`, a little smaller.
        Dwab,
        /// No compression.
        None,
    }

    /// The color space of an EXR file; all are linear.
    ColorSpace {
        /// The primaries of Rec. 709 and sRGB: the default.
        Rec709,
        /// The primaries of Rec. 2020.
        Rec2020,
        /// The primaries of Display P3.
        P3,
        /// The primaries AP1 of ACES, in which most compositing is done.
        Acescg,
        /// The primaries AP0 of ACES, for interchange.
        Aces2065,
    }

    /// The measure of the importance map.
    ImportanceChoice {
        /// Predicted cost, from the cost of a small path-traced survey of the scene.
        Predicted,
        /// Levels of recursion in mirrors and glass, as in the MAGarRO paper.
        Paper,
        /// The visibility of errors.
        Visual,
    }

    /// The quantity that level 3 balances.
    BalanceChoice {
        /// The expected time, so that agents do not wait for a slow zone: the default.
        Time,
        /// The complexity/size ratio, as the MAGarRO paper says.
        Ratio,
    }

    /// The rule that decides auctions.
    AuctionChoice {
        /// Each agent gets the largest zone that it can finish before the expected end of the job, with its promises weighted
        /// by its reliability: the default.
        FinishingTime,
        /// Like `finishing-time`, but promises count without regard to reliability.
        Promised,
        /// The most complex zone goes to the bidder with the most credit, as in the MAGarRO paper.
        Paper,
        /// No auction: each zone is assigned at once to the agent that finishes it soonest, and idle agents take waiting zones
        /// from others.
        Stealing,
    }

    /// The rule by which agents adapt V_cp.
    AdaptationChoice {
        /// By the median of the last ratios of own time to reference time: the default.
        Ratio,
        /// By equation (1) of the MAGarRO paper, as printed.
        Paper,
    }

    /// Degree to which expert rules may trade quality for time.
    OptimizationChoice {
        /// Every zone has exactly the requested settings.
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
