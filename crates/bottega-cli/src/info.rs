//! `bottega info`: the contents of a scene file.

use std::{collections::BTreeMap, process::ExitCode};

use bottega::request::SceneOptions;
use bottega_scene::{SceneSummary, Warning};
use serde_json::{Value, json};

use crate::{cli::InfoArgs, error::CliError};

pub(crate) fn run(args: &InfoArgs) -> Result<ExitCode, CliError> {
    let mut scene = SceneOptions::new(&args.scene_file);
    args.import.apply(&mut scene);
    let loaded = bottega_scene::load(&scene.file, &scene.load_options())?;
    let summary = loaded.summary();
    let integrator = loaded.hints.integrator.as_ref().map(|hint| hint.name.as_str());
    if args.json {
        println!("{}", as_json(&summary, integrator, &loaded.warnings));
    } else if args.support {
        print_support(&summary, &loaded.warnings);
    } else {
        print(&summary, integrator, &loaded.warnings);
    }
    Ok(ExitCode::SUCCESS)
}

fn as_json(summary: &SceneSummary, integrator: Option<&str>, warnings: &[Warning]) -> Value {
    let texts = |only: bool| -> Vec<String> {
        warnings.iter().filter(|it| it.is_unsupported || !only).map(ToString::to_string).collect()
    };
    let named = |list: &[(String, &'static str)]| -> Vec<Value> {
        list.iter().map(|(name, kind)| json!({"name": name, "kind": kind})).collect()
    };
    let images: Vec<Value> = summary
        .images
        .iter()
        .map(|(name, width, height, bytes)| json!({"name": name, "width": width, "height": height, "bytes": bytes}))
        .collect();
    json!({
        "format": summary.metadata.format,
        "generator": summary.metadata.generator,
        "extensions": summary.metadata.extensions,
        "digest": summary.digest,
        "meshes": summary.mesh_count,
        "instances": summary.instance_count,
        "triangles": summary.triangle_count,
        "triangles_stored": summary.stored_triangle_count,
        "spheres": summary.sphere_count,
        "moving": summary.moving_count,
        "shutter": summary.shutter,
        "bounds": [summary.bounds.0.to_array(), summary.bounds.1.to_array()],
        "memory_bytes": summary.memory_bytes,
        "cameras": named(&summary.cameras),
        "materials": summary.materials,
        "lights": named(&summary.lights),
        "images": images,
        "environment": summary.environment,
        "integrator": integrator,
        "warnings": texts(false),
        "unsupported": texts(true),
    })
}

fn print(summary: &SceneSummary, integrator: Option<&str>, warnings: &[Warning]) {
    let shown = |name: &str| if name.is_empty() { "(unnamed)".to_owned() } else { name.to_owned() };
    let list = |names: Vec<String>| format!("{:<4} {}", names.len(), names.join(", "));
    let named = |list: &[(String, &'static str)]| -> Vec<String> {
        list.iter().map(|(name, kind)| format!("{} ({kind})", shown(name))).collect()
    };
    let generator = summary.metadata.generator.as_ref().map_or(String::new(), |by| format!(", written by {by}"));
    println!("format      {}{generator}", summary.metadata.format);
    if !summary.metadata.extensions.is_empty() {
        println!("extensions  {}", summary.metadata.extensions.join(", "));
    }
    println!("digest      {}", summary.digest);
    println!(
        "triangles   {} in {} placed meshes ({} stored in {} meshes)",
        summary.triangle_count, summary.instance_count, summary.stored_triangle_count, summary.mesh_count
    );
    println!("bounds      {:.4} to {:.4}", summary.bounds.0, summary.bounds.1);
    if summary.moving_count > 0 {
        let [open, close] = summary.shutter;
        println!("moving      {} parts; the shutter is open from {open} to {close}", summary.moving_count);
    }
    println!("memory      {:.1} MB", summary.memory_bytes as f64 / 1e6);
    println!("cameras     {}", list(named(&summary.cameras)));
    println!("lights      {}", list(named(&summary.lights)));
    println!("materials   {}", list(summary.materials.iter().map(|name| shown(name)).collect()));
    let images = summary.images.iter().map(|(name, width, height, _)| format!("{} {width}x{height}", shown(name)));
    println!("images      {}", list(images.collect()));
    if let Some(environment) = &summary.environment {
        println!("environment {}", shown(environment));
    }
    if let Some(integrator) = integrator {
        println!("integrator  {}", shown(integrator));
    }
    for warning in warnings {
        println!("warning     {warning}");
    }
}

/// Prints what is read of a scene, what is replaced or left out, and what else is worth knowing.
fn print_support(summary: &SceneSummary, warnings: &[Warning]) {
    println!("read");
    let kinds = |list: &[(String, &'static str)]| {
        let mut counts = BTreeMap::<&str, usize>::new();
        list.iter().for_each(|(_, kind)| *counts.entry(kind).or_default() += 1);
        counts.into_iter().map(|(kind, count)| format!("{count} {kind}")).collect::<Vec<_>>()
    };
    let glowing = summary.materials.iter().filter(|name| name.ends_with('*')).count();
    let mut lights = kinds(&summary.lights);
    lights.extend((glowing > 0).then(|| format!("{glowing} glowing materials")));
    lights.extend(summary.environment.as_ref().map(|name| format!("environment {name}").trim_end().to_owned()));
    let mut shapes = vec![format!("{} meshes with {} triangles", summary.instance_count, summary.triangle_count)];
    shapes.extend((summary.sphere_count > 0).then(|| format!("{} spheres", summary.sphere_count)));
    let [open, close] = summary.shutter;
    let rows = [
        ("geometry", shapes),
        ("materials", vec![summary.materials.len().to_string()]),
        ("images", vec![summary.images.len().to_string()]),
        ("lights", lights),
        ("cameras", kinds(&summary.cameras)),
        ("motion", vec![format!("{} parts, shutter open from {open} to {close}", summary.moving_count)]),
    ];
    let is_there = |row: &&(&str, Vec<String>)| row.0 != "motion" || summary.moving_count > 0;
    for (what, parts) in rows.iter().filter(is_there) {
        println!("  {what:<10} {}", if parts.is_empty() { "none".to_owned() } else { parts.join(", ") });
    }
    let (unsupported, others): (Vec<_>, Vec<_>) = warnings.iter().partition(|warning| warning.is_unsupported);
    for (heading, list) in [("replaced or left out", unsupported), ("also", others)] {
        let found = by_message(&list);
        if heading != "also" || !found.is_empty() {
            println!("{heading}{}", if found.is_empty() { ": nothing" } else { "" });
        }
        for (message, count, place) in found {
            let times = if count > 1 { format!("{count} × ") } else { String::new() };
            let place = if place.is_empty() { String::new() } else { format!("  ({}{place})", first_of(count)) };
            println!("  {times}{message}{place}");
        }
    }
}

fn first_of(count: usize) -> &'static str {
    if count > 1 { "first: " } else { "" }
}

/// Returns each message once, with the number of its places and the first of them.
fn by_message<'a>(warnings: &[&'a Warning]) -> Vec<(&'a str, usize, &'a str)> {
    let mut found: Vec<(&str, usize, &str)> = Vec::new();
    for warning in warnings {
        match found.iter_mut().find(|(message, ..)| *message == warning.message) {
            Some((_, count, _)) => *count += 1,
            None => found.push((&warning.message, 1, &warning.place)),
        }
    }
    found
}
