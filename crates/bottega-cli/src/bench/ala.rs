//! `bottega bench ala`: the tables and figures of the paper on Autonomous Lighting Agents.

use std::{path::PathBuf, process::ExitCode};

use bottega::devices::processors;
use bottega_bench::ala::{AlaOptions, AlaScene, ELSEWHERE, REFERENCE, SCENE, measure};
use clap::{Args, ValueHint};

use super::result::{no_scene, print};
use crate::{error::CliError, output::LogWriter};

/// Sides of a picture that has no reference yet, as a share of the paper's.
const SCALE: f64 = 0.25;

/// The tables and figures of the paper on Autonomous Lighting Agents.
#[derive(Debug, Args)]
#[command(after_help = "Photon mapping, the agents of the paper and our own paint the same scene, with more and more \
    samples; errors are to a path-traced picture. For example:\n  bottega bench ala --scenes ../scenes -o ala/")]
pub(super) struct AlaArgs {
    /// The scene. Default: ala/ala.xml in the folder of scenes.
    #[arg(value_hint = ValueHint::FilePath)]
    scene: Option<PathBuf>,
    /// The folder of scenes. Default: what the environment variable BOTTEGA_SCENES names.
    #[arg(long, value_name = "FOLDER", value_hint = ValueHint::DirPath, env = "BOTTEGA_SCENES")]
    scenes: Option<PathBuf>,
    /// A converged picture of the scene, of which the pictures take their size. Default: ala/reference/Mitsuba3.exr in the folder of
    /// scenes for its scene; else one is painted first.
    #[arg(long, value_name = "FILE.exr", value_hint = ValueHint::FilePath)]
    reference: Option<PathBuf>,
    /// Sides of the picture, as a share of the paper's 1600 × 1200; a reference of that size is painted first.
    #[arg(long, value_name = "S", value_parser = parse_scale, conflicts_with = "reference")]
    scale: Option<f64>,
    /// Samples a pixel of a reference that is painted.
    #[arg(long, value_name = "N", default_value_t = 1024, value_parser = clap::value_parser!(u32).range(1..=1 << 16))]
    reference_spp: u32,
    /// Most samples a pixel; errors are measured at 1, 2, 4 and so on.
    #[arg(long, value_name = "N", default_value_t = 32, value_parser = clap::value_parser!(u32).range(1..=1 << 12))]
    spp: u32,
    /// Photons of the paper's comparison.
    #[arg(long, value_name = "N", default_value_t = 1_000_000, value_parser = clap::value_parser!(u32).range(100..=10_000_000))]
    photons: u32,
    /// Lighting agents of the paper's comparison.
    #[arg(long, value_name = "N", default_value_t = 50_000, value_parser = clap::value_parser!(u32).range(100..=1_000_000))]
    lighting_agents: u32,
    /// Threads. Default: as many as there are processors.
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u16).range(1..=1024))]
    threads: Option<u16>,
    /// Folder for ala.json, ala.svg, and the pictures.
    #[arg(short, long, value_name = "FOLDER", value_hint = ValueHint::DirPath)]
    output: Option<PathBuf>,
    /// Print one JSON object instead of text for people.
    #[arg(long)]
    json: bool,
}

pub(super) fn run(args: &AlaArgs) -> Result<ExitCode, CliError> {
    let in_folder = |name: &str| args.scenes.as_ref().map(|folder| folder.join(name));
    let known = || in_folder(REFERENCE).filter(|_| args.scene.is_none() && args.scale.is_none());
    let elsewhere =
        ELSEWHERE.into_iter().filter(|_| args.scene.is_none() && args.scale.is_none()).filter_map(|names| {
            let [Some(scene), Some(reference)] = names.map(in_folder) else { return None };
            Some(AlaScene { scene, reference })
        });
    let options = AlaOptions {
        elsewhere: elsewhere.collect(),
        scene: args.scene.clone().or_else(|| in_folder(SCENE)).ok_or_else(no_scene)?,
        reference: args.reference.clone().or_else(known),
        scale: args.scale.unwrap_or(SCALE),
        reference_spp: args.reference_spp,
        spp: args.spp,
        photons: args.photons,
        lighting_agents: args.lighting_agents,
        threads: args.threads.map_or_else(processors, usize::from),
        output: args.output.clone(),
    };
    Ok(print(&measure(&options, &mut LogWriter)?, args.json))
}

fn parse_scale(text: &str) -> Result<f64, String> {
    match text.parse::<f64>() {
        Ok(scale) if (0.02..=2.0).contains(&scale) => Ok(scale),
        _ => Err("a number from 0.02 to 2 is needed".to_owned()),
    }
}
