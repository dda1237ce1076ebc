//! Local useful data density of photons and agents, as in the paper's figures 1 and 3.

use std::{fmt::Write as _, io::Write, path::Path};

use bottega_image::{Canvas, ColorMap};
use bottega_render::{
    AgentSettings, Oracle, PathSettings, PhotonSettings, Prepass,
    ala::{Criterion, Density, Dot, LocalSphere, Ludd, SampleSet, Samples, network_dots},
};
use serde_json::{Value, json};

use super::ways::PaintedScene;
use crate::{error::Error, report::say};

/// The radius of a neighborhood, relative to the radius of the scene.
const RADIUS: f32 = 0.05;
/// The number of samples in a neighborhood: N of equation 1.
const COUNT: usize = 50;
/// The radius of a dot in the drawn maps, relative to that of the scene, times the square root of the number of samples; and its
/// bounds.
const DOT: f32 = 2.0;
const DOT_BOUNDS: [f32; 2] = [0.002, 0.008];
/// The compared criteria: the irradiance, as in the paper's figure 3, and those named in section 3.
const CRITERIA: [Criterion; 4] = [Criterion::Normal, Criterion::Power, Criterion::Direction, Criterion::Irradiance];

/// The field of δ of one set of samples over the image.
pub(super) struct UsefulData {
    name: &'static str,
    /// δ of the irradiance, with equal radii and with equal N: row-major, NaN if unknown.
    fields: [Vec<f32>; 2],
    /// Means by criterion, with equal radii and with equal N.
    means: [Vec<Option<f64>>; 2],
    samples: u64,
    /// The mean number of samples in a sphere of equal radius.
    in_sphere: f64,
    dots: Vec<Dot>,
}

/// Compares photons and agents, in the numbers used for rendering.
///
/// - `photons`, `lighting_agents`: the numbers emitted by the lights.
/// - `log`: gets a line per comparison.
///
/// # Errors
/// The scene cannot be rendered.
pub(super) fn compare(
    scene: &PaintedScene<'_>,
    photons: u32,
    lighting_agents: u32,
    log: &mut dyn Write,
) -> Result<Vec<UsefulData>, Error> {
    let sets = [
        ("photons", SampleSet::Photons, Oracle::Paper),
        ("indirect-photons", SampleSet::IndirectPhotons, Oracle::Paper),
        ("agents-of-the-paper", SampleSet::Agents, Oracle::Paper),
        ("agents", SampleSet::Agents, Oracle::Error),
    ];
    let (prepared, prepass) = (scene.prepared()?, Prepass::default());
    let view = &scene.view(&prepared)?;
    let mut all = Vec::new();
    for (name, set, oracle) in sets {
        say(log, format_args!("comparing {name} …"));
        let agents = AgentSettings { cast: lighting_agents, oracle, ..AgentSettings::default() };
        let (count, bounces) = (photons, scene.max_depth);
        let photons = PhotonSettings { count, bounces, agents: Some(agents), ..PhotonSettings::default() };
        let settings = PathSettings { max_depth: bounces, photons: Some(photons), ..PathSettings::default() };
        let samples = Samples::new(&prepared, &prepass, view, &settings, set, &CRITERIA)?;
        let over = |sphere| samples.over(&prepared, view, sphere);
        let found = [over(LocalSphere::Radius(RADIUS))?, over(LocalSphere::Count(COUNT))?];
        let of = |pixel: &Option<Density>, criterion: Criterion| {
            let by = pixel.as_ref()?.by_criterion.iter().find(|(it, _)| *it == criterion);
            by.and_then(|(_, density)| *density)
        };
        let field = |ludd: &Ludd| {
            ludd.pixels.iter().map(|pixel| of(pixel, Criterion::Irradiance).unwrap_or(f32::NAN)).collect()
        };
        let means = |ludd: &Ludd| {
            let mean = |criterion: Criterion| mean(ludd.pixels.iter().filter_map(|pixel| of(pixel, criterion)));
            CRITERIA.into_iter().map(mean).collect()
        };
        let dot = (DOT / (samples.len() as f32).sqrt()).clamp(DOT_BOUNDS[0], DOT_BOUNDS[1]);
        let near = found[0].pixels.iter().flatten().map(|density| density.sample_count as f32);
        all.push(UsefulData {
            name,
            fields: [field(&found[0]), field(&found[1])],
            means: [means(&found[0]), means(&found[1])],
            samples: found[0].sample_count,
            in_sphere: mean(near).unwrap_or_default(),
            dots: samples.dots(&prepared, view, dot)?,
        });
    }
    Ok(all)
}

fn mean(values: impl Iterator<Item = f32>) -> Option<f64> {
    let (count, sum) = values.fold((0_u64, 0.0), |(count, sum), value| (count + 1, sum + f64::from(value)));
    (count > 0).then(|| sum / count as f64)
}

/// Formats the results as a table.
pub(super) fn as_text(all: &[UsefulData]) -> String {
    let mut text = format!(
        "\nuseful data density δ (mean of what is seen) in spheres of {RADIUS} of the radius of the scene, and of {COUNT} samples\n\
         {:<22} {:>9} {:>8}",
        "", "samples", "near"
    );
    let cell = |value: &Option<f64>| value.map_or_else(|| "–".to_owned(), |value| format!("{value:.3}"));
    for kind in ["r", "N"] {
        for criterion in CRITERIA {
            // Writing to a string cannot fail.
            let _ = write!(text, " {:>12}", format!("{criterion} {kind}"));
        }
    }
    for data in all {
        let _ = write!(text, "\n{:<22} {:>9} {:>8.0}", data.name, data.samples, data.in_sphere);
        for value in data.means.iter().flatten() {
            let _ = write!(text, " {:>12}", cell(value));
        }
    }
    text + "\n"
}

/// Returns the results as JSON.
pub(super) fn as_json(all: &[UsefulData]) -> Value {
    let by_criterion = |means: &[Option<f64>]| -> Value {
        let pairs = CRITERIA.iter().zip(means).map(|(criterion, mean)| (criterion.name().to_owned(), json!(mean)));
        Value::Object(pairs.collect())
    };
    let set = |data: &UsefulData| {
        json!({
            "set": data.name,
            "samples": data.samples,
            "samples_in_sphere": data.in_sphere,
            "equal_radius": by_criterion(&data.means[0]),
            "equal_count": by_criterion(&data.means[1]),
        })
    };
    json!({ "radius_share": RADIUS, "count": COUNT, "sets": all.iter().map(set).collect::<Vec<_>>() })
}

/// Draws the maps (figure 1, B and D) and δ of the irradiance (C, E, and figure 3), with the same color scale for all sets.
///
/// # Errors
/// A file cannot be written.
pub(super) fn draw(all: &[UsefulData], (width, height): (u32, u32), folder: &Path) -> Result<(), Error> {
    for (which, kind) in ["radius", "count"].into_iter().enumerate() {
        let fields = all.iter().flat_map(|data| &data.fields[which]).copied();
        let white = bright(fields.filter(|it| it.is_finite()).collect());
        for data in all {
            let canvas = Canvas::heat_map(width, height, &data.fields[which], white, ColorMap::Viridis);
            canvas.write_png(folder.join(format!("ludd-{}-by-{kind}.png", data.name)))?;
        }
    }
    for data in all {
        let value = |dot: &Dot| match dot {
            Dot::Nothing => f32::NAN,
            Dot::Free => 0.0,
            Dot::Sample(value) => *value,
        };
        let values: Vec<f32> = data.dots.iter().map(value).collect();
        let white = bright(values.iter().copied().filter(|it| *it > 0.0).collect());
        // Keep dark samples visible.
        let shown = data.dots.iter().zip(&values).map(|(dot, &value)| match dot {
            Dot::Sample(_) => value.max(0.25 * white),
            _ => value,
        });
        let shown: Vec<f32> = shown.collect();
        let canvas = Canvas::heat_map(width, height, &shown, white, ColorMap::Viridis);
        canvas.write_png(folder.join(format!("map-{}.png", data.name)))?;
    }
    Ok(())
}

/// Draws the proximity network over the scene, colored by its answers.
///
/// # Errors
/// The scene cannot be rendered.
pub(super) fn draw_network(scene: &PaintedScene<'_>, lighting_agents: u32) -> Result<Canvas, Error> {
    let agents = AgentSettings { cast: lighting_agents, ..AgentSettings::default() };
    let photons = PhotonSettings { bounces: scene.max_depth, agents: Some(agents), ..PhotonSettings::default() };
    let settings = PathSettings { max_depth: scene.max_depth, photons: Some(photons), ..PathSettings::default() };
    let prepared = scene.prepared()?;
    let dots = network_dots(&prepared, &Prepass::default(), &scene.view(&prepared)?, &settings)?;
    let value = |dot: &Dot| match dot {
        Dot::Nothing => f32::NAN,
        Dot::Free => 0.0,
        Dot::Sample(value) => *value,
    };
    let values: Vec<f32> = dots.iter().map(value).collect();
    Ok(Canvas::heat_map(scene.size.0, scene.size.1, &values, 1.0, ColorMap::Viridis))
}

/// Returns the value of the brightest color; one pixel in two hundred may be clipped.
fn bright(mut values: Vec<f32>) -> f32 {
    values.sort_unstable_by(f32::total_cmp);
    values.get(values.len().saturating_sub(values.len() / 200 + 1)).copied().unwrap_or(1.0).max(1e-6)
}
