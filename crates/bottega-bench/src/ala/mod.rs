//! The tables and figures of the paper on Autonomous Lighting Agents.
//!
//! Photon mapping, the paper's agents and our own render one scene with increasing numbers of samples, each time including the
//! preparation: maps are cast, agents explore. Errors are relative to a converged image. Speeds are compared at equal error: by
//! the time to the error that photon mapping reaches in the end.

mod drawings;
mod elsewhere;
mod figures;
mod ludd;
mod options;
mod paper;
mod plot;
mod report;
mod tables;
mod ways;

use std::{io::Write, path::Path};

use bottega_image::{Picture, read_picture};
use bottega_render::Oracle;

pub(crate) use self::options::AlaOptions;
use self::{
    drawings::{difference, write_png},
    options::part,
    report::{AlaReport, Shadows},
    ways::{LightMethod, PaintedScene},
};
use crate::{
    error::Error,
    files::{create_folder, shared_meshes, write_file},
    report::{Measurement, Report, headed, say},
};

/// The paper's image size.
const SIZE: [f64; 2] = [1600.0, 1200.0];
/// Further budgets, relative to the paper's.
const FEWER: [f64; 4] = [0.04, 0.1, 0.25, 0.3];
const MORE: f64 = 3.0;
/// The share of the agents in the drawn network: few enough to distinguish the links.
const NETWORK: f64 = 0.1;

impl Measurement for AlaOptions {
    fn measure(&self, log: &mut dyn Write) -> Result<Box<dyn Report>, Error> {
        if let Some(folder) = &self.output {
            create_folder(folder)?;
        }
        let report = compare(self, log)?;
        if let Some(folder) = &self.output {
            write(folder, &report)?;
        }
        Ok(Box::new(report))
    }
}

/// Renders the scene by all methods of the paper.
fn compare(options: &AlaOptions, log: &mut dyn Write) -> Result<AlaReport, Error> {
    let AlaOptions { spp, photons, lighting_agents, .. } = *options;
    let path = options.scene()?;
    let hints = bottega_scene::load(&path, &shared_meshes())?.hints;
    let reference = options.reference().map(read_picture).transpose()?;
    let [width, height] = match &reference {
        Some(picture) => [picture.width, picture.height],
        None => SIZE.map(|side| ((side * options.scale()).round() as u32).max(8)),
    };
    let scene = PaintedScene {
        path: &path,
        size: (width, height),
        max_depth: hints.max_depth.unwrap_or(12),
        threads: options.threads(),
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
        LightMethod::photons_in_four_maps(photons),
        LightMethod::paths(),
        LightMethod::agents(Oracle::Paper, lighting_agents, true),
        LightMethod::agents(Oracle::Error, lighting_agents, true),
    ];
    let others = ways.into_iter().map(&mut paint).collect::<Result<Vec<_>, _>>()?;
    let agents = FEWER.map(|share| LightMethod::agents(Oracle::Error, part(lighting_agents, share), true));
    let more = [FEWER[1], FEWER[3], MORE].map(|share| LightMethod::photons(part(photons, share)));
    let budgets = agents.into_iter().chain(more).map(&mut paint).collect::<Result<Vec<_>, _>>()?;
    let without = |way: LightMethod| way.without_indirect();
    let without_indirect = [
        LightMethod::photons_in_four_maps(photons),
        LightMethod::agents(Oracle::Paper, lighting_agents, true),
        LightMethod::agents(Oracle::Error, lighting_agents, true),
    ]
    .map(without)
    .into_iter()
    .map(&mut paint)
    .collect::<Result<_, _>>()?;
    let mut shadows = Vec::new();
    let by_agents = others.iter().filter(|result| result.agents.is_some());
    for (by_agents, oracle) in by_agents.zip([Oracle::Paper, Oracle::Error]) {
        let way = LightMethod::agents(oracle, lighting_agents, false);
        say(log, format_args!("painting {}, all shadow rays traced …", way.name));
        let by_rays = scene.paint(way, spp, &reference)?;
        shadows.push(Shadows::new(by_agents, &by_rays)?);
    }
    let useful_data = ludd::compare(&scene, photons, lighting_agents, log)?;
    let network = ludd::draw_network(&scene, part(lighting_agents, NETWORK))?;
    let others_elsewhere = options.elsewhere();
    let elsewhere = others_elsewhere.iter().map(|other| elsewhere::compare(options, other, log));
    let elsewhere = elsewhere.collect::<Result<_, _>>()?;
    Ok(AlaReport {
        samples: spp,
        reference,
        photons: by_photons,
        others,
        budgets,
        shadows,
        without_indirect,
        elsewhere,
        network,
        useful_data,
    })
}

fn write(folder: &Path, report: &AlaReport) -> Result<(), Error> {
    let json = serde_json::to_string_pretty(&headed(report)).unwrap_or_default();
    write_file(&folder.join("ala.json"), &json)?;
    write_file(&folder.join("ala.svg"), &plot::svg(report))?;
    let png = |name: &str, picture: &Picture| write_png(folder, name, picture);
    png("reference.png", &report.reference)?;
    let names = ["photons-cached", "photons-four-maps", "paths", "agents-of-the-paper", "agents"];
    for (name, result) in names.iter().zip(&report.others) {
        png(&format!("{name}.png"), &result.picture)?;
        png(&format!("{name}-from-photons-x5.png"), &difference(&report.photons.picture, &result.picture))?;
    }
    png("photons.png", &report.photons.picture)?;
    for (name, shadows) in ["agents-of-the-paper", "agents"].iter().zip(&report.shadows) {
        let [agents, rays] = &shadows.pictures;
        png(&format!("{name}-from-shadow-rays-x5.png"), &difference(rays, agents))?;
    }
    figures::write(folder, report)?;
    report.network.write_png(folder.join("network.png"))?;
    let Picture { width, height, .. } = report.reference;
    ludd::draw(&report.useful_data, (width, height), folder)?;
    Ok(())
}
