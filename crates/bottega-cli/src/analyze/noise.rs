//! The noise of a picture: images by pixel, and a table by kind of path.

use std::fmt::Write as _;

use bottega::{
    analysis::AnalyzedScene,
    devices::threads,
    noise::{FINDERS, KindNoise, Noise, measure_noise},
};
use bottega_image::{Canvas, ColorMap};
use bottega_render::{LightFinder, PathKind};
use serde_json::{Value, json};

use super::draw::PictureFolder;
use crate::{cli::AnalyzeArgs, error::CliError};

/// The least share of light or error that a row of the table has.
const SHARE_MIN: f64 = 0.005;

/// Measures the noise, and draws it.
pub(super) fn draw(
    args: &AnalyzeArgs,
    subject: &AnalyzedScene,
    drawn: &mut PictureFolder<'_>,
) -> Result<Noise, CliError> {
    let noise =
        measure_noise(&subject.subject, args.noise_spp, args.noise.unwrap_or_default(), threads(&subject.request))?;
    // One scale for all images, so that they can be compared
    let white = (4.0 * noise.relative.sqrt() as f32).max(1e-3);
    let heat = |values: &[f32]| Canvas::heat_map(noise.width, noise.height, values, white, ColorMap::Inferno);
    let scale = format!("relative error of a pixel at {} samples, white: {white:.3}", args.noise_spp);
    drawn.put("noise", &heat(&noise.by_pixel), &scale)?;
    for (finder, values) in FINDERS.into_iter().zip(&noise.by_finder) {
        let (name, meaning) = match finder {
            LightFinder::Sample => ("noise-light-samples", "of light samples"),
            LightFinder::Scattering => ("noise-scattered-rays", "of scattered rays that hit lights"),
            LightFinder::Mirror => {
                ("noise-mirrors-and-glass", "of rays over mirrors and through glass that hit lights")
            }
        };
        drawn.put(name, &heat(values), &format!("the part {meaning}, on the same scale"))?;
    }
    Ok(noise)
}

/// Returns the words for the end of a path.
fn words(finder: LightFinder) -> &'static str {
    match finder {
        LightFinder::Sample => "light sample",
        LightFinder::Scattering => "scattered ray",
        LightFinder::Mirror => "over mirror or glass",
    }
}

fn bounces(kind: PathKind) -> String {
    format!("{}{}", kind.bounces, if kind.is_open() { " and more" } else { "" })
}

/// Returns the table of the kinds of paths that matter.
pub(super) fn table(args: &AnalyzeArgs, noise: &Noise) -> String {
    let mut text = format!(
        "noise at {} samples per pixel: relMSE {:.3e}, mean squared difference of sRGB values {:.3e}\n\
         {:>9}  {:<21} {:>7} {:>10} {:>10}\n",
        args.noise_spp, noise.relative, noise.shown, "bounces", "found by", "light", "of relMSE", "of sRGB"
    );
    let matters = |it: &&KindNoise| [it.light, it.relative, it.shown].iter().any(|&share| share >= SHARE_MIN);
    for it in noise.kinds.iter().filter(matters) {
        let [light, relative, shown] = [it.light, it.relative, it.shown].map(|share| 100.0 * share);
        // Writing to a string cannot fail.
        _ = writeln!(
            text,
            "{:>9}  {:<21} {light:>5.1} % {relative:>8.1} % {shown:>8.1} %",
            bounces(it.kind),
            words(it.kind.finder)
        );
    }
    text
}

/// Returns the noise as JSON.
pub(super) fn report(args: &AnalyzeArgs, noise: &Noise) -> Value {
    let kind = |it: &KindNoise| {
        json!({
            "bounces": it.kind.bounces, "and_more": it.kind.is_open(), "found_by": words(it.kind.finder),
            "light": it.light, "relative_error": it.relative, "shown_error": it.shown,
        })
    };
    json!({
        "samples": args.noise_spp,
        "rel_mse": noise.relative,
        "srgb_mse": noise.shown,
        "kinds": noise.kinds.iter().map(kind).collect::<Vec<_>>(),
    })
}
