//! `bottega analyze`: the Analyst's estimates for a scene, as images and numbers.

mod draw;
mod ludd;
mod network;
mod noise;
mod plot;
mod verify;

use std::{fs, path::Path, process::ExitCode};

use bottega::{
    Request,
    analysis::{AnalyzedScene, LEVELS, zones},
    devices::threads,
    loaded_scene::LoadedScene,
    settings::{importance_function, level},
    text::shown,
};
use bottega_farm::Analysis;
use serde_json::{Value, json};

use crate::{cli::AnalyzeArgs, error::CliError};

pub(crate) fn run(args: &AnalyzeArgs) -> Result<ExitCode, CliError> {
    let mut request = Request::new(&args.scene_file);
    args.scene.apply(&mut request);
    request.goal.samples = Some(args.spp);
    request.work.agents = args.agents;
    request.validate().map_err(bottega::Error::from)?;
    let request = args.scene.set_fields(request)?;
    let subject = LoadedScene::load(&request)?;
    // --verify measures the time of one processor.
    let is_single = !args.verify.is_empty() && request.devices.threads.is_none();
    let painters = if is_single { 1 } else { threads(&request) };
    let subject = AnalyzedScene::of(request, subject, painters)?;
    let function = importance_function(&subject.request.work);
    let analyses = LEVELS.map(|level| subject.analyze(function, level));
    let analyses: Vec<Analysis> = analyses.into_iter().collect::<Result<_, _>>()?;
    let chosen = subject.analyze(function, level(subject.request.work.level))?;

    fs::create_dir_all(&args.output).map_err(|source| CliError::write(args.output.clone(), source))?;
    let mut drawn = draw::PictureFolder { folder: &args.output, files: Vec::new() };
    draw::all(&mut drawn, &subject, &analyses, &chosen)?;
    let ludd = (!args.ludd.is_empty()).then(|| ludd::all(args, &subject, &mut drawn)).transpose()?;
    if args.network {
        network::draw(args, &subject, &mut drawn)?;
    }
    let noise = args.noise.map(|_| noise::draw(args, &subject, &mut drawn)).transpose()?;
    let files = drawn.files;
    let verified = (!args.verify.is_empty()).then(|| verify::run(args, &subject, function)).transpose()?;
    verified.iter().try_for_each(|verified| plot::all(args, verified))?;
    let mut report = report(args, &subject, &analyses, &files, verified.as_ref());
    if let Some(ludd) = ludd {
        report["ludd"] = ludd;
    }
    if let Some(noise) = &noise {
        report["noise"] = noise::report(args, noise);
    }
    write_json(&args.output.join("index.json"), &report)?;
    if args.scene.json {
        println!("{report}");
        return Ok(ExitCode::SUCCESS);
    }
    for warning in &subject.subject.warnings {
        eprintln!("warning: {warning}");
    }
    for (name, meaning) in &files {
        println!("{name:<22} {meaning}");
    }
    let counts: Vec<String> = analyses.iter().map(|analysis| analysis.rows.len().to_string()).collect();
    println!("{}: {} zones by level, meant for agents: {}", shown(&args.output), counts.join(", "), subject.agents);
    if report.get("ludd").is_some() {
        print!("\n{}", ludd::table(&report["ludd"]));
    }
    if let Some(noise) = &noise {
        print!("\n{}", noise::table(args, noise));
    }
    if let Some(verified) = &verified {
        print!("\n{}\n", verify::table(verified));
    }
    Ok(ExitCode::SUCCESS)
}

fn write_json(path: &Path, value: &Value) -> Result<(), CliError> {
    let text = serde_json::to_string_pretty(value).unwrap_or_default();
    fs::write(path, text).map_err(|source| CliError::write(path.to_owned(), source))
}

fn report(
    args: &AnalyzeArgs,
    subject: &AnalyzedScene,
    analyses: &[Analysis],
    files: &[(String, String)],
    verified: Option<&Vec<verify::Verified>>,
) -> Value {
    let function = importance_function(&subject.request.work);
    let levels = analyses.iter().zip(1..).map(|(analysis, level)| {
        let (imbalance, spread) =
            (analysis.partition.imbalance(&analysis.map), analysis.partition.ratio_spread(&analysis.map));
        json!({"level": level, "longest_over_mean": imbalance, "ratio_spread": spread, "zones": zones(analysis)})
    });
    let mut report = json!({
        "version": 1,
        "scene": shown(&args.scene_file),
        "size": [subject.frame().width(), subject.frame().height()],
        "cells": [subject.survey.width, subject.survey.height],
        "agents": subject.agents,
        "importance": function.to_string(),
        "channels": function.channels().iter().map(bottega_farm::Channel::name).collect::<Vec<_>>(),
        "files": files.iter().map(|(file, shows)| json!({"file": file, "shows": shows})).collect::<Vec<_>>(),
        "levels": levels.collect::<Vec<_>>(),
    });
    if let Some(verified) = verified {
        report["verified"] = verified.iter().map(verify::Verified::report).collect();
    }
    report
}
