//! `bottega bench ala`: the tables and figures of the paper on Autonomous Lighting Agents.
//!
//! Photon mapping, the agents of the paper and our own paint one scene with more and more samples, each anew: maps are cast,
//! agents look around. Errors are to a converged picture. Who is faster is told at equal error: by the time until a picture is as
//! good as that of photon mapping at last.

mod args;
mod paper;
mod plot;
mod tables;
mod ways;

use std::{
    fs,
    path::{Path, PathBuf},
    process::ExitCode,
};

use bottega_image::{Canvas, ColorMap, FlipOptions, Picture, ToneMap, flip, read_picture};
use bottega_render::{
    AgentSettings, Oracle, PathSettings, PhotonSettings, View,
    ala::{Criterion, Density, SampleSet, Samples},
};
use bottega_scene::LoadOptions;

pub(crate) use self::args::AlaArgs;
use self::ways::{Outcome, Studio, Way};
use bottega::devices::processors;

use crate::error::CliError;

/// The paper's picture.
const SIZE: [f64; 2] = [1600.0, 1200.0];
/// Budgets that are tried beside the paper's, as shares of it.
const FEWER: [f64; 4] = [0.04, 0.1, 0.25, 0.3];
const MORE: f64 = 3.0;
/// FLIP above which a pixel looks wrong.
const WRONG: f32 = 0.1;
/// How near samples are compared, as a share of the radius of the scene.
const LUDD_RADIUS: f32 = 0.05;

pub(crate) fn run(args: &AlaArgs) -> Result<ExitCode, CliError> {
    let in_folder = |name: &str| args.scenes.as_ref().map(|folder| folder.join("ala").join(name));
    let scene = args.scene.clone().or_else(|| in_folder("ala.xml")).ok_or_else(|| {
        CliError::usage("no scene is named", "name one, or the folder of scenes by --scenes or BOTTEGA_SCENES")
    })?;
    if let Some(folder) = &args.output {
        fs::create_dir_all(folder).map_err(|source| CliError::write(folder.clone(), source))?;
    }
    let known = || in_folder("reference/Mitsuba3.exr").filter(|_| args.scene.is_none() && args.scale.is_none());
    let reference: Option<PathBuf> = args.reference.clone().or_else(known);
    let report = report(args, &scene, reference.as_deref())?;
    if let Some(folder) = &args.output {
        write(folder, &report)?;
    }
    if args.json {
        println!("{}", tables::as_json(&report));
    } else {
        print!("{}", tables::as_text(&report));
    }
    Ok(ExitCode::SUCCESS)
}

/// How shadows by agents differ from those by rays, all else being equal.
#[derive(Clone, Debug)]
struct Shadows {
    name: String,
    /// Share of the shadow rays that were traced.
    traced: f64,
    /// Share of the pixels that look wrong.
    wrong: f64,
    /// Both pictures, by agents and by rays.
    pictures: [Picture; 2],
}

/// All that is told.
struct Report {
    samples: u32,
    reference: Picture,
    /// Photon mapping of the paper's comparison; all else is told beside it.
    photons: Outcome,
    /// The same as the paper had it, paths, agents of the paper, and our own.
    others: Vec<Outcome>,
    /// Photons and our agents with other budgets.
    budgets: Vec<Outcome>,
    shadows: Vec<Shadows>,
    /// Useful data density (irradiance) by set: name, what is seen of it, brightest.
    densities: Vec<(&'static str, Vec<f32>)>,
}

impl Report {
    /// Our own agents of the paper's comparison.
    fn ours(&self) -> Option<&Outcome> {
        self.others.last()
    }

    fn all(&self) -> impl Iterator<Item = &Outcome> {
        std::iter::once(&self.photons).chain(&self.others).chain(&self.budgets)
    }

    /// Photon mapping, and photon mapping as the paper had it.
    fn baselines(&self) -> impl Iterator<Item = &Outcome> {
        std::iter::once(&self.photons).chain(self.others.first())
    }

    /// Of all budgets of our agents the one that is first at the error of some photon mapping, casting included.
    fn best(&self, baseline: &Outcome) -> Option<&Outcome> {
        let error = baseline.error();
        let total = |outcome: &Outcome| outcome.seconds_to(error).map(|seconds| seconds + outcome.casting);
        let ours = self.ours().into_iter().chain(self.budgets.iter().filter(|outcome| outcome.agents.is_some()));
        ours.filter(|outcome| total(outcome).is_some())
            .min_by(|a, b| total(a).unwrap_or(f64::MAX).total_cmp(&total(b).unwrap_or(f64::MAX)))
    }
}

fn report(args: &AlaArgs, scene: &Path, reference: Option<&Path>) -> Result<Report, CliError> {
    let hints = bottega_scene::load(scene, &options())?.hints;
    let said = |what: &str| eprintln!("painting {what} …");
    let reference = reference.map(read_picture).transpose()?;
    let [width, height] = match (&reference, args.scale) {
        (Some(picture), _) => [picture.width, picture.height],
        (None, scale) => SIZE.map(|side| ((side * scale.unwrap_or(0.25)).round() as u32).max(8)),
    };
    let studio = Studio {
        scene,
        view: View { camera: 0, width, height },
        max_depth: hints.max_depth.unwrap_or(12),
        threads: args.threads.map_or_else(processors, usize::from),
    };
    let reference = match reference {
        Some(picture) => picture,
        None => {
            said("the reference");
            studio.reference(args.reference_spp)?
        }
    };
    let paint = |way: Way| {
        said(&way.name);
        studio.paint(way, args.spp, &reference)
    };
    let photons = paint(Way::photons(args.photons))?;
    let ways = [
        Way::photons_as_in_the_paper(args.photons),
        Way::paths(),
        Way::agents(Oracle::Paper, args.lighting_agents, true),
        Way::agents(Oracle::Error, args.lighting_agents, true),
    ];
    let others = ways.into_iter().map(paint).collect::<Result<Vec<_>, _>>()?;
    let part = |whole: u32, share: f64| ((f64::from(whole) * share) as u32).max(1);
    let agents = FEWER.map(|share| Way::agents(Oracle::Error, part(args.lighting_agents, share), true));
    let more = [FEWER[1], FEWER[3], MORE].map(|share| Way::photons(part(args.photons, share)));
    let budgets = agents.into_iter().chain(more).map(paint).collect::<Result<Vec<_>, _>>()?;
    let mut shadows = Vec::new();
    for outcome in &others[2..] {
        let oracle = if shadows.is_empty() { Oracle::Paper } else { Oracle::Error };
        let way = Way::agents(oracle, args.lighting_agents, false);
        said(&format!("{}, all shadow rays traced", way.name));
        let rays = studio.paint(way, args.spp, &reference)?;
        shadows.push(Shadows::new(outcome, &rays)?);
    }
    let densities = if args.output.is_some() { densities(args, &studio)? } else { Vec::new() };
    Ok(Report { samples: args.spp, reference, photons, others, budgets, shadows, densities })
}

impl Shadows {
    fn new(agents: &Outcome, rays: &Outcome) -> Result<Self, CliError> {
        let error = flip(&rays.picture, &agents.picture, &FlipOptions::default())?;
        let wrong = error.map.iter().filter(|&&error| error > WRONG).count();
        Ok(Self {
            name: agents.way.name.clone(),
            traced: agents.traced().unwrap_or(1.0),
            wrong: wrong as f64 / error.map.len().max(1) as f64,
            pictures: [agents.picture.clone(), rays.picture.clone()],
        })
    }
}

/// Local useful data density of the irradiance, as in the paper's figures 1 and 3.
fn densities(args: &AlaArgs, studio: &Studio<'_>) -> Result<Vec<(&'static str, Vec<f32>)>, CliError> {
    let sets = [
        ("photons", SampleSet::Photons, Oracle::Paper),
        ("indirect-photons", SampleSet::IndirectPhotons, Oracle::Paper),
        ("agents-of-the-paper", SampleSet::Agents, Oracle::Paper),
        ("agents", SampleSet::Agents, Oracle::Error),
    ];
    let scene = studio.prepared()?;
    let of = |(name, set, oracle): (&'static str, SampleSet, Oracle)| {
        eprintln!("comparing {name} …");
        let agents = AgentSettings { cast: args.lighting_agents, oracle, ..AgentSettings::default() };
        // As the paper's figures: photons enough to compare, and not to drown in.
        let count = args.photons / 10;
        let bounces = studio.max_depth;
        let photons = PhotonSettings { count, bounces, agents: Some(agents), ..PhotonSettings::default() };
        let settings = PathSettings { max_depth: bounces, photons: Some(photons), ..PathSettings::default() };
        let samples = Samples::new(&scene, studio.view, &settings, set, &[Criterion::Irradiance], LUDD_RADIUS)?;
        let found = samples.over(&scene, studio.view)?;
        let value = |pixel: &Option<Density>| pixel.as_ref().and_then(Density::all).unwrap_or(f32::NAN);
        Ok((name, found.pixels.iter().map(value).collect()))
    };
    sets.into_iter().map(of).collect()
}

fn write(folder: &Path, report: &Report) -> Result<(), CliError> {
    let put = |name: &str, text: String| {
        let path = folder.join(name);
        fs::write(&path, text).map_err(|source| CliError::write(path, source))
    };
    put("ala.json", serde_json::to_string_pretty(&tables::as_json(report)).unwrap_or_default())?;
    put("ala.svg", plot::svg(report))?;
    let png = |name: &str, picture: &Picture| {
        Canvas::of_picture(picture, 0.0, ToneMap::Agx).write_png(folder.join(name)).map_err(CliError::from)
    };
    png("reference.png", &report.reference)?;
    for (name, outcome) in ["photons-cached", "paths", "agents-of-the-paper", "agents"].iter().zip(&report.others) {
        png(&format!("{name}.png"), &outcome.picture)?;
        png(&format!("{name}-from-photons-x5.png"), &difference(&report.photons.picture, &outcome.picture))?;
    }
    png("photons.png", &report.photons.picture)?;
    for (name, shadows) in ["agents-of-the-paper", "agents"].iter().zip(&report.shadows) {
        let [agents, rays] = &shadows.pictures;
        png(&format!("{name}-from-shadow-rays-x5.png"), &difference(rays, agents))?;
    }
    let mut values: Vec<f32> =
        report.densities.iter().flat_map(|(_, map)| map).copied().filter(|it| it.is_finite()).collect();
    values.sort_unstable_by(f32::total_cmp);
    let white = values.get(values.len().saturating_sub(values.len() / 200 + 1)).copied().unwrap_or(1.0).max(1e-6);
    let Picture { width, height, .. } = report.reference;
    for (name, map) in &report.densities {
        let canvas = Canvas::heat_map(width, height, map, white, ColorMap::Viridis);
        canvas.write_png(folder.join(format!("ludd-{name}.png")))?;
    }
    Ok(())
}

/// Five times the absolute difference, as in the paper's figures 4 and 5.
fn difference(a: &Picture, b: &Picture) -> Picture {
    let pixel = |(a, b): (&[f32; 3], &[f32; 3])| std::array::from_fn(|i| 5.0 * (a[i] - b[i]).abs());
    Picture { data: a.data.iter().zip(&b.data).map(pixel).collect(), ..*a }
}

/// The scenes of a folder share their meshes, which lie beside them.
fn options() -> LoadOptions {
    LoadOptions { allow_outside: true, ..LoadOptions::default() }
}
