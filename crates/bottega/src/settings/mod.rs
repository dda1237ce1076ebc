//! Single choices of a request, as the settings of engines, farm and files.
//!
//! [`Plan`](crate::plan::Plan) puts those of a picture together.

mod catchers;
mod guiding;
mod layers;
mod light_groups;
mod photons;

use bottega_farm::{
    AdaptationRule, AuctionRule, Balance, BandWidth, ChannelSet, ImportanceFunction, Level, Optimization, ZoneLimits,
};
use bottega_image::{Encoding, ExrColorSpace, ExrCompression, ExrOptions, HalfOrFloat, ToneMap};
use bottega_render::Filter;

pub(crate) use self::{
    catchers::catchers,
    guiding::asks_for_agents,
    layers::ALL as ALL_LAYERS,
    light_groups::{group_layers, light_groups},
};
pub use self::{
    guiding::{directions, guide_agents, whole_guide},
    layers::{GUIDES, own_layers},
    photons::{agent_photons, photon_settings},
};
use crate::{
    loaded_scene::LoadedScene,
    request::{
        AdaptationChoice, AuctionChoice, BalanceChoice, BandChoice, ColorSpace, Compression, DEPTH_MAX,
        ImportanceChoice, OptimizationChoice, OutputOptions, PixelFilter, PngEncoding, Request, ToneCurve, WorkOptions,
    },
};

/// Maximum number of bounces if neither request nor scene gives one.
const DEFAULT_DEPTH: u32 = 16;

/// Returns the maximum number of bounces of light: that of the request, that of the scene file, or the default.
pub fn max_depth(request: &Request, subject: &LoadedScene) -> u32 {
    request.integrator.max_depth.or(subject.hints.max_depth).map_or(DEFAULT_DEPTH, |depth| depth.min(DEPTH_MAX))
}

/// Returns the number of Render Agents: the requested one, else one per two CPU threads.
pub fn agents(requested: Option<u16>, threads: usize) -> usize {
    requested.map_or(threads.div_ceil(2), usize::from)
}

/// Returns the level of division into zones with this number; for a number above all levels, the highest one.
pub fn level(level: u8) -> Level {
    Level::ALL[usize::from(level).min(Level::ALL.len() - 1)]
}

/// Returns the limits on zones of a request: smallest side, largest complexity, similarity and balance.
pub fn zone_limits(work: &WorkOptions) -> ZoneLimits {
    ZoneLimits {
        side_min: work.zone_min_size,
        complexity_max: work.zone_max_complexity,
        similarity: work.zone_similarity,
        balance: match work.zone_balance {
            BalanceChoice::Time => Balance::Time,
            BalanceChoice::Ratio => Balance::Ratio,
        },
    }
}

/// Returns the width of the interpolation bands between zones.
pub(crate) fn band_width(bands: BandChoice) -> BandWidth {
    match bands {
        BandChoice::Off => BandWidth::Off,
        BandChoice::Rules => BandWidth::Rules,
        BandChoice::Pixels(pixels) => BandWidth::Pixels(pixels),
    }
}

/// Returns the degree of optimization.
pub(crate) fn optimization(optimization: OptimizationChoice) -> Optimization {
    match optimization {
        OptimizationChoice::Off => Optimization::Off,
        OptimizationChoice::Vs => Optimization::VerySmall,
        OptimizationChoice::S => Optimization::Small,
        OptimizationChoice::N => Optimization::Normal,
        OptimizationChoice::B => Optimization::Big,
        OptimizationChoice::Vb => Optimization::VeryBig,
    }
}

/// Returns the rule that decides auctions, as chosen in a request.
pub fn auction_rule(choice: AuctionChoice) -> AuctionRule {
    match choice {
        AuctionChoice::FinishingTime => AuctionRule::FinishingTime,
        AuctionChoice::Promised => AuctionRule::Promised,
        AuctionChoice::Paper => AuctionRule::Paper,
        AuctionChoice::Stealing => AuctionRule::Stealing,
    }
}

/// Returns the rule by which agents adapt V_cp, as chosen in a request.
pub fn adaptation_rule(choice: AdaptationChoice) -> AdaptationRule {
    match choice {
        AdaptationChoice::Ratio => AdaptationRule::MedianRatio,
        AdaptationChoice::Paper => AdaptationRule::Paper,
    }
}

/// Returns the measure of the importance map, with its channels.
pub fn importance_function(work: &WorkOptions) -> ImportanceFunction {
    let channels = match &work.channels {
        Some(channels) => channels.iter().copied().collect::<ChannelSet>(),
        None => ChannelSet::ALL,
    };
    match work.importance {
        ImportanceChoice::Predicted => ImportanceFunction::PredictedCost(channels),
        ImportanceChoice::Paper => ImportanceFunction::Paper,
        ImportanceChoice::Visual => ImportanceFunction::Visual(channels),
    }
}

/// Returns the pixel filter.
pub(crate) fn filter(request: &Request, subject: &LoadedScene) -> Filter {
    match request.film.filter {
        None => subject.hints.filter.unwrap_or_default(),
        Some(PixelFilter::BlackmanHarris) => Filter::default(),
        Some(PixelFilter::Gaussian) => Filter::Gaussian { radius: 1.5, sigma: 0.5 },
        Some(PixelFilter::Tent) => Filter::Tent { radius: 1.0 },
        Some(PixelFilter::Mitchell) => Filter::Mitchell { radius: 2.0, b: 1.0 / 3.0, c: 1.0 / 3.0 },
        Some(PixelFilter::Box) => Filter::PIXEL,
    }
}

/// Returns the tone map of a curve chosen in a request.
pub fn tone(tone: ToneCurve) -> ToneMap {
    match tone {
        ToneCurve::Agx => ToneMap::Agx,
        ToneCurve::Aces => ToneMap::Aces,
        ToneCurve::Linear => ToneMap::Linear,
    }
}

/// Returns the options of an EXR file.
pub(crate) fn exr_options(output: &OutputOptions) -> ExrOptions {
    ExrOptions {
        depth: if output.half { HalfOrFloat::Half } else { HalfOrFloat::Float },
        tiled: output.tiled,
        compression: match output.compression {
            Compression::Zip => ExrCompression::Zip,
            Compression::Zips => ExrCompression::Zips,
            Compression::Piz => ExrCompression::Piz,
            Compression::Rle => ExrCompression::Rle,
            Compression::Dwaa => ExrCompression::Dwaa,
            Compression::Dwab => ExrCompression::Dwab,
            Compression::None => ExrCompression::None,
        },
        parts: output.parts,
        color_space: match output.colorspace {
            ColorSpace::Rec709 => ExrColorSpace::Rec709,
            ColorSpace::Rec2020 => ExrColorSpace::Rec2020,
            ColorSpace::P3 => ExrColorSpace::P3,
            ColorSpace::Acescg => ExrColorSpace::AcesCg,
            ColorSpace::Aces2065 => ExrColorSpace::Aces2065,
        },
    }
}

/// Returns the encoding of PNG values.
pub(crate) fn encoding(encoding: PngEncoding) -> Encoding {
    match encoding {
        PngEncoding::Srgb => Encoding::Srgb,
        PngEncoding::Linear => Encoding::Linear,
    }
}
