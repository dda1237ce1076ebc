//! `bottega analyze`: what the Analyst thinks of a scene, as pictures and figures.

mod draw;
mod ludd;
mod plot;
mod verify;

use std::{fs, path::Path, process::ExitCode, sync::Arc};

use bottega::{
    Request,
    devices::threads,
    loaded_scene::LoadedScene,
    settings::{agents, importance_function, level, zone_limits},
    text::shown,
};
use bottega_engines::{BuiltinEngine, BuiltinOptions, Devices, RenderEngine, Survey, Tunables};
use bottega_farm::{
    Analysis, Goal, ImportanceFunction, Level, Optimization, PartitionSettings, WorkId, WorkSettings, analyze,
    survey_size,
};
use bottega_image::{AovSet, Layout, Rect};
use bottega_render::PathSettings;
use serde_json::{Value, json};

use crate::{cli::AnalyzeArgs, error::CliError};

/// Bounces where the scene does not say.
const DEFAULT_DEPTH: u32 = 16;

/// The levels of which zones are shown.
const LEVELS: [Level; 3] = [Level::Divided, Level::Joined, Level::Balanced];

pub(crate) fn run(args: &AnalyzeArgs) -> Result<ExitCode, CliError> {
    let mut request = Request::new(&args.scene_file);
    args.scene.apply(&mut request);
    request.validate().map_err(bottega::Error::from)?;
    let subject = Analyzed::new(args, request)?;
    let function = importance_function(&subject.request.work);
    let analyses = LEVELS.map(|level| subject.analyze(function, level));
    let analyses: Vec<Analysis> = analyses.into_iter().collect::<Result<_, _>>()?;
    let chosen = subject.analyze(function, level(subject.request.work.level))?;

    fs::create_dir_all(&args.output).map_err(|source| CliError::write(args.output.clone(), source))?;
    let mut drawn = draw::Drawn { folder: &args.output, files: Vec::new() };
    draw::all(&mut drawn, &subject, &analyses, &chosen)?;
    let ludd = (!args.ludd.is_empty()).then(|| ludd::all(args, &subject, &mut drawn)).transpose()?;
    let files = drawn.files;
    let verified = (!args.verify.is_empty()).then(|| verify::run(args, &subject, function)).transpose()?;
    let mut report = report(args, &subject, &analyses, &files, verified.as_ref());
    if let Some(ludd) = ludd {
        report["ludd"] = ludd;
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
    if let Some(verified) = &verified {
        println!("\n{}", verify::table(verified));
    }
    Ok(ExitCode::SUCCESS)
}

/// A scene that was surveyed.
struct Analyzed {
    request: Request,
    subject: LoadedScene,
    engine: BuiltinEngine,
    survey: Survey,
    settings: WorkSettings,
    agents: usize,
}

impl Analyzed {
    fn new(args: &AnalyzeArgs, request: Request) -> Result<Self, CliError> {
        let subject = LoadedScene::load(&request)?;
        let is_single = !args.verify.is_empty() && request.devices.threads.is_none();
        let painters = if is_single { 1 } else { threads(&request) };
        let max_depth = subject.hints.max_depth.unwrap_or(DEFAULT_DEPTH);
        let settings = PathSettings {
            max_depth,
            filter: subject.hints.filter.unwrap_or_default(),
            planned_samples: args.spp,
            ..PathSettings::default()
        };
        let options =
            BuiltinOptions { view: subject.view, settings, layout: Layout::new(AovSet::NONE), threads: painters };
        let (scene, prepass) = (Arc::clone(&subject.prepared), Arc::clone(&subject.prepass));
        let engine = BuiltinEngine::with_prepass(scene, prepass, options, Devices::default());
        let frame = subject.frame();
        let (columns, rows) = survey_size(&frame);
        let survey = engine.survey(columns, rows)?;
        let settings = WorkSettings {
            picture: frame,
            frame,
            samples: args.spp,
            goal: Goal::Samples,
            tunables: Tunables { max_depth, light_samples: 1 },
            optimization: Optimization::Off,
        };
        let agents = agents(args.agents, threads(&request));
        Ok(Self { request, subject, engine, survey, settings, agents })
    }

    fn frame(&self) -> Rect {
        self.settings.frame
    }

    fn analyze(&self, function: ImportanceFunction, level: Level) -> Result<Analysis, CliError> {
        let partition = PartitionSettings::for_agents(level, self.agents, self.frame());
        let partition = partition.within(None, zone_limits(&self.request.work));
        analyze(WorkId(1), &self.settings, &self.survey, function, &partition)
            .map_err(|error| CliError::failed(error.to_string(), "this is unexpected; report it with the scene"))
    }
}

fn write_json(path: &Path, value: &Value) -> Result<(), CliError> {
    let text = serde_json::to_string_pretty(value).unwrap_or_default();
    fs::write(path, text).map_err(|source| CliError::write(path.to_owned(), source))
}

fn report(
    args: &AnalyzeArgs,
    subject: &Analyzed,
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

fn zones(analysis: &Analysis) -> Vec<Value> {
    let total: f64 = analysis.rows.iter().map(|row| row.complexity).sum();
    let zone = |row: &bottega_farm::ZoneRow| {
        json!({
            "id": row.zone.0,
            "rect": [row.rect.x0, row.rect.y0, row.rect.x1, row.rect.y1],
            "size": row.size(),
            "complexity": row.complexity,
            "share_of_cost": row.complexity / total,
            "neighbor_difference": row.neighbor_difference.mean,
            "edge_differences": row.neighbor_difference.sides.into_array(),
            "visual_importance": analysis.map.importance_of(&row.rect),
        })
    };
    analysis.rows.iter().map(zone).collect()
}
