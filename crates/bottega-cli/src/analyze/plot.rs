//! Predicted against measured time as an SVG.

use std::{fmt::Write, fs};

use bottega::text::shown;

use super::verify::{Verified, Zone};
use crate::{cli::AnalyzeArgs, error::CliError};

/// Side of one diagram, and the space around it, in pixels.
const SIDE: f64 = 300.0;
const MARGIN: f64 = 48.0;

/// Draws a diagram of each function into the folder of the analysis.
pub(super) fn all(args: &AnalyzeArgs, verified: &[Verified]) -> Result<(), CliError> {
    for levels in verified.chunk_by(|a, b| a.function == b.function) {
        let function = levels[0].function;
        let title = format!("{}: {function}", shown(&args.scene_file));
        let path = args.output.join(format!("verify-{function}.svg"));
        fs::write(&path, scatter(&title, levels)).map_err(|source| CliError::write(path, source))?;
    }
    Ok(())
}

/// A diagram for each level: measured time of every zone over what the map (hollow) and profiling (filled) predicted, each
/// scaled to the same sum. On the diagonal a prediction is right.
fn scatter(title: &str, levels: &[Verified]) -> String {
    let width = levels.len() as f64 * (SIDE + MARGIN) + MARGIN;
    let height = SIDE + 2.0 * MARGIN + 16.0;
    let mut svg = format!(
        "<svg xmlns=\"http://www.w3.org/2000/svg\" width=\"{width}\" height=\"{height}\" font-family=\"sans-serif\" \
         font-size=\"11\">\n<rect width=\"100%\" height=\"100%\" fill=\"white\"/>\n\
         <text x=\"{MARGIN}\" y=\"18\" font-size=\"13\">{}</text>\n",
        escaped(title)
    );
    for (i, level) in levels.iter().enumerate() {
        let left = MARGIN + i as f64 * (SIDE + MARGIN);
        diagram(&mut svg, left, MARGIN, level);
    }
    svg.push_str("</svg>\n");
    svg
}

fn diagram(svg: &mut String, left: f64, top: f64, level: &Verified) {
    let measured: Vec<f64> = level.zones.iter().map(Zone::measured).collect();
    let by_map = scaled(level.zones.iter().map(|zone| zone.complexity), &measured);
    let by_profile = scaled(level.zones.iter().map(Zone::profiled), &measured);
    let all = measured.iter().chain(&by_map).chain(&by_profile);
    let most = all.copied().fold(f64::MIN_POSITIVE, f64::max);
    let x = |value: f64| left + value / most * SIDE;
    let y = |value: f64| top + SIDE - value / most * SIDE;
    // Writing into a string cannot fail.
    let _ = write!(
        svg,
        "<rect x=\"{left}\" y=\"{top}\" width=\"{SIDE}\" height=\"{SIDE}\" fill=\"none\" stroke=\"#999\"/>\n\
         <line x1=\"{}\" y1=\"{}\" x2=\"{}\" y2=\"{}\" stroke=\"#bbb\"/>\n\
         <text x=\"{left}\" y=\"{}\">level {}: predicted, up to {:.3} s</text>\n\
         <text x=\"{}\" y=\"{}\" transform=\"rotate(-90 {} {})\">measured</text>\n",
        x(0.0),
        y(0.0),
        x(most),
        y(most),
        top + SIDE + 16.0,
        level.level,
        most,
        left - 6.0,
        top + SIDE,
        left - 6.0,
        top + SIDE,
    );
    for ((map, profile), measured) in by_map.iter().zip(&by_profile).zip(&measured) {
        let _ = writeln!(
            svg,
            "<circle cx=\"{:.1}\" cy=\"{:.1}\" r=\"3\" fill=\"none\" stroke=\"#d95f02\"/>\
             <circle cx=\"{:.1}\" cy=\"{:.1}\" r=\"2.5\" fill=\"#1b6ca8\"/>",
            x(*map),
            y(*measured),
            x(*profile),
            y(*measured),
        );
    }
    let _ = writeln!(
        svg,
        "<text x=\"{}\" y=\"{}\" fill=\"#d95f02\">○ by the map</text>\
         <text x=\"{}\" y=\"{}\" fill=\"#1b6ca8\">● after profiling</text>",
        left + 8.0,
        top + 16.0,
        left + 8.0,
        top + 32.0,
    );
}

/// Predictions scaled to the sum of what was measured.
fn scaled(predicted: impl Iterator<Item = f64> + Clone, measured: &[f64]) -> Vec<f64> {
    let factor = measured.iter().sum::<f64>() / predicted.clone().sum::<f64>().max(f64::MIN_POSITIVE);
    predicted.map(|value| value * factor).collect()
}

fn escaped(text: &str) -> String {
    text.replace('&', "&amp;").replace('<', "&lt;").replace('>', "&gt;")
}
