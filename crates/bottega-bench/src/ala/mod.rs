//! The tables and figures of the paper on Autonomous Lighting Agents.
//!
//! Photon mapping, the agents of the paper and our own paint one scene with more and more samples, each anew: maps are cast,
//! agents look around. Errors are to a converged picture. Who is faster is told at equal error: by the time until a picture is as
//! good as that of photon mapping at last.

mod ludd;
mod paper;
mod plot;
mod report;
mod tables;
mod ways;

use std::{
    io::Write,
    path::{Path, PathBuf},
};

use bottega_image::{Canvas, Picture, ToneMap, read_picture};
use bottega_render::{Oracle, View};

pub use self::report::AlaReport;
use self::{
    report::Shadows,
    ways::{LightMethod, PaintedScene},
};
use crate::{Error, Report, create_folder, say, shared_meshes, write_file};

/// The scene of the comparison, in the folder of scenes.
pub const SCENE: &str = "ala/ala.xml";
/// A converged picture of that scene.
pub const REFERENCE: &str = "ala/reference/Mitsuba3.exr";

/// The paper's picture.
const SIZE: [f64; 2] = [1600.0, 1200.0];
/// Budgets that are tried beside the paper's, as shares of it.
const FEWER: [f64; 4] = [0.04, 0.1, 0.25, 0.3];
const MORE: f64 = 3.0;

/// The scene of the measurement, and its numbers of photons and agents.
#[derive(Clone, Debug)]
pub struct AlaOptions {
    /// The scene.
    pub scene: PathBuf,
    /// A converged picture of the scene, of which the pictures take their size; `None`: one is painted first.
    pub reference: Option<PathBuf>,
    /// Sides of a reference that is painted, as a share of the paper's 1600 × 1200.
    pub scale: f64,
    /// Samples a pixel of a reference that is painted.
    pub reference_spp: u32,
    /// Most samples a pixel; errors are measured at 1, 2, 4 and so on.
    pub spp: u32,
    /// Photons of the paper's comparison.
    pub photons: u32,
    /// Lighting agents of the paper's comparison.
    pub lighting_agents: u32,
    /// Threads that paint.
    pub threads: usize,
    /// Folder for `ala.json`, `ala.svg`, and the pictures.
    pub output: Option<PathBuf>,
}

/// Paints the scene in every way of the paper, and writes what `output` asks for.
///
/// - `log`: is told which picture is being painted.
///
/// # Errors
/// The scene cannot be painted, the reference not be read, or a file not be written.
pub fn measure(options: &AlaOptions, log: &mut dyn Write) -> Result<AlaReport, Error> {
    if let Some(folder) = &options.output {
        create_folder(folder)?;
    }
    let report = compare(options, log)?;
    if let Some(folder) = &options.output {
        write(folder, &report)?;
    }
    Ok(report)
}

fn compare(options: &AlaOptions, log: &mut dyn Write) -> Result<AlaReport, Error> {
    let AlaOptions { spp, photons, lighting_agents, .. } = *options;
    let hints = bottega_scene::load(&options.scene, &shared_meshes())?.hints;
    let reference = options.reference.as_ref().map(read_picture).transpose()?;
    let [width, height] = match &reference {
        Some(picture) => [picture.width, picture.height],
        None => SIZE.map(|side| ((side * options.scale).round() as u32).max(8)),
    };
    let scene = PaintedScene {
        path: &options.scene,
        view: View { camera: 0, width, height },
        max_depth: hints.max_depth.unwrap_or(12),
        threads: options.threads,
    };
    let reference = match reference {
        Some(picture) => picture,
        None => {
            say(log, format_args!("painting the reference …"));
            scene.reference(options.reference_spp)?
        }
    };
    let mut paint = |way: LightMethod| {
        say(log, format_args!("painting {} …", way.name));
        scene.paint(way, spp, &reference)
    };
    let by_photons = paint(LightMethod::photons(photons))?;
    let ways = [
        LightMethod::photons_as_in_the_paper(photons),
        LightMethod::paths(),
        LightMethod::agents(Oracle::Paper, lighting_agents, true),
        LightMethod::agents(Oracle::Error, lighting_agents, true),
    ];
    let others = ways.into_iter().map(&mut paint).collect::<Result<Vec<_>, _>>()?;
    let part = |whole: u32, share: f64| ((f64::from(whole) * share) as u32).max(1);
    let agents = FEWER.map(|share| LightMethod::agents(Oracle::Error, part(lighting_agents, share), true));
    let more = [FEWER[1], FEWER[3], MORE].map(|share| LightMethod::photons(part(photons, share)));
    let budgets = agents.into_iter().chain(more).map(&mut paint).collect::<Result<Vec<_>, _>>()?;
    let mut shadows = Vec::new();
    for (by_agents, oracle) in others[2..].iter().zip([Oracle::Paper, Oracle::Error]) {
        let way = LightMethod::agents(oracle, lighting_agents, false);
        say(log, format_args!("painting {}, all shadow rays traced …", way.name));
        let by_rays = scene.paint(way, spp, &reference)?;
        shadows.push(Shadows::new(by_agents, &by_rays)?);
    }
    let useful_data = ludd::compare(&scene, photons, lighting_agents, log)?;
    Ok(AlaReport { samples: spp, reference, photons: by_photons, others, budgets, shadows, useful_data })
}

fn write(folder: &Path, report: &AlaReport) -> Result<(), Error> {
    let json = serde_json::to_string_pretty(&report.as_json()).unwrap_or_default();
    write_file(&folder.join("ala.json"), &json)?;
    write_file(&folder.join("ala.svg"), &plot::svg(report))?;
    let png = |name: &str, picture: &Picture| {
        Canvas::of_picture(picture, 0.0, ToneMap::Agx).write_png(folder.join(name)).map_err(Error::from)
    };
    png("reference.png", &report.reference)?;
    for (name, result) in ["photons-cached", "paths", "agents-of-the-paper", "agents"].iter().zip(&report.others) {
        png(&format!("{name}.png"), &result.picture)?;
        png(&format!("{name}-from-photons-x5.png"), &difference(&report.photons.picture, &result.picture))?;
    }
    png("photons.png", &report.photons.picture)?;
    for (name, shadows) in ["agents-of-the-paper", "agents"].iter().zip(&report.shadows) {
        let [agents, rays] = &shadows.pictures;
        png(&format!("{name}-from-shadow-rays-x5.png"), &difference(rays, agents))?;
    }
    let Picture { width, height, .. } = report.reference;
    ludd::draw(&report.useful_data, View { camera: 0, width, height }, folder)?;
    Ok(())
}

/// Five times the absolute difference, as in the paper's figures 4 and 5.
fn difference(a: &Picture, b: &Picture) -> Picture {
    let pixel = |(a, b): (&[f32; 3], &[f32; 3])| std::array::from_fn(|i| 5.0 * (a[i] - b[i]).abs());
    Picture { data: a.data.iter().zip(&b.data).map(pixel).collect(), ..*a }
}
