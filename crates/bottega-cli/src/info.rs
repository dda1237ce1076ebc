//! `bottega info`: the contents of a scene file.

use std::process::ExitCode;

use bottega::request::SceneOptions;
use bottega_scene::SceneSummary;
use serde_json::{Value, json};

use crate::{cli::InfoArgs, error::CliError};

pub(crate) fn run(args: &InfoArgs) -> Result<ExitCode, CliError> {
    let mut scene = SceneOptions::new(&args.scene_file);
    args.import.apply(&mut scene);
    let loaded = bottega_scene::load(&scene.file, &scene.load_options())?;
    let summary = loaded.summary();
    let integrator = loaded.hints.integrator.as_ref().map(|hint| hint.name.as_str());
    let warnings: Vec<String> = loaded.warnings.iter().map(ToString::to_string).collect();
    if args.json {
        println!("{}", as_json(&summary, integrator, &warnings));
    } else {
        print(&summary, integrator, &warnings);
    }
    Ok(ExitCode::SUCCESS)
}

fn as_json(summary: &SceneSummary, integrator: Option<&str>, warnings: &[String]) -> Value {
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
        "warnings": warnings,
    })
}

fn print(summary: &SceneSummary, integrator: Option<&str>, warnings: &[String]) {
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
