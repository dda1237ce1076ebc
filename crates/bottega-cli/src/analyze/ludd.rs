//! Local useful data density of photons and of lighting agents: `bottega analyze --ludd`.

use std::{fmt::Write, fs};

use bottega::analysis::AnalyzedScene;
use bottega_image::{Canvas, ColorMap, Svg};
use bottega_render::{
    AgentSettings, Oracle, PathSettings, PhotonSettings,
    ala::{Criterion, Density, LocalSphere, Ludd, SampleSet, Samples},
};
use serde_json::{Value, json};

use super::draw::PictureFolder;
use crate::{cli::AnalyzeArgs, error::CliError};

/// The compared sets, with names for files and for people.
const SETS: [(SampleSet, &str, &str); 3] = [
    (SampleSet::Photons, "photons", "photons"),
    (SampleSet::IndirectPhotons, "indirect-photons", "indirect photons"),
    (SampleSet::Agents, "agents", "lighting agents"),
];
/// The color of each set in the histogram.
const COLORS: [&str; 3] = ["#1b6ca8", "#7570b3", "#d95f02"];
/// The share of the pixels that may be clipped to the brightest color.
const CLIPPED: f64 = 0.005;
/// The number of bars of the histogram; its size and margin, in pixels.
const BARS: usize = 50;
const SIZE: [f64; 2] = [560.0, 280.0];
const MARGIN: f64 = 48.0;

/// The field of δ of one set over the image.
struct LuddField {
    name: &'static str,
    label: &'static str,
    ludd: Ludd,
}

/// Draws a map of δ per set, and the histogram of all. Adds the files, and returns the lines to print.
pub(super) fn all(
    args: &AnalyzeArgs,
    subject: &AnalyzedScene,
    drawn: &mut PictureFolder<'_>,
) -> Result<Value, CliError> {
    let found: Vec<LuddField> = SETS
        .iter()
        .map(|&(set, name, label)| Ok(LuddField { name, label, ludd: sampled(args, subject, set)? }))
        .collect::<Result<_, CliError>>()?;
    let white = white(&found);
    let criteria = args.ludd.iter().map(ToString::to_string).collect::<Vec<_>>().join(", ");
    let (width, height) = (subject.frame().width(), subject.frame().height());
    for LuddField { name, label, ludd } in &found {
        let values: Vec<f32> =
            ludd.pixels.iter().map(|pixel| pixel.as_ref().and_then(Density::all).unwrap_or(f32::NAN)).collect();
        let canvas = Canvas::heat_map(width, height, &values, white, ColorMap::Viridis);
        let meaning =
            format!("useful data density of {label} ({criteria}); brightest: {white:.3}, gray: too few of them");
        drawn.put(&format!("ludd-{name}"), &canvas, &meaning)?;
    }
    let file = "ludd-histogram.svg";
    let path = drawn.folder.join(file);
    fs::write(&path, histogram(&found, &criteria, white)).map_err(|source| CliError::write(path, source))?;
    drawn.files.push((file.to_owned(), format!("how often each useful data density is seen, from 0 to {white:.3}")));
    Ok(json!({
        "criteria": args.ludd.iter().map(|criterion| criterion.name()).collect::<Vec<_>>(),
        "radius_share": args.ludd_nearest.is_none().then_some(args.ludd_radius),
        "nearest": args.ludd_nearest,
        "white": white,
        "sets": found.iter().map(|found| described(found, &args.ludd, white)).collect::<Vec<_>>(),
    }))
}

fn sampled(args: &AnalyzeArgs, subject: &AnalyzedScene, set: SampleSet) -> Result<Ludd, CliError> {
    let cast = args.lighting_agents.unwrap_or(AgentSettings::default().cast);
    let agents = AgentSettings { cast, oracle: Oracle::Paper, ..AgentSettings::default() };
    let bounces = subject.settings.tunables.max_depth;
    let photons = PhotonSettings { count: args.photons, bounces, agents: Some(agents), ..PhotonSettings::default() };
    let settings = PathSettings { max_depth: bounces, photons: Some(photons), ..PathSettings::default() };
    let loaded = &subject.subject;
    let (scene, prepass, view) = (&loaded.prepared, &loaded.prepass, &loaded.view);
    let samples = Samples::new(scene, prepass, view, &settings, set, &args.ludd)?;
    Ok(samples.over(scene, view, sphere(args))?)
}

/// Returns the neighborhood in which samples are compared.
fn sphere(args: &AnalyzeArgs) -> LocalSphere {
    args.ludd_nearest.map_or(LocalSphere::Radius(args.ludd_radius), |count| LocalSphere::Count(usize::from(count)))
}

/// Returns a value of all pixels where it is known, ascending.
fn sorted(pixels: &[Option<Density>], value: impl Fn(&Density) -> Option<f32>) -> Vec<f32> {
    let mut values: Vec<f32> = pixels.iter().flatten().filter_map(value).collect();
    values.sort_unstable_by(f32::total_cmp);
    values
}

fn quantile(sorted: &[f32], share: f64) -> Option<f32> {
    sorted.get(((sorted.len() as f64 * share) as usize).min(sorted.len().checked_sub(1)?)).copied()
}

/// Returns the density shown in the brightest color, the same for all sets, and greater than 0.
fn white(found: &[LuddField]) -> f32 {
    let most = found.iter().filter_map(|field| quantile(&sorted(&field.ludd.pixels, Density::all), 1.0 - CLIPPED));
    Some(most.fold(0.0, f32::max)).filter(|&white| white > 0.0).unwrap_or(1.0)
}

fn mean(values: &[f32]) -> Option<f64> {
    (!values.is_empty()).then(|| values.iter().map(|&value| f64::from(value)).sum::<f64>() / values.len() as f64)
}

/// Returns the figures of one set as JSON.
///
/// - `white`: upper end of the histogram, whose last bar includes all larger values.
fn described(found: &LuddField, criteria: &[Criterion], white: f32) -> Value {
    let pixels = &found.ludd.pixels;
    let all = sorted(pixels, Density::all);
    let by_criterion = criteria.iter().map(|&criterion| {
        let of = |density: &Density| density.by_criterion.iter().find(|(it, _)| *it == criterion)?.1;
        (criterion.name().to_owned(), json!(mean(&sorted(pixels, of))))
    });
    let seen = pixels.iter().flatten().count();
    let near: f64 = pixels.iter().flatten().map(|density| f64::from(density.sample_count)).sum();
    json!({
        "set": found.name,
        "samples": found.ludd.sample_count,
        "samples_in_sphere": near / seen.max(1) as f64,
        "pixels": all.len(),
        "mean": mean(&all),
        "median": quantile(&all, 0.5),
        "tenth": quantile(&all, 0.1),
        "ninetieth": quantile(&all, 0.9),
        "mean_by_criterion": by_criterion.collect::<serde_json::Map<_, _>>(),
        "histogram": bars(&all, white),
    })
}

/// Returns the figures of all sets as readable text: mean, quantiles, and the histogram as one line of blocks.
///
/// - `report`: the result of [`all`].
pub(super) fn table(report: &Value) -> String {
    let white = report["white"].as_f64().unwrap_or_default();
    let mut text = format!(
        "{:<18} {:>9} {:>7} {:>7} {:>7} {:>7}   pixels by density, 0 to {white:.3} and more\n",
        "useful data", "samples", "mean", "tenth", "median", "ninth"
    );
    for set in report["sets"].as_array().into_iter().flatten() {
        let figure = |key: &str| set[key].as_f64().map_or_else(|| "-".to_owned(), |value| format!("{value:.3}"));
        let shares: Vec<f64> = set["histogram"].as_array().into_iter().flatten().filter_map(Value::as_f64).collect();
        let name = set["set"].as_str().unwrap_or_default();
        let [mean, tenth, median, ninetieth] = ["mean", "tenth", "median", "ninetieth"].map(figure);
        // Writing to a string cannot fail.
        _ = writeln!(
            text,
            "{name:<18} {:>9} {mean:>7} {tenth:>7} {median:>7} {ninetieth:>7}   {}",
            set["samples"],
            blocks(&shares)
        );
    }
    text
}

/// Returns a line of blocks whose heights are shares, two to a block, relative to the greatest.
fn blocks(shares: &[f64]) -> String {
    const HEIGHTS: [char; 9] = [' ', '▁', '▂', '▃', '▄', '▅', '▆', '▇', '█'];
    let pairs: Vec<f64> = shares.chunks(2).map(|pair| pair.iter().sum()).collect();
    let top = pairs.iter().copied().fold(f64::MIN_POSITIVE, f64::max);
    let height = |share: &f64| (share / top * (HEIGHTS.len() - 1) as f64).ceil() as usize;
    pairs.iter().map(|share| HEIGHTS[height(share).min(HEIGHTS.len() - 1)]).collect()
}

/// Draws the share of the pixels by density, one line per set.
fn histogram(found: &[LuddField], criteria: &str, white: f32) -> String {
    let bars: Vec<Vec<f64>> =
        found.iter().map(|field| bars(&sorted(&field.ludd.pixels, Density::all), white)).collect();
    let top = bars.iter().flatten().copied().fold(f64::MIN_POSITIVE, f64::max);
    let [width, height] = SIZE;
    let mut svg = Svg::new(width + 2.0 * MARGIN, height + 2.0 * MARGIN, 11);
    svg.text([MARGIN, 24.0], "font-size=\"13\"", format_args!("Useful data density: {criteria}"));
    svg.put(format_args!(
        "<rect x=\"{MARGIN}\" y=\"{MARGIN}\" width=\"{width}\" height=\"{height}\" fill=\"none\" stroke=\"#999\"/>"
    ));
    let x = |value: f64| MARGIN + value / f64::from(white) * width;
    for step in 0..=5 {
        let value = f64::from(white) * f64::from(step) / 5.0;
        svg.text([x(value), MARGIN + height + 16.0], "text-anchor=\"middle\"", format_args!("{value:.2}"));
    }
    svg.text([8.0, MARGIN + 4.0], "", format_args!("{:.0} %", 100.0 * top));
    for (i, ((field, bars), color)) in found.iter().zip(&bars).zip(COLORS).enumerate() {
        let mut path = String::new();
        for (bar, share) in bars.iter().enumerate() {
            let (left, right) = (bar as f64 / BARS as f64 * width, (bar + 1) as f64 / BARS as f64 * width);
            let y = MARGIN + height * (1.0 - share / top);
            // Writing to a string cannot fail.
            _ = write!(path, "{:.1},{y:.1} {:.1},{y:.1} ", MARGIN + left, MARGIN + right);
        }
        svg.put(format_args!("<polyline points=\"{path}\" fill=\"none\" stroke=\"{color}\" stroke-width=\"1.5\"/>"));
        let place = [MARGIN + width - 8.0, MARGIN + 18.0 + 16.0 * i as f64];
        let attributes = format!("text-anchor=\"end\" fill=\"{color}\"");
        svg.text(place, &attributes, format_args!("{} ({})", field.label, field.ludd.sample_count));
    }
    svg.finish()
}

/// Returns the shares of the values in equal steps from 0 to `white`; the last one includes larger values.
fn bars(values: &[f32], white: f32) -> Vec<f64> {
    let mut bars = vec![0.0; BARS];
    for value in values {
        let bar = ((value / white * BARS as f32) as usize).min(BARS - 1);
        bars[bar] += 1.0 / values.len() as f64;
    }
    bars
}
