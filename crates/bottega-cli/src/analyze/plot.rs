//! Plots of predicted against measured time, as SVG.

use std::fs;

use bottega::text::shown;
use bottega_image::Svg;

use super::verify::{Verified, Zone};
use crate::{cli::AnalyzeArgs, error::CliError};

/// The side of one diagram and the margin around it, in pixels.
const SIDE: f64 = 300.0;
const MARGIN: f64 = 48.0;

/// Draws a diagram per function into the folder of the analysis.
pub(super) fn all(args: &AnalyzeArgs, verified: &[Verified]) -> Result<(), CliError> {
    for levels in verified.chunk_by(|a, b| a.function == b.function) {
        let function = levels[0].function;
        let title = format!("{}: {function}", shown(&args.scene_file));
        let path = args.output.join(format!("verify-{function}.svg"));
        fs::write(&path, scatter(&title, levels)).map_err(|source| CliError::write(path, source))?;
    }
    Ok(())
}

/// Draws a diagram per level: the measured time of each zone over the prediction by the map (hollow) and by profiling (filled),
/// each scaled to the same sum. Correct predictions lie on the diagonal.
fn scatter(title: &str, levels: &[Verified]) -> String {
    let width = levels.len() as f64 * (SIDE + MARGIN) + MARGIN;
    let height = SIDE + 2.0 * MARGIN + 16.0;
    let mut svg = Svg::new(width, height, 11);
    svg.text([MARGIN, 18.0], "font-size=\"13\"", title);
    for (i, level) in levels.iter().enumerate() {
        let left = MARGIN + i as f64 * (SIDE + MARGIN);
        diagram(&mut svg, left, MARGIN, level);
    }
    svg.finish()
}

fn diagram(svg: &mut Svg, left: f64, top: f64, level: &Verified) {
    let measured: Vec<f64> = level.zones.iter().map(Zone::measured).collect();
    let by_map = scaled(level.zones.iter().map(|zone| zone.complexity), &measured);
    let by_profile = scaled(level.zones.iter().map(Zone::profiled), &measured);
    let all = measured.iter().chain(&by_map).chain(&by_profile);
    let most = all.copied().fold(f64::MIN_POSITIVE, f64::max);
    let x = |value: f64| left + value / most * SIDE;
    let y = |value: f64| top + SIDE - value / most * SIDE;
    svg.put(format_args!(
        "<rect x=\"{left}\" y=\"{top}\" width=\"{SIDE}\" height=\"{SIDE}\" fill=\"none\" stroke=\"#999\"/>\n\
         <line x1=\"{}\" y1=\"{}\" x2=\"{}\" y2=\"{}\" stroke=\"#bbb\"/>",
        x(0.0),
        y(0.0),
        x(most),
        y(most),
    ));
    svg.text([left, top + SIDE + 16.0], "", format_args!("level {}: predicted, up to {most:.3} s", level.level));
    let [beside, below] = [left - 6.0, top + SIDE];
    svg.text([beside, below], &format!("transform=\"rotate(-90 {beside} {below})\""), "measured");
    for ((map, profile), measured) in by_map.iter().zip(&by_profile).zip(&measured) {
        svg.put(format_args!(
            "<circle cx=\"{:.1}\" cy=\"{:.1}\" r=\"3\" fill=\"none\" stroke=\"#d95f02\"/>\
             <circle cx=\"{:.1}\" cy=\"{:.1}\" r=\"2.5\" fill=\"#1b6ca8\"/>",
            x(*map),
            y(*measured),
            x(*profile),
            y(*measured),
        ));
    }
    svg.text([left + 8.0, top + 16.0], "fill=\"#d95f02\"", "○ by the map");
    svg.text([left + 8.0, top + 32.0], "fill=\"#1b6ca8\"", "● after profiling");
}

/// Scales predictions to the sum of the measurements.
fn scaled(predicted: impl Iterator<Item = f64> + Clone, measured: &[f64]) -> Vec<f64> {
    let factor = measured.iter().sum::<f64>() / predicted.clone().sum::<f64>().max(f64::MIN_POSITIVE);
    predicted.map(|value| value * factor).collect()
}
