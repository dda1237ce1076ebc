//! `bottega analyze`: what the Analyst thinks of a scene, as pictures and figures.

use std::{fs, process::ExitCode, sync::Arc};

use bottega_engines::{BuiltinEngine, BuiltinOptions, RenderEngine, Survey, Tunables};
use bottega_farm::{Analysis, Goal, Optimization, PartitionSettings, WorkId, WorkSettings, analyze, survey_size};
use bottega_image::{AovSet, Canvas, ColorMap, Layout, Picture, Rect, ToneMap};
use bottega_render::PathSettings;
use serde_json::{Value, json};

use crate::{
    cli::AnalyzeArgs,
    error::CliError,
    render::{importance, level},
    scene::{Subject, agents, shown, threads},
};

/// The longer side of the pictures, at least; small maps are enlarged to it.
const SHOWN_SIDE: u32 = 1024;

/// Color of the outlines of zones.
const OUTLINE: [u8; 3] = [255, 64, 32];

pub(crate) fn run(args: &AnalyzeArgs) -> Result<ExitCode, CliError> {
    let write = |source| CliError::Write { path: args.output.clone(), source };
    fs::create_dir_all(&args.output).map_err(write)?;
    let subject = Subject::load(&args.scene)?;
    let threads = threads(&args.scene);
    let agents = agents(args.agents, threads);
    let options = BuiltinOptions {
        view: subject.view,
        settings: PathSettings::default(),
        layout: Layout::new(AovSet::NONE),
        threads,
    };
    let engine = BuiltinEngine::new(Arc::clone(&subject.prepared), options, Vec::new());
    let frame = subject.frame();
    let (columns, rows) = survey_size(&frame);
    let survey = engine.survey(columns, rows)?;
    let settings = WorkSettings {
        picture: frame,
        frame,
        samples: 64,
        goal: Goal::Samples,
        tunables: Tunables { max_depth: 16, light_samples: 1 },
        optimization: Optimization::Off,
    };
    let partition = PartitionSettings::for_agents(level(args.scene.level), agents, frame);
    let analysis = analyze(WorkId(1), &settings, &survey, importance(args.scene.importance), &partition)
        .map_err(|error| CliError::failed(error.to_string(), "this is unexpected; report it with the scene"))?;

    draw(args, &survey, &analysis, frame)?;
    let report = report(&analysis);
    let text = serde_json::to_string_pretty(&report).unwrap_or_default();
    let path = args.output.join("analysis.json");
    fs::write(&path, text).map_err(|source| CliError::Write { path, source })?;
    if args.scene.json {
        println!("{report}");
    } else {
        for warning in &subject.warnings {
            eprintln!("warning: {warning}");
        }
        println!("{}: {} zones, meant for agents: {agents}", shown(&args.output), analysis.rows.len());
    }
    Ok(ExitCode::SUCCESS)
}

/// importance.png: the map. zones.png: the zones over what the survey saw. cost.png: predicted cost of each zone.
fn draw(args: &AnalyzeArgs, survey: &Survey, analysis: &Analysis, frame: Rect) -> Result<(), CliError> {
    let enlarge = |canvas: Canvas| {
        let side = canvas.width.max(canvas.height);
        canvas.enlarged((SHOWN_SIDE / side).max(1))
    };
    let (columns, rows) = analysis.map.size();
    enlarge(Canvas::gray_map(columns, rows, &analysis.map.grey())).write_png(args.output.join("importance.png"))?;

    let color = |x: u32, y: u32| survey.pixels[(y * survey.width + x) as usize].color;
    let seen = Picture::from_fn(survey.width, survey.height, color);
    let mut zones = enlarge(Canvas::of_picture(&seen, 0.0, ToneMap::Agx));
    let size = (zones.width, zones.height);
    for row in &analysis.rows {
        zones.draw_rect(scaled(row.rect, frame, size), OUTLINE);
    }
    zones.write_png(args.output.join("zones.png"))?;

    let mut cost = Canvas::new(size.0, size.1, [0; 3]);
    let largest = analysis.rows.iter().map(|row| row.complexity).fold(f64::MIN_POSITIVE, f64::max);
    for row in &analysis.rows {
        let rect = scaled(row.rect, frame, size);
        cost.fill_rect(rect, ColorMap::Viridis.color((row.complexity / largest) as f32));
        cost.draw_rect(rect, [0; 3]);
    }
    Ok(cost.write_png(args.output.join("cost.png"))?)
}

/// A rectangle of the frame on a canvas of another size.
fn scaled(rect: Rect, frame: Rect, (width, height): (u32, u32)) -> Rect {
    let x = |x: u32| (u64::from(x) * u64::from(width) / u64::from(frame.width())) as u32;
    let y = |y: u32| (u64::from(y) * u64::from(height) / u64::from(frame.height())) as u32;
    Rect::new(x(rect.x0), y(rect.y0), x(rect.x1), y(rect.y1))
}

fn report(analysis: &Analysis) -> Value {
    let total: f64 = analysis.rows.iter().map(|row| row.complexity).sum();
    let zones: Vec<Value> = analysis
        .rows
        .iter()
        .map(|row| {
            json!({
                "id": row.zone.0,
                "rect": [row.rect.x0, row.rect.y0, row.rect.x1, row.rect.y1],
                "size": row.size(),
                "complexity": row.complexity,
                "share_of_cost": row.complexity / total,
                "neighbor_difference": row.neighbor_difference,
            })
        })
        .collect();
    let (columns, rows) = analysis.map.size();
    json!({"map": [columns, rows], "zones": zones})
}
